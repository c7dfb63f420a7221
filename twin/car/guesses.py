"""Which fields of a car's file are guesses, and how far off a guess may be."""

from pathlib import Path
from typing import NamedTuple

from twin.car.fields import SECTIONS
from twin.toml_file import Table, read_toml

# Standard deviation of a guess: of lengths, offsets and products of inertia as it is, else a share
# of the value. Chosen, from the spread of passenger cars about such rules.
ABSOLUTE = {
    **{"cm_to_front_axle": 0.10, "cm_left": 0.01, "cm_height": 0.06, "left": 0.05},
    **{"to_front_axle": 0.30, "height": 0.15, "wheelbase": 0.05, "wheel_centre_height": 0.01},
    **{"track_front": 0.04, "track_rear": 0.04, "roll_centre_height": 0.04, "travel_slope": 0.03},
    **{"Jxy": 5.0, "Jxz": 40.0, "Jyz": 5.0, "ackermann": 0.3, "free_travel": 0.02},
    **{"lift_area_front": 0.1, "lift_area_rear": 0.1, "drive_front": 0.4, "brake_front": 0.06},
}
RELATIVE = {
    **{"mass": 0.10, "Jxx": 0.15, "Jyy": 0.12, "Jzz": 0.10, "ratio": 0.10, "drag_area": 0.15},
    **{"stiffness": 0.25, "damping": 0.35, "anti_roll": 0.5, "bump_stop": 0.5},
    **{"hub_mass": 0.25, "wheel_mass": 0.15, "wheel_inertia": 0.25, "power": 0.3},
    "torque_accuracy": 1.0,
}


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


def car_guesses(path: Path) -> tuple[tuple[Guess, ...], int]:
    """The fields of a car's TOML file that are guesses.

    A field is one if it is left out, if it still has the value that `til new-car` derived by rule
    (the table `guessed` of the file), or, in a file without that table, if it has the default.

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
    return tuple(guesses), total


def _values(table: Table, section: str) -> dict[str, float]:
    for part in section.split("."):
        table = table.table(part)
    return dict(table.values)


def _sd(name: str, value: float) -> float:
    return ABSOLUTE[name] if name in ABSOLUTE else RELATIVE[name] * abs(value)
