"""The scenario of KBF: a truck on an ISO 8608 road whose load changes while it drives."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.road import iso8608_road
from twin.truck import LoadStage, Truck, TruckRecord
from twin.truck_parameters import SprungMass, TruckParameters

Array = NDArray[np.float64]

SAMPLE_TIME = 1e-3  # [s]
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
        duration: [s]; not in the paper, as long again as the two other stages.
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
    duration: float = 21.0
    coherence_decay: float = 20.0
    gravity: float = 0.0
    gravity_aware: bool = True
    spring_factor: float = 1.0
    damper_factor: float = 1.0
    deflection_offset: float = 0.0
    cm_x: float = 0.0


class TruckDrive(NamedTuple):
    """A recorded drive.

    Attributes:
        time: [s]. Shape (n,).
        deflections: measured, columns `twin.truck.DEFLECTIONS`. Shape (n, 8).
        rates: measured, columns `twin.truck.RATES`. Shape (n, 3).
        truth: what really happened; for scoring only.
    """

    time: Array
    deflections: Array
    rates: Array
    truth: TruckRecord


def make_drive(case: TruckCase, seed: int) -> TruckDrive:
    """Drives the truck over its road; the same case and seed give the same drive, to the bit.

    The truck starts at rest on level ground and is on the road from the first sample on. Seeds
    draw the road, the process noise and the sensor noise from streams of their own, so cases that
    differ in something else share them.
    """
    road_rng, process_rng, sensor_rng = np.random.default_rng(seed).spawn(3)
    noise = NOISE[case.noise]
    truck = Truck(real_parameters(case), gravity=case.gravity)
    n = round(case.duration / SAMPLE_TIME)
    distance = case.speed * SAMPLE_TIME * np.arange(n)
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
    return TruckDrive(record.time, deflections, rates, record)


def real_parameters(case: TruckCase) -> TruckParameters:
    """The real truck of a case."""
    paper = TruckParameters()
    springs, dampers = paper.spring_stiffness, paper.damping
    return TruckParameters(
        nominal=SprungMass(cm_x=case.cm_x),
        spring_stiffness=(springs[0] * case.spring_factor, springs[1] * case.spring_factor),
        damping=(dampers[0] * case.damper_factor, dampers[1] * case.damper_factor),
    )
