"""What weighing takes from a car's file: its masses and the radius of its driven wheels."""

from dataclasses import dataclass
from pathlib import Path

import models
from estimators.weigh.calibration import Calibration
from scenarios.weighing.calibration_file import read_calibration
from twin import Twin, TwinError, Vehicle

# How well a kerb mass from a data sheet is known with a driver on board [kg]; chosen: equipment,
# half a tank, a driver of 60 to 90 kg
MASS_SD = 25.0
_LEAST_TORQUE_RADIUS = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Car:
    """A car to weigh.

    Attributes:
        name: of its file, without the ending.
        mass: with its driver and no load [kg].
        rotating_mass: sum(J / R^2) of all wheels and what turns with them [kg].
        radius: at which the driven wheels roll, the mean of all four [m].
    """

    name: str
    mass: float
    rotating_mass: float
    radius: float


def car_of(vehicle: Vehicle) -> Car:
    """The car of a vehicle's files, standing on level ground.

    A tyre rolls at its unloaded radius less a third of its deflection (Pacejka, section 8.3.1).
    """
    twin = Twin(vehicle)
    twin.reset(0.0)
    unloaded = vehicle.tyres()["unloaded_radius"].astype(float)
    loaded = twin.data.xpos[twin.car.wheel_body, 2]
    radius = unloaded - (unloaded - loaded) / 3.0
    return Car(
        name=vehicle.source.stem,
        mass=float(twin.model.body_subtreemass[0]),
        rotating_mass=float((twin.car.spin_inertia / radius**2).sum()),
        radius=float(radius.mean()),
    )


def known_calibration(vehicle: Vehicle, given: Path | None) -> Calibration | None:
    """The calibration that is given, else the one beside the car's file or of the project.

    Args:
        vehicle: the car.
        given: a file; None: look for NAME.weighing.toml beside the car's file, then for
            weighing/NAME.toml of the project.

    Raises:
        TwinError: the file is missing or broken.
    """
    if given is not None:
        return read_calibration(given)
    name = vehicle.source.stem
    beside = vehicle.source.with_name(f"{name}.weighing.toml")
    for path in (beside, models.path(f"weighing/{name}.toml")):
        if path.is_file():
            return read_calibration(path)
    return None


def check_car(car: Car, calibration: Calibration) -> None:
    """Refuses a calibration of another car.

    Raises:
        TwinError: masses differ by more than a kilogram.
    """
    for field in ("mass", "rotating_mass"):
        ours, theirs = getattr(car, field), getattr(calibration, field)
        if abs(ours - theirs) > 1.0:
            raise TwinError(
                f"{car.name}: {field} is {ours:.1f} kg, the calibration has {theirs:.1f} kg; "
                "allowed: a calibration of this car file, see --calibrate"
            )
