"""The drive of KBF: a truck on an ISO 8608 road whose load changes while it drives."""

from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.experiment.experiment import Case
from scenarios.experiment.result import versions
from twin import Drive, TwinError
from twin.road import iso8608_road
from twin.truck.model import DEFLECTIONS, RATES, LoadStage, Truck, TruckRecord
from twin.truck.parameters import SprungMass, TruckParameters
from twin.truck.twin import ROAD_HEIGHTS, TRUCK_PARAMETERS, TRUCK_STATES

Array = NDArray[np.float64]

SAMPLE_TIME = 1e-3  # [s]
FULL_DURATION = 21.0  # [s]; not in the paper, as long again as the two stages before
LOAD_STEPS = ((7.0, 1.5), (14.0, 0.5))  # time [s], load by the nominal one: KBF Section 4


class NoiseReading(NamedTuple):
    """KBF gives noise magnitudes and does not say of what: of deviations, or of variances.

    Attributes:
        acceleration: standard deviation of the process noise per sample [m/s2, rad/s2].
        sensors: standard deviation of the three measured rates [m/s, rad/s, rad/s].
        parameter_density: of the matched filter [1/s], tuned for this noise.
    """

    acceleration: float
    sensors: tuple[float, float, float]
    parameter_density: float


NOISE = {
    "std noise": NoiseReading(1e-3, (1e-3, 1e-4, 1e-4), 1.5e-3),
    "variance noise": NoiseReading(1e-3**0.5, (1e-3**0.5, 1e-4**0.5, 1e-4**0.5), 2e-2),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TruckOnRoad:
    """A truck on a road, and how far it is from what its estimators believe (KBF, Table 1).

    Attributes:
        noise: a key of `NOISE`.
        road_class: ISO 8608.
        speed: [m/s]; not in the paper, chosen.
        coherence_decay: of the two tracks [m], `iso8608_road`; the paper says only that they
            differ. Chosen: all but waves of some 30 m and more are nearly independent.
        gravity: of the real truck [m/s2].
        gravity_aware: whether the estimators know it.
        spring_factor: stiffness of the real springs by Table 1.
        damper_factor: damping of the real dampers by Table 1.
        deflection_offset: of all four measured deflections [m].
        cm_x: of the real load ahead of the nominal centre of mass [m].

    Raises:
        TwinError: a value that no truck can have.
    """

    noise: str = "std noise"
    road_class: str = "C"
    speed: float = 15.0
    coherence_decay: float = 20.0
    gravity: float = 0.0
    gravity_aware: bool = True
    spring_factor: float = 1.0
    damper_factor: float = 1.0
    deflection_offset: float = 0.0
    cm_x: float = 0.0

    def __post_init__(self) -> None:
        if self.noise not in NOISE:
            raise TwinError(f"truck: noise is {self.noise!r}; allowed: {', '.join(NOISE)}")
        for name in ("speed", "coherence_decay", "spring_factor", "damper_factor"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise TwinError(
                    f"truck: {name} is {getattr(self, name)}; allowed: positive, finite"
                )

    @property
    def known_gravity(self) -> float:
        """What an estimator believes gravity to be [m/s2]."""
        return self.gravity if self.gravity_aware else 0.0

    def drive(self, case: Case, rng: np.random.Generator, duration: float | None = None) -> Drive:
        """Drives the truck; the same case and seed give the same drive, to the bit.

        The truck starts at rest on level ground and is on the road from the first sample on. Road,
        process noise and sensor noise are drawn from streams of their own, so that trucks that
        differ in something else share them.

        Returns:
            Inputs are the road heights, measurements the noisy `RATES` and `DEFLECTIONS`. The truth
            holds the parameters of the load, the states and the way travelled, x [m].

        Raises:
            TwinError: the drive is shorter than two samples.
        """
        road_rng, process_rng, sensor_rng = rng.spawn(3)
        noise = NOISE[self.noise]
        truck = Truck(real_parameters(self), gravity=self.gravity)
        duration = min(duration or FULL_DURATION, FULL_DURATION)
        n = round(duration / SAMPLE_TIME)
        if n < 2:
            raise TwinError(f"truck: duration is {duration} s; allowed: {2 * SAMPLE_TIME} or more")
        distance = self.speed * SAMPLE_TIME * np.arange(n, dtype=np.float64)
        length = max(distance[-1] + truck.parameters.wheelbase, 100.0)  # ISO's longest wave: 91 m
        road = iso8608_road(
            road_rng,
            length=length,
            road_class=self.road_class,
            coherence_decay=self.coherence_decay,
        )
        heights = road.wheel_heights(distance, truck.parameters.wheelbase)
        process = noise.acceleration * process_rng.standard_normal((n, 7))
        nominal = truck.parameters.nominal
        stages = [LoadStage(start, nominal.scaled(factor)) for start, factor in LOAD_STEPS]
        record = truck.record(heights, [s for s in stages if s.start < duration], process)
        deflections = record.deflections.copy()
        deflections[:, :4] += self.deflection_offset
        rates = record.rates + np.array(noise.sensors) * sensor_rng.standard_normal((n, 3))
        settings = {"scenario": "truck", "case": case.name, "duration": duration, **asdict(self)}
        return Drive(
            time=record.time,
            inputs=heights,
            input_names=ROAD_HEIGHTS,
            measurements=np.hstack([rates, deflections]),
            output_names=RATES + DEFLECTIONS,
            truth=_truth(record, distance),
            settings=settings | {"versions": versions()},
        )


def _truth(record: TruckRecord, distance: Array) -> dict[str, Array]:
    names = (*TRUCK_PARAMETERS, *TRUCK_STATES)
    columns = np.hstack([record.parameters, record.positions, record.velocities])
    return {"x": distance, **{name: columns[:, i] for i, name in enumerate(names)}}


def real_parameters(real: TruckOnRoad) -> TruckParameters:
    """The real truck."""
    paper = TruckParameters()
    springs, dampers = paper.spring_stiffness, paper.damping
    return TruckParameters(
        nominal=SprungMass(cm_x=real.cm_x),
        spring_stiffness=(springs[0] * real.spring_factor, springs[1] * real.spring_factor),
        damping=(dampers[0] * real.damper_factor, dampers[1] * real.damper_factor),
    )
