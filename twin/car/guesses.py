"""Which fields of a car's file are guesses, and how far off a guess may be."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

import models
from twin.car.fields import SECTIONS
from twin.car.mjcf import tyre_path
from twin.car.toml_car import car_tyres
from twin.car.tyre_figures import tyre_figures
from twin.car.vehicle import Vehicle
from twin.parameters import INERTIA, PARAMETERS
from twin.toml_file import Table, read_toml
from twin.tyre.interface import MAGIC_FORMULA
from twin.tyre.size import NO_MEASUREMENT

# Standard deviation of a guess: of lengths, offsets and products of inertia as it is, else a share
# of the value. Chosen, from the spread of passenger cars about such rules.
ABSOLUTE = {
    **{"cm_to_front_axle": 0.10, "cm_left": 0.01, "cm_height": 0.06, "left": 0.05},
    **{"to_front_axle": 0.30, "height": 0.15, "wheelbase": 0.05, "wheel_centre_height": 0.01},
    **{"track_front": 0.04, "track_rear": 0.04, "roll_centre_height": 0.04, "travel_slope": 0.03},
    **{"Jxy": 5.0, "Jxz": 40.0, "Jyz": 5.0, "ackermann": 0.3, "free_travel": 0.02},
    **{"lift_area_front": 0.1, "lift_area_rear": 0.1, "drive_front": 0.4, "brake_front": 0.06},
    "load_sensitivity": 0.04,
}
RELATIVE = {
    **{"mass": 0.10, "Jxx": 0.15, "Jyy": 0.12, "Jzz": 0.10, "ratio": 0.10, "drag_area": 0.15},
    **{"stiffness": 0.25, "damping": 0.35, "anti_roll": 0.5, "bump_stop": 0.5},
    **{"hub_mass": 0.25, "wheel_mass": 0.15, "wheel_inertia": 0.25, "power": 0.3},
    **{"friction": 0.15, "cornering_coefficient": 0.25, "relaxation_length": 0.3},
    **{"vertical_stiffness": 0.15, "radius": 0.02, "torque_accuracy": 1.0},
}
# Share of the variance that the guesses of both axles have in common: their springs, tyres and
# roll centres are of one car. Chosen.
COMMON = 0.5
_AXLES = ("front", "rear")


def _both(section: str, *fields: str) -> tuple[str, ...]:
    return tuple(f"{section}.{axle}.{field}" for field in fields for axle in _AXLES)


GUESSED_BY = {
    "mass": ("chassis.mass",),
    **{"cm_x": ("chassis.cm_to_front_axle",), "cm_y": ("chassis.cm_left",)},
    "cm_z": ("chassis.cm_height",),
    **{name: (f"chassis.{name}",) for name in PARAMETERS[INERTIA]},
    "tyre_friction": _both("tyre", "friction"),
    "cornering_stiffness": _both("tyre", "cornering_coefficient"),
    "drag": ("aerodynamics.drag_area",),
    "spring": _both("suspension", "stiffness"),
    "damper": _both("suspension", "damping"),
    "relaxation": _both("tyre", "relaxation_length"),
    "tyre_stiffness": _both("tyre", "vertical_stiffness"),
    "front_cornering_stiffness": ("tyre.front.cornering_coefficient",),
    "rolling_radius": _both("tyre", "radius"),
    "front_anti_roll": ("suspension.front.anti_roll",),
    "rear_anti_roll": ("suspension.rear.anti_roll",),
    "front_spring": ("suspension.front.stiffness",),
    "front_damper": ("suspension.front.damping",),
    "front_brake_torque": ("drivetrain.brake_front",),
    "steering_ratio": ("steering.ratio",),
    "unsprung_mass": _both("suspension", "hub_mass", "wheel_mass"),
    "roll_centre": _both("suspension", "roll_centre_height"),
    "lift": ("aerodynamics.lift_area_front", "aerodynamics.lift_area_rear"),
}
"""The fields that a parameter of a twin changes, by its name."""


class Guess(NamedTuple):
    """A field of which nobody said what it is.

    Attributes:
        name: section and field, as chassis.Jzz.
        unit: of the value.
        value: in force.
        sd: standard deviation of the guess, in the same unit.
    """

    name: str
    unit: str
    value: float
    sd: float


def guesses_of(vehicle: Vehicle) -> tuple[tuple[Guess, ...], int]:
    """The fields of a car that are guesses, and the number of its fields; none of an MJCF file.

    A field that a calibration has found is none.

    Raises:
        TwinError: the file cannot be read.
    """
    if vehicle.source.suffix != ".toml":
        return (), 0
    guesses, total = car_guesses(vehicle.source)
    found = {name for name, _ in (*vehicle.scales, *vehicle.deltas)}
    known = {field for name in found for field in GUESSED_BY.get(name, ())}
    known |= {name for name, _ in vehicle.fields}
    return tuple(guess for guess in guesses if guess.name not in known), total


def car_guesses(path: Path) -> tuple[tuple[Guess, ...], int]:
    """The fields of a car's TOML file that are guesses.

    A field is one if it is left out, if it still has the value that `til new-car` derived by rule
    (the table `guessed` of the file), or, in a file without that table, if it has the default. The
    figures of a tyre are guesses where its file is the project's SUV's or was made from its size,
    and the car's file does not give them.

    Args:
        path: a sound file of `twin.car.fields`.

    Returns:
        The guesses, and the number of fields that there are.

    Raises:
        TwinError: the file cannot be read.
    """
    table = read_toml(path)
    guessed = table.values.get("guessed")
    guesses, total = [], 0
    for section in SECTIONS:
        if section.optional:
            continue
        values = _values(table, section.name)
        for field in section.fields:
            total += 1
            name, default = f"{section.name}.{field.name}", float(field.default)
            value = values.get(field.name, default)
            rule = guessed.get(name) if isinstance(guessed, dict) else default
            if field.name not in values or value == rule:
                guesses.append(Guess(name, field.unit, value, _sd(field.name, value)))
    for axle, tyre in zip(_AXLES, car_tyres(path), strict=True):
        if tyre["model"] != MAGIC_FORMULA:
            continue
        figures = tyre_figures(tyre)
        total += len(figures)
        guesses += _of_tyre(path, f"tyre.{axle}", _values(table, f"tyre.{axle}"), figures)
    return tuple(guesses), total


def draw(guesses: Sequence[Guess], rng: np.random.Generator) -> dict[str, float]:
    """Values that the guessed fields might really have, for `Vehicle.with_fields`.

    Args:
        guesses: which.
        rng: where the draws come from.
    """
    common: dict[str, float] = {}
    values = {}
    for guess in guesses:
        section, _, field = guess.name.rpartition(".")
        part, _, axle = section.partition(".")
        z = rng.standard_normal()
        if axle:
            shared = common.setdefault(f"{part}.{field}", rng.standard_normal())
            z = np.sqrt(COMMON) * shared + np.sqrt(1.0 - COMMON) * z
        if field in RELATIVE:  # which keeps its sign
            values[guess.name] = guess.value * float(np.exp(RELATIVE[field] * z))
        else:
            values[guess.name] = guess.value + guess.sd * float(z)
    return values


def _of_tyre(
    path: Path, section: str, given: dict[str, float], figures: dict[str, float]
) -> list[Guess]:
    """The guessed figures of a tyre."""
    fields = next(one.fields for one in SECTIONS if one.name == section)
    file = tyre_path(path, str(given.get("file", fields[0].default)))
    ours = file.resolve() == models.path("tyres/suv.tir").resolve()
    if not ours and NO_MEASUREMENT not in file.read_text(encoding="latin-1").partition("[")[0]:
        return []
    units = {field.name: field.unit for field in fields}
    return [
        Guess(f"{section}.{name}", units[name], value, _sd(name, value))
        for name, value in figures.items()
        if name not in given and (ours or name != "radius")  # which follows from the size
    ]


def _values(table: Table, section: str) -> dict[str, float]:
    for part in section.split("."):
        table = table.table(part)
    return dict(table.values)


def _sd(name: str, value: float) -> float:
    return ABSOLUTE[name] if name in ABSOLUTE else RELATIVE[name] * abs(value)
