"""Reads the file of a tyre: a tyre property file (.tir), or a TOML file of another model."""

import math
from pathlib import Path

import numpy as np

from twin.toml_fields import Field, read_numbers
from twin.toml_file import read_toml
from twin.tyre.interface import MODELS
from twin.tyre.record import new_tyre
from twin.tyre.tir import read_tyre

# What the tyres of every model have, by the names of the record
CARCASS = (
    Field("unloaded_radius", "m", math.nan, 0.1, 1.0, "radius without load"),
    Field("vertical_stiffness", "N/m", 250_000.0, 2e4, 2e6, ""),
    Field("vertical_damping", "N s/m", 50.0, 0.0, 1e6, ""),
    Field("fnomin", "N", 5000.0, 500.0, 5e4, "nominal load"),
)


def read_tyre_file(path: str | Path) -> np.void:
    """Reads a tyre of any model.

    Args:
        path: a .tir file, or a TOML file whose `model` is one of `twin.tyre.interface.MODELS`.

    Returns:
        A record of `twin.tyre.record.TYRE_DTYPE`.

    Raises:
        TwinError: the file cannot be read or describes no tyre; the message says why.
    """
    return _read_toml(Path(path)) if str(path).endswith(".toml") else read_tyre(path)


def _read_toml(path: Path) -> np.void:
    """Reads a TOML file; the fields of a model are written there without the model's name."""
    table = read_toml(path)
    name = table.choice("model", "", MODELS)
    number, own = MODELS[name]
    fields = {field.name.removeprefix(f"{name}_"): field for field in (*CARCASS, *own)}
    table.check_keys(("model", *fields))
    values = read_numbers(table, (field._replace(name=key) for key, field in fields.items()))
    tyre = new_tyre()
    for key, value in values.items():
        tyre[fields[key].name] = value
    tyre["model"] = number
    tyre["freff"] = 1.0 / 3.0  # the free rolling wheel loses a third of its deflection; chosen
    tyre["fzmin"], tyre["fzmax"] = 0.02 * tyre["fnomin"], 3.0 * tyre["fnomin"]
    tyre["cammax"] = math.radians(15.0)
    return tyre[0]
