"""Fits the Magic Formula MF 5.2 to measurements of a tyre, by bounded least squares.

In the order of Pacejka's book, section 4.3.5: pure side slip, pure longitudinal slip, combined
slip, aligning moment. Each step frees its own coefficients, from their start on, within bounds;
what the data do not excite (inclination, longitudinal slip, moment) keeps its start. Errors count
in shares of the nominal load, with less weight for outliers (soft L1).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import least_squares

from scenarios.calibration.tyre_data import TyreData
from twin import TwinError
from twin.tyre.magic_formula import magic_formula

Array = NDArray[np.float64]

_MOST = 6000  # samples of a step; more are thinned out evenly
_OUTLIER = 0.05  # of the nominal load: residuals beyond it count less
_SMALL_SLIP = 0.015  # longitudinal slip, below which side slip is pure
_SMALL_ANGLE = np.radians(0.6)  # slip angle, below which longitudinal slip is pure
_UPRIGHT = np.radians(0.5)
_SAME_PRESSURE = 10e3  # [Pa]
_BOUND = 0.002  # of a coefficient's range: nearer to its bound it lies on it


class Free(NamedTuple):
    """A coefficient's bounds, as books and shipped files have it, with room on both sides."""

    low: float
    high: float


_SIDE = {
    **{"PCY1": Free(1.05, 1.9), "PDY1": Free(0.3, 4.0), "PDY2": Free(-1.0, 0.3)},
    **{"PEY1": Free(-10.0, 0.99), "PEY2": Free(-8.0, 8.0), "PEY3": Free(-2.0, 2.0)},
    **{"PKY1": Free(-120.0, -4.0), "PKY2": Free(0.4, 8.0)},
    **{"PHY1": Free(-0.03, 0.03), "PHY2": Free(-0.03, 0.03)},
    **{"PVY1": Free(-0.2, 0.2), "PVY2": Free(-0.2, 0.2)},
}
_SIDE_INCLINED = {
    **{"PDY3": Free(-30.0, 30.0), "PEY4": Free(-40.0, 40.0), "PKY3": Free(-3.0, 3.0)},
    **{"PHY3": Free(-0.5, 0.5), "PVY3": Free(-4.0, 4.0), "PVY4": Free(-4.0, 4.0)},
}
_ALONG = {
    **{"PCX1": Free(1.05, 1.95), "PDX1": Free(0.3, 4.0), "PDX2": Free(-1.0, 0.3)},
    **{"PEX1": Free(-8.0, 0.99), "PEX2": Free(-4.0, 4.0), "PEX3": Free(-4.0, 4.0)},
    **{"PEX4": Free(-1.0, 1.0), "PKX1": Free(5.0, 120.0), "PKX2": Free(-40.0, 40.0)},
    **{"PKX3": Free(-1.5, 1.5), "PHX1": Free(-0.03, 0.03), "PHX2": Free(-0.03, 0.03)},
    **{"PVX1": Free(-0.2, 0.2), "PVX2": Free(-0.2, 0.2)},
}
_COMBINED = {
    **{"RBX1": Free(2.0, 60.0), "RBX2": Free(-60.0, 60.0), "RCX1": Free(0.6, 1.6)},
    **{"RBY1": Free(2.0, 60.0), "RBY2": Free(-60.0, 60.0)},
    **{"RCY1": Free(0.6, 1.6), "RHY1": Free(-0.1, 0.1)},
    **{"RVY1": Free(-0.5, 0.5), "RVY2": Free(-0.5, 0.5)},
}
# Shifts over the slip angle, which angles on one side of zero do not tell from slopes
_COMBINED_SHIFTS = {"RHX1": Free(-0.05, 0.05), "RBY3": Free(-0.2, 0.2)}
_MOMENT = {
    **{"QBZ1": Free(2.0, 40.0), "QBZ2": Free(-20.0, 20.0), "QCZ1": Free(0.7, 1.9)},
    **{"QDZ1": Free(0.0, 0.4), "QDZ2": Free(-0.2, 0.2), "QEZ1": Free(-12.0, 0.99)},
    **{"QHZ1": Free(-0.05, 0.05), "QDZ6": Free(-0.05, 0.05), "QDZ7": Free(-0.05, 0.05)},
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Step:
    """One step of a fit.

    Attributes:
        name: what was fitted.
        samples: how many.
        rmse: [N], of the moment [N m].
        span: of the measured values, 1st to 99th percentile, in the same unit.
        on_bound: coefficients that lie on a bound.
    """

    name: str
    samples: int
    rmse: float
    span: float
    on_bound: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TyreFit:
    """A fitted tyre.

    Attributes:
        tyre: its record.
        values: what differs from the start, by the keys of its file.
        data: what was fitted to.
        steps: one for each force or moment.
        notes: what was done, in sentences.
    """

    tyre: np.void
    values: dict[str, float]
    data: TyreData
    steps: tuple[Step, ...]
    notes: tuple[str, ...]


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(tyre: Any, samples: Array, out: Array) -> None:
    """The tyre at all samples.

    Args:
        tyre: its record.
        samples: (N, 5) load [N], longitudinal slip, slip angle, inclination [rad], speed [m/s].
        out: (N, 3), becomes F_x, F_y [N], M_z [N m].
    """
    for i in range(samples.shape[0]):
        fz, kappa, alpha, gamma, vx = samples[i]
        fx, fy, _, _, mz = magic_formula(tyre, fz, kappa, alpha, gamma, vx, 1.0)
        out[i, 0], out[i, 1], out[i, 2] = fx, fy, mz


def samples_of(tyre: np.void, data: TyreData) -> Array:
    """What `evaluate` takes, (N, 5)."""
    speed = np.where(np.isfinite(data.speed), data.speed, float(tyre["longvl"]))
    return np.column_stack((data.fz, data.kappa, data.alpha, data.gamma, speed))


def fit_tyre(start: np.void, data: TyreData) -> TyreFit:
    """Fits a tyre's coefficients to measurements.

    Args:
        start: record of a tyre of MF 5.2: first values, and what the data do not tell.
        data: all samples of it; of several pressures the one with the most is fitted.

    Returns:
        The fit; `TyreFit.values` has the keys of a tyre property file.

    Raises:
        TwinError: too few samples have pure side slip.
    """
    notes = list(data.notes)
    data = _one_pressure(data, notes)
    tyre = np.array([start], dtype=start.dtype)
    values = _vertical(tyre, data, notes)
    steps: list[Step] = []
    pure = np.abs(data.kappa) < _SMALL_SLIP
    if pure.sum() < 50:
        raise TwinError(f"{pure.sum()} samples have side slip alone; allowed: 50 or more")
    free = dict(_SIDE)
    if np.ptp(data.gamma) > _UPRIGHT:
        free |= _SIDE_INCLINED
    else:
        notes.append("inclination was not varied: its coefficients are those of the start.")
    steps.append(_step(tyre, "F_y, side slip", data.where(pure), free, _fy, values))
    along = np.isfinite(data.fx) & (np.abs(data.alpha) < _SMALL_ANGLE)
    swept = np.isfinite(data.fx) & (np.abs(data.kappa) > 2.0 * _SMALL_SLIP)
    if (along & swept).sum() >= 50:
        steps.append(_step(tyre, "F_x, longitudinal slip", data.where(along), _ALONG, _fx, values))
        both = swept & ~along
        if both.sum() >= 50:
            left = float(np.mean(data.alpha[both] > 0.0))
            free = _COMBINED | (_COMBINED_SHIFTS if 0.1 < left < 0.9 else {})
            steps.append(
                _step(tyre, "F_x, F_y, combined slip", data.where(both), free, _both, values)
            )
        else:
            notes.append("combined slip was not measured: its coefficients are the start's.")
    else:
        notes.append("longitudinal slip was not measured: its coefficients are the start's.")
    moment = pure & np.isfinite(data.mz) & (np.abs(data.gamma) < _UPRIGHT)
    if moment.sum() >= 50:
        steps.append(_step(tyre, "M_z, side slip", data.where(moment), _MOMENT, _mz, values))
    notes.append("relaxation lengths and rolling resistance are those of the start.")
    return TyreFit(tyre=tyre[0], values=values, data=data, steps=tuple(steps), notes=tuple(notes))


def _fy(tyre: np.void, data: TyreData, out: Array) -> Array:
    return out[:, 1] - data.fy


def _fx(tyre: np.void, data: TyreData, out: Array) -> Array:
    return out[:, 0] - data.fx


def _both(tyre: np.void, data: TyreData, out: Array) -> Array:
    return np.concatenate((_fx(tyre, data, out), _fy(tyre, data, out)))


def _mz(tyre: np.void, data: TyreData, out: Array) -> Array:
    return (out[:, 2] - data.mz) / (0.1 * float(tyre["unloaded_radius"]))  # as a force


def _one_pressure(data: TyreData, notes: list[str]) -> TyreData:
    known = np.isfinite(data.pressure)
    if not known.any() or np.ptp(data.pressure[known]) < _SAME_PRESSURE:
        return data
    bins = np.round(data.pressure[known] / _SAME_PRESSURE)
    levels, counts = np.unique(bins, return_counts=True)
    level = levels[np.argmax(counts)] * _SAME_PRESSURE
    kept = known & (np.abs(data.pressure - level) < _SAME_PRESSURE)
    notes.append(
        f"pressures from {data.pressure[known].min() / 1e3:.0f} to "
        f"{data.pressure[known].max() / 1e3:.0f} kPa: the {kept.sum()} of {kept.size} samples "
        f"about {level / 1e3:.0f} kPa are fitted."
    )
    return data.where(kept)


def _vertical(tyre: np.ndarray, data: TyreData, notes: list[str]) -> dict[str, float]:
    """Nominal load and range of load; radius and stiffness where the loaded radius is measured."""
    nominal = float(f"{np.median(data.fz):.3g}")
    low, high = np.percentile(data.fz, (0.5, 99.5))
    values = {"FNOMIN": nominal, "FZMIN": 0.5 * low, "FZMAX": 1.2 * high}
    values["CAMMAX"] = max(float(np.abs(data.gamma).max()), np.radians(5.0))
    values["CAMMIN"] = -values["CAMMAX"]
    measured = np.isfinite(data.loaded_radius) & (data.loaded_radius > 0.05)
    if measured.sum() >= 50 and np.ptp(data.fz[measured]) > 0.3 * nominal:
        slope, radius = np.polyfit(data.fz[measured], data.loaded_radius[measured], 1)
        if slope < 0.0:
            values |= {"UNLOADED_RADIUS": float(radius), "VERTICAL_STIFFNESS": -1.0 / float(slope)}
            notes.append("radius and vertical stiffness are from the loaded radius.")
    if np.isfinite(data.speed).any():
        values["LONGVL"] = max(float(np.nanmedian(data.speed)), 1.0)
    for key, value in values.items():
        if key.lower() in (tyre.dtype.names or ()):
            tyre[key.lower()] = value
    return values


def _step(
    tyre: np.ndarray,
    name: str,
    data: TyreData,
    free: dict[str, Free],
    error: Callable[[np.void, TyreData, Array], Array],
    values: dict[str, float],
) -> Step:
    """Fits one force; the record and the values take what is found."""
    thinned = data.where(np.arange(data.fz.size) % (1 + data.fz.size // _MOST) == 0)
    samples = samples_of(tyre[0], thinned)
    out = np.empty((thinned.fz.size, 3))
    scale = _OUTLIER * float(tyre["fnomin"][0])
    keys = list(free)
    low, high = (np.array([getattr(free[key], end) for key in keys]) for end in ("low", "high"))
    margin = 1e-3 * (high - low)
    begin = np.array([float(tyre[key.lower()][0]) for key in keys])

    def residual(x: Array) -> Array:
        for key, value in zip(keys, x, strict=True):
            tyre[key.lower()] = value
        evaluate(tyre[0], samples, out)
        return error(tyre[0], thinned, out) / scale

    found = least_squares(
        residual,
        np.clip(begin, low + margin, high - margin),
        bounds=(low, high),
        loss="soft_l1",
        x_scale=0.1 * (high - low),
        max_nfev=200,
    ).x
    rest = residual(found) * scale
    values |= dict(zip(keys, found.tolist(), strict=True))
    ends = np.minimum(found - low, high - found) < _BOUND * (high - low)
    unit = 0.1 * float(tyre["unloaded_radius"][0]) if error is _mz else 1.0
    target = error(tyre[0], thinned, np.zeros_like(out))  # the measured values, negated
    return Step(
        name=name,
        samples=thinned.fz.size,
        rmse=float(np.sqrt(np.mean(rest**2))) * unit,
        span=float(np.ptp(np.percentile(target, (1.0, 99.0)))) * unit,
        on_bound=tuple(key for key, end in zip(keys, ends, strict=True) if end),
    )
