"""The ensemble: sports cars drawn at random on drives below their limits, and how twins err.

Cars are drawn by `scenarios.plants.random_car`: tyres, springs, drag, what reaches the wheels,
where the sensors sit and what they add. Their road is level and smooth, as their height is compared
with a twin's. Drives stay at 70 % of the car's limits: at the limits a twin whose tyres grip less
than the car's spins where the car does not, and no linear gain holds it.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from estimators.til.forecast_errors import ForecastErrors, forecast_errors
from scenarios.driving.drivers import limits_of
from scenarios.driving.manoeuvres import lane_changes, laps
from scenarios.driving.record import CourseManoeuvre
from scenarios.experiment.experiment import Case
from scenarios.experiment.sideslip_and_mass import MISSING, SNR, TWIN, DriveName
from scenarios.plants.random_car import RealCar, properties, random_car
from scenarios.plants.real_record import record_real
from scenarios.plants.real_sensors import told
from scenarios.plants.real_vehicle import real_vehicle
from twin import PARAMETERS, Drive, RigidBody, Twin, Vehicle, parameter_deltas

OF_LIMITS = 0.7  # of lateral, accelerating and braking forces; chosen
DRAWN = tuple(p for p in properties() if p not in ("road", "hills", "slope", "crossfall"))
DRIVES: tuple[DriveName, ...] = ("laps", "lane-change")
TUNING_CARS = tuple(range(6))  # seeds
HELD_OUT_CARS = 100  # the first one
TUNING_SECONDS = 40.0  # of each drive that gains are made from or tuned on
HELD_OUT_SECONDS = {"laps": 105.0, "lane-change": 80.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnCar:
    """A sports car drawn at random, on a drive below its limits.

    Attributes:
        seed: of the car.
        drive_name: which drive.
    """

    seed: int
    drive_name: DriveName

    def real(self) -> RealCar:
        """How it differs from its file."""
        return random_car(self.seed, DRAWN)

    def vehicle(self) -> Vehicle:
        """What is drawn."""
        return real_vehicle(Vehicle.load(TWIN), self.real())

    def clean(self, duration: float | None) -> Drive:
        """Without noise, recorded once."""
        return _recorded(self, duration)

    def load(self, nominal: RigidBody) -> dict[str, float]:
        """See `CarPlant`."""
        deltas = parameter_deltas(nominal, Vehicle.load(TWIN).chassis())
        return dict(zip(PARAMETERS, deltas.tolist(), strict=True))

    def drive(self, case: Case, rng: np.random.Generator, duration: float | None) -> Drive:
        """What its bus shows."""
        return told(self.clean(duration), self.real(), case.snr, rng)


@cache
def _recorded(car: DrawnCar, duration: float | None) -> Drive:
    seconds = HELD_OUT_SECONDS[car.drive_name] if duration is None else duration
    return record_real(Vehicle.load(TWIN), car.real(), manoeuvre(car.drive_name, seconds))


def manoeuvre(name: DriveName, seconds: float) -> CourseManoeuvre:
    """A drive below the car's limits."""
    full = limits_of(Vehicle.load(TWIN))
    limits = replace(
        full,
        lateral=OF_LIMITS * full.lateral,
        accelerating=OF_LIMITS * full.accelerating,
        braking=OF_LIMITS * full.braking,
    )
    if name == "laps":
        return laps(duration=seconds, limits=limits)
    return lane_changes(duration=seconds, limits=limits, lateral=OF_LIMITS)


def case(seed: int, drive_name: DriveName) -> Case:
    """A drawn car on a drive; the estimators believe that 350 kg are missing, TiL Section 5.3."""
    return Case(
        name=f"car {seed}, {drive_name}",
        plant=DrawnCar(seed=seed, drive_name=drive_name),
        twin=TWIN,
        snr=SNR,
        initial=(("mass", MISSING),),
    )


def ensemble(seconds: float) -> list[ForecastErrors]:
    """How twins of the right mass err on drives of the tuning cars.

    Args:
        seconds: of each drive.
    """
    twin, rng = Twin(Vehicle.load(TWIN)), np.random.default_rng(0)
    return [
        forecast_errors(twin, case(seed, name).noisy_drive(seed, seconds), rng, {})
        for name in DRIVES
        for seed in TUNING_CARS
    ]
