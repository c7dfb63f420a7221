"""A calibration for weighing as a TOML file: written whole or not at all, checked when read."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from estimators.weigh.calibration import Calibration, losses_by_name
from estimators.weigh.losses import TERMS
from estimators.weigh.scatter import Scatter
from scenarios.experiment.result import replacing, versions
from twin import TwinError
from twin.toml_file import Table, read_toml

# By table and key: unit, least, largest
_CAR = {
    "mass": ("kg", 100.0, 1e5),
    "mass_sd": ("kg", 0.0, 1e4),
    "rotating_mass": ("kg", 0.0, 1e4),
    "drag_area": ("m2", -10.0, 100.0),
}
_SCATTER = {
    "scale": ("1", 1e-3, 1e3),
    "scale_sd": ("1", 0.0, 1e2),
    "effect": ("s2/m", -10.0, 10.0),
    "rolling": ("m/s2", -5.0, 5.0),
    "tau": ("1", 1e-6, 1e2),
    "phi": ("1", 0.1, 1e3),
    "trips": ("1", 1.0, 1e6),
}
_RANGES = {"noise": ("1", 1e-6, 1e3), "hardest_rolling": ("m/s2", -5.0, 5.0)}
_LOSSES = {name: ("N" if name == "friction" else "1", -1e4, 1e4) for name in TERMS}
_TABLES = {"car": _CAR, "losses": _LOSSES, "scatter": _SCATTER, "ranges": _RANGES}


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """What a calibration was learnt from.

    Attributes:
        vehicle: name of the car's file.
        logs: names of the reference logs.
        notes: sentences about them.
    """

    vehicle: str
    logs: Sequence[str]
    notes: Sequence[str] = ()


def write_calibration(path: Path, calibration: Calibration, origin: Origin) -> None:
    """Writes the calibration and where it comes from."""
    scatter = calibration.scatter
    content: dict[str, Any] = {
        "origin": {
            "vehicle": origin.vehicle,
            "logs": list(origin.logs),
            "notes": list(origin.notes),
            "versions": versions(),
        },
        "car": {name: _rounded(getattr(calibration, name)) for name in _CAR},
        "losses": {name: _rounded(v) for name, v in losses_by_name(calibration).items()},
        "scatter": {name: _rounded(getattr(scatter, name)) for name in _SCATTER},
        "ranges": {name: _rounded(getattr(calibration, name)) for name in _RANGES},
    }
    with replacing(path) as partial:
        partial.write_bytes(tomli_w.dumps(content).encode())


def read_calibration(path: Path) -> Calibration:
    """Reads what `write_calibration` wrote.

    Raises:
        TwinError: the file is missing or broken, or a field is unknown, missing or out of range.
    """
    table = read_toml(path)
    table.check_keys(("origin", *_TABLES))
    numbers = {name: _numbers(table.table(name), fields) for name, fields in _TABLES.items()}
    return Calibration(
        **numbers["car"],
        **numbers["ranges"],
        losses=np.array([numbers["losses"][name] for name in TERMS]),
        scatter=Scatter(**numbers["scatter"], as_declared=np.zeros(0)),
    )


def _numbers(table: Table, fields: dict[str, tuple[str, float, float]]) -> dict[str, float]:
    table.check_keys(fields)
    for name, (unit, least, largest) in fields.items():
        if name not in table:
            raise TwinError(
                f"{table.path}: {table.place}.{name} is missing; allowed: a number from {least:g} "
                f"to {largest:g} {unit}"
            )
    return {name: table.number(name, math.nan, *limits[1:]) for name, limits in fields.items()}


def _rounded(value: float) -> float:
    return float(f"{value:.6g}")
