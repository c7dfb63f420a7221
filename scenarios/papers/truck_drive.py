"""The drive of KBF: a truck on an ISO 8608 road whose load changes while it drives."""

from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
class TruckCase:
    """A drive and how far the real truck is from what the filter believes (KBF, Table 1).

    Attributes:
        name: for the tables.
        noise: a key of `NOISE`.
        road_class: ISO 8608.
        speed: [m/s]; not in the paper, chosen.
        duration: [s].
        coherence_decay: of the two tracks [m], `iso8608_road`; the paper says only that they
            differ. Chosen: all but waves of some 30 m and more are nearly independent.
        gravity: of the real truck [m/s2].
        gravity_aware: whether the filter knows it.
        spring_factor: stiffness of the real springs by Table 1.
        damper_factor: damping of the real dampers by Table 1.
        deflection_offset: of all four measured deflections [m].
        cm_x: of the real load ahead of the nominal centre of mass [m].
    """

    name: str = "std noise"
    noise: str = "std noise"
    road_class: str = "C"
    speed: float = 15.0
    duration: float = FULL_DURATION
    coherence_decay: float = 20.0
    gravity: float = 0.0
    gravity_aware: bool = True
    spring_factor: float = 1.0
    damper_factor: float = 1.0
    deflection_offset: float = 0.0
    cm_x: float = 0.0


def make_drive(case: TruckCase, seed: int) -> Drive:
    """Drives the truck over its road; the same case and seed give the same drive, to the bit.

    The truck starts at rest on level ground and is on the road from the first sample on. Seeds
    draw the road, the process noise and the sensor noise from streams of their own, so cases that
    differ in something else share them.

    Returns:
        Inputs are the road heights, measurements the noisy `RATES` and `DEFLECTIONS`. The truth
        holds the parameters of the load, the states and the way travelled, x [m].

    Raises:
        TwinError: the drive is shorter than two samples.
    """
    road_rng, process_rng, sensor_rng = np.random.default_rng(seed).spawn(3)
    noise = NOISE[case.noise]
    truck = Truck(real_parameters(case), gravity=case.gravity)
    n = round(case.duration / SAMPLE_TIME)
    if n < 2:
        raise TwinError(f"truck: duration is {case.duration} s; allowed: {2 * SAMPLE_TIME} or more")
    distance = case.speed * SAMPLE_TIME * np.arange(n, dtype=np.float64)
    length = max(distance[-1] + truck.parameters.wheelbase, 100.0)  # ISO's longest wave: 91 m
    road = iso8608_road(
        road_rng,
        length=length,
        road_class=case.road_class,
        coherence_decay=case.coherence_decay,
    )
    heights = road.wheel_heights(distance, truck.parameters.wheelbase)
    process = noise.acceleration * process_rng.standard_normal((n, 7))
    nominal = truck.parameters.nominal
    stages = [LoadStage(start, nominal.scaled(factor)) for start, factor in LOAD_STEPS]
    record = truck.record(heights, [s for s in stages if s.start < case.duration], process)
    deflections = record.deflections.copy()
    deflections[:, :4] += case.deflection_offset
    rates = record.rates + np.array(noise.sensors) * sensor_rng.standard_normal((n, 3))
    return Drive(
        time=record.time,
        inputs=heights,
        input_names=ROAD_HEIGHTS,
        measurements=np.hstack([rates, deflections]),
        output_names=RATES + DEFLECTIONS,
        truth=_truth(record, distance),
        settings={"scenario": "truck", "seed": seed, **asdict(case), "versions": versions()},
    )


def _truth(record: TruckRecord, distance: Array) -> dict[str, Array]:
    names = (*TRUCK_PARAMETERS, *TRUCK_STATES)
    columns = np.hstack([record.parameters, record.positions, record.velocities])
    return {"x": distance, **{name: columns[:, i] for i, name in enumerate(names)}}


def real_parameters(case: TruckCase) -> TruckParameters:
    """The real truck of a case."""
    paper = TruckParameters()
    springs, dampers = paper.spring_stiffness, paper.damping
    return TruckParameters(
        nominal=SprungMass(cm_x=case.cm_x),
        spring_stiffness=(springs[0] * case.spring_factor, springs[1] * case.spring_factor),
        damping=(dampers[0] * case.damper_factor, dampers[1] * case.damper_factor),
    )
