"""Pictures of the report on a log: map of the drive, inputs, measured against twin, estimates."""

from collections.abc import Iterator, Sequence
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.logs.answer import nominal, shown, sideslip
from scenarios.logs.estimators import Found
from scenarios.logs.signals import BRAKE_TORQUES, DRIVE_TORQUES, WHEEL_SPEEDS
from twin import PARAMETER, Vehicle

Array = NDArray[np.float64]

_MOST = 700  # points of a curve; chosen: what a screen shows
_WIDTH, _ROW = 5.4, 1.35  # [inch]
_MEASURED, _TWIN, _TRUTH, _DOUBT = "#7d828c", "#d95f1e", "#2e8b57", "#b03a3a"
_SETTLED = 0.25  # of the drive, after which a band is shown whole
_KMH = 3.6


class Picture(NamedTuple):
    """An SVG file and what it shows."""

    svg: bytes
    caption: str


class _Curve(NamedTuple):
    """One history in its axes; (N,) arrays, `measured` with its noise."""

    title: str
    estimate: Array | None = None
    sd: Array | None = None
    measured: Array | None = None
    truth: Array | None = None


def pictures(found: Found, vehicle: Vehicle) -> Iterator[Picture]:
    """All pictures of a log; needs matplotlib.

    Args:
        found: what an estimator made of the log.
        vehicle: of the twin.
    """
    yield Picture(
        _map(found),
        "Map of the drive, from the speed of the twin and the yaw rate. "
        "Dot: start. Square: end. Red: estimates are not trustworthy.",
    )
    yield Picture(_histories(found, _inputs(found)), "Inputs, as the log has them.")
    compared = list(_compared(found, vehicle))
    if compared:
        yield Picture(
            _histories(found, compared),
            "Measured (grey, with its noise) and the twin (orange).",
        )
    estimated = list(_estimated(found, vehicle))
    if estimated:
        truth = any(curve.truth is not None for curve in estimated)
        yield Picture(
            _histories(found, estimated),
            "Estimates, in bands of two standard deviations where they are known"
            + (", and the truth of the log (green, dashed)." if truth else "."),
        )


def _inputs(found: Found) -> list[_Curve]:
    drive = found.drive
    steering = np.degrees(drive.channel("steering_wheel_angle"))
    curves = [_Curve("steering wheel angle [deg]", measured=steering)]
    for title, names in (("drive torque", DRIVE_TORQUES), ("brake torque", BRAKE_TORQUES)):
        if all(name in drive.input_names for name in names):
            total = np.sum([drive.channel(name) for name in names], axis=0)
            curves.append(_Curve(f"{title}, all wheels [N m]", measured=total))
    return curves


def _compared(found: Found, vehicle: Vehicle) -> Iterator[_Curve]:
    """What both the log and the twin have."""
    drive, estimate = found.drive, found.estimate
    speed = _measured_speed(found, vehicle)
    if speed is not None:
        twin, measured = _KMH * estimate["vx"], _KMH * speed
        yield _Curve("speed [km/h]", estimate=twin, measured=measured)
    for name in ("ax", "ay", "az"):
        if name in estimate.output_names and _known(drive.channel(name)):
            yield _Curve(f"{name} [m/s$^2$]", estimate=estimate[name], measured=drive.channel(name))
    for name in ("roll_rate", "pitch_rate", "yaw_rate"):
        if estimate.has(name) and _known(drive.channel(name)):
            twin, measured = np.degrees(estimate[name]), np.degrees(drive.channel(name))
            yield _Curve(f"{name.replace('_', ' ')} [deg/s]", estimate=twin, measured=measured)


def _measured_speed(found: Found, vehicle: Vehicle) -> Array | None:
    """(N,) as measured or, without that, the mean of the wheels' [m/s]."""
    drive = found.drive
    if "vx" in drive.output_names and _known(drive.channel("vx")):
        return drive.channel("vx")
    wheels = np.array([drive.channel(name) for name in WHEEL_SPEEDS])
    there = np.isfinite(wheels)
    count = there.sum(axis=0)
    if not count.any():
        return None
    total = np.where(there, wheels, 0.0).sum(axis=0)
    radius = float(np.mean(vehicle.figures.wheel_radius))
    return radius * np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _estimated(found: Found, vehicle: Vehicle) -> Iterator[_Curve]:
    drive, estimate = found.drive, found.estimate
    for name in found.parameters:
        unit, per_si = shown(name)
        base = nominal(name, found, vehicle)
        deviation = estimate.sd_of(name)
        truth = drive.truth.get(name)
        if truth is not None and name == "mass":  # of the chassis; the total is shown
            truth = truth - estimate.nominal[estimate.parameter_names.index(name)] + base
        words = "total mass" if name == "mass" else PARAMETER[name].words.removeprefix("the ")
        yield _Curve(
            f"{words} [{unit.replace('m2', 'm$^2$')}]",
            estimate=per_si * (base + estimate[name]),
            sd=per_si * deviation if _known(deviation) else None,
            truth=None if truth is None or not _known(truth) else per_si * truth,
        )
    slip = sideslip(found)
    if _known(slip):
        truth, deviation = drive.truth.get("sideslip"), estimate.sideslip_sd
        yield _Curve(
            "sideslip [deg]",
            estimate=np.degrees(slip),
            sd=None if deviation is None else np.degrees(deviation),
            truth=None if truth is None else np.degrees(truth),
        )


def _map(found: Found) -> bytes:
    """The way from above, of the estimated speed and the measured yaw rate."""
    estimate, drive = found.estimate, found.drive
    rate = drive.channel("yaw_rate")
    rate = np.where(np.isfinite(rate), rate, estimate["yaw_rate"])
    step = np.diff(drive.time, prepend=drive.time[0])
    step = np.minimum(step, 10.0 * np.median(step))  # nobody knows the way through a gap
    yaw = np.cumsum(rate * step)
    slip = np.nan_to_num(sideslip(found))
    x, y = (np.cumsum(estimate["vx"] * step * f(yaw + slip)) for f in (np.cos, np.sin))
    at = _bins(x.size, 2 * _MOST)
    sheet = _sheet(3.6)
    axes = sheet.add_axes((0.12, 0.13, 0.85, 0.82))
    axes.plot(x[at], y[at], color=_TWIN, lw=2.0)
    if estimate.trustworthy is not None:
        doubtful = ~estimate.trustworthy[at]
        axes.plot(
            np.where(doubtful, x[at], np.nan), np.where(doubtful, y[at], np.nan), color=_DOUBT, lw=4
        )
    axes.plot(x[0], y[0], "o", color="black", ms=7)
    axes.plot(x[-1], y[-1], "s", color="black", ms=7)
    half = 0.55 * max(np.ptp(x), np.ptp(y), 10.0)
    middle = 0.5 * (x.max() + x.min()), 0.5 * (y.max() + y.min())
    axes.set_xlim(middle[0] - half, middle[0] + half)
    share = 0.82 * 3.6 / (0.85 * _WIDTH)
    height = max(0.55 * np.ptp(y), half * share)
    axes.set_ylim(middle[1] - height, middle[1] + height)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.grid(alpha=0.3)
    return _svg(sheet)


def _histories(found: Found, curves: Sequence[_Curve]) -> bytes:
    """Axes one above the other over time; red where the estimates are not trustworthy."""
    time, trusted = found.drive.time, found.estimate.trustworthy
    height = 0.55 + _ROW * len(curves)
    sheet = _sheet(height)
    first = None
    starts = _bins(time.size, _MOST)
    doubtful = None if trusted is None else np.logical_or.reduceat(~trusted, starts)
    for row, curve in enumerate(curves):
        bottom = (0.5 + _ROW * (len(curves) - 1 - row)) / height
        axes = sheet.add_axes((0.13, bottom, 0.84, 0.70 * _ROW / height), sharex=first)
        first = first or axes
        _draw(axes, time, starts, curve)
        if doubtful is not None and doubtful.any():
            axes.fill_between(
                time[starts], 0.0, 1.0, where=doubtful.tolist(), color=_DOUBT, alpha=0.13, lw=0,
                transform=axes.get_xaxis_transform(), step="post",
            )  # fmt: skip
        axes.set_title(curve.title, loc="left", fontsize=11, pad=3)
        axes.set_xlim(time[0], time[-1])
        axes.grid(alpha=0.3)
        axes.tick_params(labelbottom=row == len(curves) - 1)
    for axes in sheet.axes[-1:]:
        axes.set_xlabel("time [s]")
    return _svg(sheet)


def _draw(axes: Any, time: Array, starts: NDArray[np.int64], curve: _Curve) -> None:
    at = time[starts]
    if curve.measured is not None:
        low, high = (f.reduceat(curve.measured, starts) for f in (np.fmin, np.fmax))
        axes.fill_between(at, low, high, color=_MEASURED, alpha=0.45, lw=0.8)
    if curve.truth is not None:
        axes.plot(at, curve.truth[starts], color=_TRUTH, lw=1.8, ls="--")
    if curve.estimate is None:
        return
    values = curve.estimate[starts]
    axes.plot(at, values, color=_TWIN, lw=1.5)
    if curve.sd is None:
        return
    low, high = (values + sign * curve.sd[starts] for sign in (-2.0, 2.0))
    axes.fill_between(at, low, high, color=_TWIN, alpha=0.22, lw=0)
    later = slice(int(_SETTLED * starts.size), None)  # the band at the start would hide the rest
    shown_ones = [values, low[later], high[later]]
    shown_ones += [] if curve.truth is None else [curve.truth[starts]]
    finite = np.concatenate(shown_ones)
    finite = finite[np.isfinite(finite)]
    if finite.size and np.ptp(finite) > 0.0:
        margin = 0.08 * float(np.ptp(finite))
        axes.set_ylim(finite.min() - margin, finite.max() + margin)


def _bins(n: int, most: int) -> NDArray[np.int64]:
    """First indices of at most so many parts of n samples."""
    parts = min(n, most)
    return np.arange(parts, dtype=np.int64) * n // parts


def _known(values: Array) -> bool:
    return bool(np.isfinite(values).any())


def _sheet(height: float) -> Any:
    from matplotlib.figure import Figure  # not at the top: it is optional and slow

    return Figure(figsize=(_WIDTH, height))


def _svg(sheet: Any) -> bytes:
    buffer = BytesIO()
    sheet.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()
