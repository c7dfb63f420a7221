"""Real vehicles on drives: simulated cars, one whose load changes, another program's car."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np

from scenarios.driving.drivers import driver_of
from scenarios.driving.joint_drives import load_change
from scenarios.driving.manoeuvres import lane_changes, laps
from scenarios.driving.record import CourseManoeuvre, Manoeuvre, record
from scenarios.experiment.experiment import INFINITE, Case
from scenarios.plants.mismatch import MISMATCHES, real_drive, real_vehicle
from scenarios.plants.vehicles import SUV_LOADS
from twin import PARAMETERS, Drive, RigidBody, Twin, TwinError, Vehicle, parameter_deltas
from twin.road import noisy_heights

GET_OUT = ("rear_left_passenger", "rear_right_passenger")  # 145 kg


@cache
def _recorded(plant: Any, duration: float | None) -> Drive:
    return plant.record(duration)


@cache
def _chassis(plant: Any) -> RigidBody:
    return plant.vehicle().chassis()


def _deltas(plant: Any, nominal: RigidBody) -> dict[str, float]:
    deltas = parameter_deltas(nominal, _chassis(plant))
    return dict(zip(PARAMETERS, deltas.tolist(), strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Simulated:
    """What all simulated cars share: the drive is recorded once, noise is added for each seed."""

    mismatch: str = "same"

    def clean(self, duration: float | None) -> Drive:
        """The drive without sensor noise, recorded once."""
        return _recorded(self, duration)

    def load(self, nominal: RigidBody) -> dict[str, float]:
        """What its chassis differs in from a twin's nominal one, by parameter."""
        return _deltas(self, nominal)

    def drive(self, case: Case, rng: np.random.Generator, duration: float | None) -> Drive:
        """With noise on the sensors and on the road that the estimators are told."""
        clean = self.clean(duration)
        drive = real_drive(clean, MISMATCHES[self.mismatch], case.snr, rng)
        if case.noise_on == "accelerations" and case.snr < INFINITE:
            drive = _with_integrated_noise(clean, drive, case.snr, rng)
        return _with_noisy_road(drive, case, rng) if case.road_noise > 0.0 else drive


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedCar(_Simulated):
    """A car of this project.

    Attributes:
        car: its name in `models`, load included.
        manoeuvre: what it drives, a function of a duration.
        mismatch: how it differs from its model, a name of `MISMATCHES`.
    """

    car: str
    manoeuvre: Callable[..., Manoeuvre | CourseManoeuvre]

    def vehicle(self) -> Vehicle:
        """The real vehicle."""
        return real_vehicle(Vehicle.load(self.car), MISMATCHES[self.mismatch])

    def record(self, duration: float | None) -> Drive:
        """Drives it."""
        vehicle = self.vehicle()
        return record(vehicle, self.manoeuvre(duration=duration), driver_of(vehicle))


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadChange(_Simulated):
    """An SUV from which two passengers get out at a stop halfway.

    Attributes:
        car: the empty car.
        mismatch: as of `SimulatedCar`.
    """

    car: str

    def vehicle(self) -> Vehicle:
        """The fully loaded car at the start."""
        return self._with(lambda load: True)

    def record(self, duration: float | None) -> Drive:
        """Drives both halves; a duration is that of both [s]."""
        return load_change(
            self.vehicle(), self._with(lambda load: load.name not in GET_OUT), duration
        )

    def _with(self, on_board: Callable[[Any], bool]) -> Vehicle:
        loaded = Vehicle.load(self.car).with_loads(load for load in SUV_LOADS if on_board(load))
        return real_vehicle(loaded, MISMATCHES[self.mismatch])


@dataclass(frozen=True, slots=True, kw_only=True)
class CommonRoadCar(_Simulated):
    """The BMW 320i of the program CommonRoad, an optional extra.

    Attributes:
        drives: "laps" or "lane-change".
    """

    drives: Literal["laps", "lane-change"]

    def load(self, nominal: RigidBody) -> dict[str, float]:
        """The mass its chassis differs in from its twin's."""
        truth = self.clean(2.0).truth
        return dict.fromkeys(PARAMETERS, 0.0) | {"mass": float(truth["mass"][0]) - nominal.mass}

    def vehicle(self) -> Vehicle:
        """The car that stands for it in a timeline: that of its twin."""
        return Vehicle.load("bmw_320i")

    def record(self, duration: float | None) -> Drive:
        """Drives it by CommonRoad's model."""
        from scenarios.plants import commonroad  # not at the top: an optional extra

        limits = commonroad.commonroad_limits()
        if self.drives == "laps":
            return commonroad.record(laps(duration=duration, limits=limits))
        lateral = commonroad.LANE_CHANGE_LATERAL
        return commonroad.record(lane_changes(duration=duration, limits=limits, lateral=lateral))


def _with_integrated_noise(
    clean: Drive, noisy: Drive, snr: float, rng: np.random.Generator
) -> Drive:
    """Rates whose noise is the integral of white noise on the angular accelerations."""
    measurements = noisy.measurements.copy()
    for name in ("roll_rate", "pitch_rate", "yaw_rate"):
        rate = clean.channel(name)
        acceleration = np.gradient(rate, clean.dt)
        sd = acceleration.std() * 10.0 ** (-snr / 20.0)
        walk = np.cumsum(rng.normal(0.0, sd, len(clean))) * clean.dt
        measurements[:, clean.output_names.index(name)] = rate + walk
    return noisy.replace(measurements=measurements)


def _with_noisy_road(drive: Drive, case: Case, rng: np.random.Generator) -> Drive:
    """TiL Eq. (17) on the known road; rear wheels meet the front's errors at a constant speed."""
    speed = float(drive.truth["vx"][0])
    if not speed > 0.0:
        raise TwinError(f"{case.name}: a noisy road needs a car that moves from the start")
    columns = [i for i, name in enumerate(drive.input_names) if name.startswith("road_height")]
    lag = round(Twin(Vehicle.load(case.twin)).car.wheelbase / speed / drive.dt)
    inputs = drive.inputs.copy()
    inputs[:, columns] = noisy_heights(rng, inputs[:, columns], case.road_noise, lag)
    return drive.replace(inputs=inputs)
