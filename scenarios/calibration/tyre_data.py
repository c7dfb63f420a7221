"""Measurements of tyres on a test bench: columns of slip, load, inclination and forces.

The usual layout of tyre test consortia: a table of text (.dat) with rows of names and units, or
MATLAB's .mat with a vector per channel and a struct `channel` of names and units. Names are SA, SL
or SR, IA, FX, FY, FZ, MZ, P, V, RL, in any case. Axes are SAE (FZ negative) or ISO; they become
those of this project (ISO-W, see `twin.tyre.tir`), and so does the sign of the slip angle.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import TwinError
from twin.logs import csv, mat
from twin.logs.raw_log import listed
from twin.logs.units import UNITS, in_si

Array = NDArray[np.float64]

# By field: its names, and the kind of quantity whose units count
_NAMES: dict[str, tuple[tuple[str, ...], str]] = {
    "alpha": (("SA", "ALPHA", "SLIPANGLE", "SLIP_ANGLE"), "angle"),
    "kappa": (("SR", "SL", "KAPPA", "SLIPRATIO", "SLIP_RATIO"), "ratio"),
    "gamma": (("IA", "GAMMA", "INCLINATION", "CAMBER"), "angle"),
    "fx": (("FX",), "force"),
    "fy": (("FY",), "force"),
    "fz": (("FZ",), "force"),
    "mz": (("MZ",), "torque"),
    "pressure": (("P", "PRESSURE"), "pressure"),
    "speed": (("V", "SPEED"), "speed"),
    "loaded_radius": (("RL",), "length"),
}
_NEEDED = ("alpha", "fy", "fz")
_NO_UNIT = ("", "-", "none", "1")  # of ratios
_LIGHT = 0.05  # of the largest load; below it a tyre is being lifted
_SMALL_ANGLE = np.radians(5.0)  # slip angles whose forces show the sign
_SMALL_SLIP = 0.015  # longitudinal slip, below which side slip is pure
_FEWEST = 50  # samples; chosen
_PASCAL = 1e5  # of a bar, in which pressures are given to us


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TyreData:
    """Samples of a tyre, (N,) each, in ISO-W axes and SI units.

    Attributes:
        alpha: slip angle [rad]; positive gives a negative lateral force.
        kappa: longitudinal slip [-]; zero where none was measured.
        gamma: inclination [rad]; zero where none was measured.
        fx: longitudinal force [N]; NaN where none was measured.
        fy: lateral force [N].
        fz: load [N], positive.
        mz: aligning moment [N m]; NaN where none was measured.
        pressure: [Pa]; NaN where none was measured.
        speed: [m/s]; NaN where none was measured.
        loaded_radius: [m]; NaN where none was measured.
        notes: what the reader decided on its own, in sentences.
    """

    alpha: Array
    kappa: Array
    gamma: Array
    fx: Array
    fy: Array
    fz: Array
    mz: Array
    pressure: Array
    speed: Array
    loaded_radius: Array
    notes: tuple[str, ...] = ()

    def where(self, kept: NDArray[np.bool_]) -> "TyreData":
        """Some of the samples."""
        return TyreData(**{key: getattr(self, key)[kept] for key in _NAMES}, notes=self.notes)


def read_tyre_data(paths: Sequence[Path]) -> TyreData:
    """Reads the measurements of one tyre.

    Args:
        paths: one file or several: .mat, or tables of text of any other ending.

    Returns:
        The samples of all files that carry load.

    Raises:
        TwinError: a file cannot be read, has no slip angle, lateral force or load, or no units; or
            all files together have too few samples, or slip angles on no side of zero.
    """
    notes: dict[str, None] = {}
    parts = [_in_our_axes(path, _columns(path), notes) for path in paths]
    columns = {key: np.concatenate([part[key] for part in parts]) for key in _NAMES}
    small = (np.abs(columns["alpha"]) < _SMALL_ANGLE) & (np.abs(columns["kappa"]) < _SMALL_SLIP)
    slope = float(np.sum(columns["alpha"][small] * columns["fy"][small]))
    if small.sum() < _FEWEST or slope == 0.0:
        raise TwinError(
            f"{paths[0]}: {small.sum()} samples have load and a slip angle below "
            f"{np.degrees(_SMALL_ANGLE):.0f} deg; allowed: {_FEWEST} samples, angles about zero"
        )
    if slope > 0.0:
        notes["positive slip angles have positive lateral forces: the angles are negated."] = None
        columns["alpha"] = -columns["alpha"]
    return TyreData(**columns, notes=tuple(notes))


def _columns(path: Path) -> dict[str, Array]:
    """The channels of one file in SI units, NaN or zero where one is not measured."""
    columns, units = _of_mat(path) if path.suffix.lower() == ".mat" else _of_text(path)
    by_name = {name.upper(): name for name in columns}
    missing = [
        " or ".join(_NAMES[key][0][:2])
        for key in _NEEDED
        if not any(name in by_name for name in _NAMES[key][0])
    ]
    if missing:
        raise TwinError(
            f"{path}: has no {', '.join(missing)}; it has {listed(columns)}; allowed: slip angle, "
            "lateral force and load under these names"
        )
    size = columns[by_name["FZ"]].size
    found: dict[str, Array] = {}
    for key, (names, kind) in _NAMES.items():
        name = next((by_name[n] for n in names if n in by_name), None)
        if name is None or columns[name].size != size:
            found[key] = np.full(size, 0.0 if key in ("kappa", "gamma") else np.nan)
        else:
            found[key] = _factor(path, name, kind, units.get(name, "")) * columns[name]
    found["pressure"] *= _PASCAL
    return found


def _of_text(path: Path) -> tuple[dict[str, Array], dict[str, str]]:
    table = csv.read_table(path)
    columns = {name: column.values for name, column in table.columns.items()}
    return columns, {name: column.unit for name, column in table.columns.items()}


def _of_mat(path: Path) -> tuple[dict[str, Array], dict[str, str]]:
    vectors, content = mat.read_vectors(path)
    columns = {name.rpartition(".")[2]: values for name, values in vectors.items()}
    channel: Any = content.get("channel")
    names = np.atleast_1d(getattr(channel, "name", ())).tolist()
    units = np.atleast_1d(getattr(channel, "units", ())).tolist()
    given = zip(map(str, names), map(str, units), strict=False)
    upper = {name.upper(): name for name in columns}
    return columns, {upper[n.upper()]: unit.strip() for n, unit in given if n.upper() in upper}


def _factor(path: Path, name: str, kind: str, unit: str) -> float:
    """How much of ours one of a channel's numbers is."""
    if kind == "ratio" and unit.lower() in _NO_UNIT:
        return 1.0
    factor = in_si(kind, unit)
    if factor is None:
        raise TwinError(
            f"{path}: {name} has the unit {unit[:20] or 'none'!r}; allowed: "
            f"{', '.join(UNITS[kind])}, in a row of units or in the struct 'channel'"
        )
    return factor


def _in_our_axes(
    path: Path, found: Mapping[str, Array], notes: dict[str, None]
) -> dict[str, Array]:
    """Turns SAE axes about x and leaves out samples without load; sentences go to the notes."""
    columns = dict(found)
    if not np.isfinite(columns["fz"]).any():
        raise TwinError(f"{path}: FZ has no numbers; allowed: loads")
    if np.nanmedian(columns["fz"]) < 0.0:
        notes["axes are SAE (FZ negative): turned to ISO."] = None
        for key in ("fz", "fy", "mz", "alpha"):
            columns[key] = -columns[key]
    used = np.isfinite(columns["alpha"] + columns["fy"] + columns["fz"] + columns["kappa"])
    used &= np.isfinite(columns["gamma"])
    used &= columns["fz"] > _LIGHT * np.nanmax(columns["fz"])
    return {key: values[used] for key, values in columns.items()}
