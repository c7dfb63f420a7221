"""A car described in one TOML file, as an MJCF: `twin.car.fields` says which fields there are."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import models
from twin.car.fields import SECTIONS, Section
from twin.car.inertia import check_inertia
from twin.car.mjcf import tyre_path
from twin.car.rules import Figures, derived, settled
from twin.errors import TwinError
from twin.logs.car_signals import TEMPLATE, CarSignals
from twin.toml_fields import Field
from twin.toml_file import Table, read_toml, reason, shown
from twin.tyre.files import read_tyre_file
from twin.tyre.interface import MAGIC_FORMULA, relaxation, stiffness
from twin.tyre.size import tyre_text

GRAVITY = 9.81  # [m/s2], as in models/suv.xml

Car = dict[str, dict[str, Any]]
"""Values by section and field; None where an optional one is left out."""


def read_car(path: Path) -> Car:
    """Reads and checks a car.

    Raises:
        TwinError: the file is missing or broken, or a field is unknown, of another type or out of
            range.
    """
    table = read_toml(path)
    _check_tables(table)
    CarSignals.of(table.table("signals"))
    return {section.name: _read_section(table, section) for section in SECTIONS}


def car_spec(path: Path) -> mujoco.MjSpec:
    """A car of a file, as an editable MJCF: the project's SUV with every number of the file.

    The chassis frame stands at the IMU. Springs are as long as it takes to stand level.

    Raises:
        TwinError: as `read_car`, or no body has such an inertia.
    """
    car = read_car(path)
    check_inertia(path, car["chassis"])
    spec = mujoco.MjSpec.from_file(str(models.path("suv")))
    spec.modelname = path.stem
    _set_chassis(spec, car)
    for axle, tyre in zip(("front", "rear"), car_tyres(path), strict=True):
        _set_axle(spec, car, axle, float(tyre["unloaded_radius"]))
    steering, air = car["steering"], car["aerodynamics"]
    numbers = {"steering_ratio": steering["ratio"], "ackermann": steering["ackermann"]}
    numbers |= air | car["drivetrain"]
    for name, value in numbers.items():
        spec.numeric(name).data = [value]
    return spec


def car_tyres(path: Path) -> np.ndarray:
    """Coefficients of the front and the rear tyre, (2,) records.

    Raises:
        TwinError: as `read_car`, or a .tir file is missing or broken.
    """
    car = read_car(path)
    return np.array([_tyre(path, car, axle) for axle in ("front", "rear")])


def write_template(name: str, figures: Figures | None = None) -> Path:
    """Writes NAME.toml, every field with its unit, range and value; returns its path.

    Args:
        name: of the car.
        figures: what is known of it; the rest follows by the rules of `twin.car.rules`. A tyre
            of these figures is written beside it as NAME.tir. None: all values are the SUV's.

    Raises:
        TwinError: there is such a file already, or it cannot be written.
    """
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if figures and figures.tyre:
        write_new(path, template(path.stem, figures))
        try:
            write_new(path.with_suffix(".tir"), tyre_text(figures.tyre, path.stem))
        except TwinError:
            path.unlink()
            raise
    else:
        write_new(path, template(path.stem, figures))
    return path


def write_new(path: Path, text: str) -> None:
    """Writes a file that must not be there yet.

    Raises:
        TwinError: there is such a file already, or it cannot be written.
    """
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise TwinError(f"{path}: is there already; allowed: a name that is not taken") from error
    except (OSError, ValueError) as error:
        raise TwinError(f"{path}: cannot be written: {reason(error)}") from error


def template(title: str, figures: Figures | None = None) -> str:
    """The text of a car's file: all defaults, which are the SUV's, or derived from figures.

    Values that nobody gave are repeated in the table `guessed`: one that is changed above it is no
    guess any more, see `twin.car.guesses`.
    """
    rules = {} if figures is None else {k: float(f"{v:.5g}") for k, v in derived(figures).items()}
    tyre = f"{title}.tir" if figures and figures.tyre else None
    lines = [
        f"# {title}: a car for `til ... --vehicle {title}.toml`. SI units; axes of ISO 8855 (x",
        "# forward, y left, z up). A field that is left out has the value it has here.",
    ]
    for section in SECTIONS:
        lines += ["", f"[{section.name}]", *(f"# {line}" for line in section.text if line)]
        for field in section.fields:
            value = rules.get((section.name, field.name), field.default)
            if tyre and isinstance(value, str):
                value = tyre
            lines.append(_line(field._replace(default=value), section.optional))
    if figures is not None:
        lines += ["", "# By rule, not by you: a field above that still has this value is a guess."]
        lines += [
            "[guessed]",
            *(f'"{name}" = {value!r}' for name, value in _guessed(figures, rules)),
        ]
    return "\n".join(lines) + "\n" + TEMPLATE


def _guessed(
    figures: Figures, rules: Mapping[tuple[str, str], float]
) -> Iterator[tuple[str, float]]:
    """The fields that no known figure settles, and their values."""
    known = settled(figures)
    for section in SECTIONS:
        if section.optional:
            continue
        for field in section.fields:
            if (section.name, field.name) not in known:
                value = rules.get((section.name, field.name), field.default)
                yield f"{section.name}.{field.name}", float(value)


def _line(field: Field, optional: bool) -> str:
    if isinstance(field.default, str):
        return f'{field.name} = "{field.default}"  # {field.text}'
    unit = "" if field.unit == "1" else f" {field.unit}"
    text = f"; {field.text}" if field.text else ""
    assignment = f"{'# ' if optional else ''}{field.name} = {field.default!r}"
    return f"{assignment:34}# {field.least:g} to {field.largest:g}{unit}{text}"


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
    _scale(tyre, **figures)
    return tyre[()]  # pyright: ignore[reportReturnType]


def _scale(
    tyre: np.ndarray,
    nominal_load: float | None = None,
    friction: float | None = None,
    load_sensitivity: float | None = None,
    cornering_coefficient: float | None = None,
    relaxation_length: float | None = None,
    radius: float | None = None,
    vertical_stiffness: float | None = None,
) -> None:
    """Changes a tyre in place so that it has these figures."""
    if nominal_load is not None:
        for key in ("fzmin", "fzmax"):
            tyre[key] *= nominal_load / tyre["fnomin"]
        tyre["fnomin"] = nominal_load
    if radius is not None:
        tyre["unloaded_radius"] = radius
    if vertical_stiffness is not None:
        tyre["vertical_stiffness"] = vertical_stiffness
    if load_sensitivity is not None:
        change = load_sensitivity + tyre["pdy2"] / tyre["pdy1"]
        for direction in "xy":
            tyre[f"pd{direction}2"] -= change * tyre[f"pd{direction}1"]
    load = float(tyre["fnomin"] * tyre["lfzo"])
    if friction is not None:
        factor = friction / (tyre["pdy1"] * tyre["lmuy"])
        tyre["lmux"] *= factor
        tyre["lmuy"] *= factor
    if cornering_coefficient is not None:
        tyre["lky"] *= cornering_coefficient * load / stiffness(tyre[()], load, 0.0)[1]
    if relaxation_length is not None:
        tyre["lsgal"] *= relaxation_length / relaxation(tyre[()], load, 0.0)[1]
