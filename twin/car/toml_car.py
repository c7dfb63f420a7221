"""A car described in one TOML file, as an MJCF: `twin.car.fields` says which fields there are."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import models
from twin.car.fields import BOUNDS, SECTIONS, Section
from twin.car.inertia import check_inertia
from twin.car.mjcf import tyre_path
from twin.car.tyre_figures import scale_tyre
from twin.errors import TwinError
from twin.logs.car_signals import CarSignals
from twin.toml_file import Table, read_toml, shown
from twin.tyre.files import read_tyre_file
from twin.tyre.interface import MAGIC_FORMULA

GRAVITY = 9.81  # [m/s2], as in models/suv.xml

Car = dict[str, dict[str, Any]]
"""Values by section and field; None where an optional one is left out."""


def read_car(path: Path, changes: Mapping[str, float] | None = None) -> Car:
    """Reads and checks a car.

    Args:
        path: of the file.
        changes: values by section and field, as "chassis.Jzz", in place of the file's; what is out
            of range is taken to its end.

    Raises:
        TwinError: the file is missing or broken, or a field is unknown, of another type or out of
            range.
    """
    table = read_toml(path)
    _check_tables(table)
    CarSignals.of(table.table("signals"))
    car = {section.name: _read_section(table, section) for section in SECTIONS}
    for name, value in (changes or {}).items():
        section, _, field = name.rpartition(".")
        least, largest = BOUNDS[name]
        car[section][field] = min(max(value, least), largest)
    return car


def car_spec(path: Path, changes: Mapping[str, float] | None = None) -> mujoco.MjSpec:
    """A car of a file, as an editable MJCF: the project's SUV with every number of the file.

    The chassis frame stands at the IMU. Springs are as long as it takes to stand level.

    Args:
        path: of the file.
        changes: as of `read_car`.

    Raises:
        TwinError: as `read_car`, or no body has such an inertia.
    """
    car = read_car(path, changes)
    check_inertia(path, car["chassis"])
    spec = mujoco.MjSpec.from_file(str(models.path("suv")))
    spec.modelname = path.stem
    _set_chassis(spec, car)
    for axle, tyre in zip(("front", "rear"), car_tyres(path, changes), strict=True):
        _set_axle(spec, car, axle, float(tyre["unloaded_radius"]))
    steering, air = car["steering"], car["aerodynamics"]
    numbers = {"steering_ratio": steering["ratio"], "ackermann": steering["ackermann"]}
    numbers |= air | car["drivetrain"]
    for name, value in numbers.items():
        spec.numeric(name).data = [value]
    return spec


def car_tyres(path: Path, changes: Mapping[str, float] | None = None) -> np.ndarray:
    """Coefficients of the front and the rear tyre, (2,) records.

    Args:
        path: of the file.
        changes: as of `read_car`.

    Raises:
        TwinError: as `read_car`, or a .tir file is missing or broken.
    """
    car = read_car(path, changes)
    return np.array([_tyre(path, car, axle) for axle in ("front", "rear")])


def _check_tables(table: Table) -> None:
    """Checks the names of the tables and of the fields in them."""
    outer = {section.name.partition(".")[0] for section in SECTIONS} | {"signals"}
    table.check_keys((*sorted(outer), "guessed"))
    for name, inner in table.tables():
        if name == "guessed":
            inner.check_keys(f"{s.name}.{field.name}" for s in SECTIONS for field in s.fields)
            continue
        allowed = [s.name.partition(".")[2] for s in SECTIONS if s.name.startswith(f"{name}.")]
        if allowed:
            inner.check_keys(allowed)


def _read_section(table: Table, section: Section) -> dict[str, Any]:
    for part in section.name.split("."):
        table = table.table(part)
    table.check_keys([field.name for field in section.fields])
    values: dict[str, Any] = {}
    for field in section.fields:
        if isinstance(field.default, str):
            values[field.name] = table.text(field.name, field.default)
        elif section.optional and field.name not in table:
            values[field.name] = None
        else:
            values[field.name] = table.number(field.name, field.default, field.least, field.largest)
    return values


def _set_chassis(spec: mujoco.MjSpec, car: Car) -> None:
    chassis, imu, geometry = car["chassis"], car["imu"], car["geometry"]
    body = spec.body("chassis")
    stretch = np.array(
        [
            geometry["wheelbase"] / 2.9,  # of models/suv.xml, as the drawn body is
            0.5 * (geometry["track_front"] + geometry["track_rear"]) / 1.65,
            1.0,
        ]
    )
    for geom in body.geoms:
        drawn = geom.pos + np.array([-1.25, 0.0, 0.644])  # from the front axle on the road
        geom.pos = drawn * stretch - _imu(car)
        geom.size = geom.size * stretch
    body.pos = [0.0, 0.0, imu["height"]]
    body.mass = chassis["mass"]
    body.ipos = np.array(
        [-chassis["cm_to_front_axle"], chassis["cm_left"], chassis["cm_height"]]
    ) - _imu(car)
    body.fullinertia = [chassis[name] for name in ("Jxx", "Jyy", "Jzz", "Jxy", "Jxz", "Jyz")]


def _imu(car: Car) -> np.ndarray:
    """Where the chassis frame stands, from the road below the front axle's middle (3,) [m]."""
    imu = car["imu"]
    return np.array([-imu["to_front_axle"], imu["left"], imu["height"]])


def _set_axle(spec: mujoco.MjSpec, car: Car, axle: str, radius: float) -> None:
    rates, geometry, chassis = car[f"suspension.{axle}"], car["geometry"], car["chassis"]
    half_track = 0.5 * geometry[f"track_{axle}"]
    front_share = 1.0 - chassis["cm_to_front_axle"] / geometry["wheelbase"]
    share = front_share if axle == "front" else 1.0 - front_share
    sprung = 0.5 * share * chassis["mass"] * GRAVITY
    for side, wheel in ((1.0, f"{axle[0]}l"), (-1.0, f"{axle[0]}r")):
        hub, rim = spec.body(f"hub_{wheel}"), spec.body(f"wheel_{wheel}")
        x = 0.0 if axle == "front" else -geometry["wheelbase"]
        hub.pos = np.array([x, side * half_track, geometry["wheel_centre_height"]]) - _imu(car)
        # hubs and rims as compact as the SUV's
        hub.mass, hub.inertia = rates["hub_mass"], np.full(3, 0.3 / 25.0 * rates["hub_mass"])
        rim.mass = rates["wheel_mass"]
        rim.inertia = rates["wheel_inertia"] * np.array([1.0 / 1.7, 1.0, 1.0 / 1.7])
        for geom in rim.geoms:
            geom.size = geom.size * radius / 0.369  # the drawn SUV's
        joint = spec.joint(f"travel_{wheel}")
        lean = rates["roll_centre_height"] / half_track
        joint.axis = [rates["travel_slope"], side * lean, 1.0]
        joint.stiffness = _linear(rates["stiffness"])
        joint.damping = _linear(rates["damping"])
        joint.springref = -sprung / rates["stiffness"]
        stop = spec.tendon(f"bump_stop_{wheel}")
        stop.stiffness = _linear(rates["bump_stop"])
        stop.springlength = [-rates["free_travel"], rates["free_travel"]]
    spec.tendon(f"anti_roll_{axle}").stiffness = _linear(rates["anti_roll"])


def _linear(rate: float) -> list[float]:
    """Coefficients of MuJoCo's polynomial of a spring or damper."""
    return [rate, 0.0, 0.0]


def _tyre(path: Path, car: Car, axle: str) -> np.void:
    """A tyre's file with what the car's file says of it."""
    given = car[f"tyre.{axle}"]
    tyre = np.array(read_tyre_file(tyre_path(path, str(given["file"]))))
    figures = {key: value for key, value in given.items() if key != "file" and value is not None}
    if figures and tyre["model"] != MAGIC_FORMULA:
        raise TwinError(
            f"{path}: tyre.{axle}.{next(iter(figures))} does not apply to {shown(given['file'])}; "
            "allowed: figures beside a .tir file only"
        )
    scale_tyre(tyre, **figures)
    return tyre[()]  # pyright: ignore[reportReturnType]
