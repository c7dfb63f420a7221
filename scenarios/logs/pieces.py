"""A drive of any channels and time stamps becomes drives that a car's twin can follow."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.joint.noise import noise_of_record
from estimators.speed_follower import TORQUES
from estimators.til.stream import FASTEST, LONGEST_GAP, LONGEST_STEP
from twin import INPUTS, OUTPUTS, WHEELS, Drive, TwinError
from twin.logs.mapped_log import NEEDS, with_all_wheels
from twin.logs.resampling import resample

Array = NDArray[np.float64]
ROAD = tuple(f"road_height_{wheel}" for wheel in WHEELS)
DRIVE_TORQUES = tuple(f"drive_torque_{wheel}" for wheel in WHEELS)
WHEEL_SPEEDS = tuple(f"wheel_speed_{wheel}" for wheel in WHEELS)
SPEED = "vx or the wheel speeds"
_START = 0.05  # [s] over which the speed at the start is averaged; chosen


class Prepared(NamedTuple):
    """A log as its twin can follow it.

    Attributes:
        pieces: drives of the twin's step, `twin.INPUTS` less unknown torques, and `twin.OUTPUTS`
            with vx behind them, where it is measured; a long gap lies between two.
        done: sentences that say what was done.
        follows: whether the twin has to follow the speed, for want of torques.
        ax_noise: density of the white noise of a_x, by the log's own samples [m/s2 over root of
            Hz]; 0 without a_x.
    """

    pieces: tuple[Drive, ...]
    done: tuple[str, ...]
    follows: bool
    ax_noise: float = 0.0


def prepared(drive: Drive, dt: float) -> Prepared:
    """The drive in pieces of a sample time [s].

    Raises:
        TwinError: the drive lacks an input, or nobody measured a speed.
    """
    done: list[str] = []
    full, follows = _with_all_channels(drive, done)
    pieces = _uniform(full, dt, done)
    started = [piece for piece in map(_from_known_speed, pieces) if piece is not None]
    if not started:
        raise TwinError(f"has no {SPEED}; the twin needs them to start at the right speed")
    if sum(map(len, started)) < sum(map(len, pieces)):
        done.append("What comes before the first measured speed is left out.")
    if follows:
        done.append("There are no torques: the twin follows vx, and the mass cannot be seen.")
    return Prepared(tuple(started), tuple(done), follows, _ax_noise(drive))


def _ax_noise(drive: Drive) -> float:
    """Of samples as they come: what is interpolated between them looks less noisy than it is."""
    if "ax" not in drive.output_names:
        return 0.0
    step = float(np.median(np.diff(drive.time)))
    return float(noise_of_record(drive.channel("ax")[:, None])[0]) * float(np.sqrt(step))


def longest_stretch(drive: Drive) -> Drive:
    """The longest part of a drive without a gap in time; all of it if it has none."""
    steps = np.diff(drive.time)
    cuts = np.flatnonzero(steps > max(LONGEST_GAP, 1.5 * float(np.median(steps)))) + 1
    if not cuts.size:
        return drive
    bounds = [0, *cuts.tolist(), len(drive)]
    first, last = max(pairwise(bounds), key=lambda part: part[1] - part[0])
    return drive[first:last] if last - first > 1 else drive


def measured(pieces: Sequence[Drive]) -> set[str]:
    """Names of the measurements that there are, and of inputs that no map declares constant.

    Drive torques that never change say nothing, wherever they come from.
    """
    names = set()
    for piece in pieces:
        finite = np.asarray(np.isfinite(piece.measurements).any(axis=0))
        names |= {name for name, there in zip(piece.output_names, finite, strict=True) if there}
        moving = np.atleast_1d(np.ptp(piece.inputs, axis=0) > 0.0)
        declared = (*DRIVE_TORQUES, *piece.settings.get("log", {}).get("constants", ()))
        moving |= [name not in declared for name in piece.input_names]
        names |= {name for name, there in zip(piece.input_names, moving, strict=True) if there}
    return with_all_wheels(names)


def lacking(quantity: str, names: set[str]) -> list[str]:
    """What an estimate of the quantity needs and a log of these names has not."""
    has_speed = "vx" in names or all(name in names for name in WHEEL_SPEEDS)
    known = names | ({SPEED} if has_speed else set())
    return [name for name in NEEDS[quantity] if name not in known]


def start_speed(piece: Drive, radius: float) -> float:
    """Measured at the start, by wheels of this rolling radius [m] if nothing else [m/s].

    Raises:
        TwinError: it is no speed that a car has.
    """
    n = max(round(_START / piece.dt), 1)
    speed = float(np.median(_speeds(piece, radius)[:n]))
    if not abs(speed) < FASTEST:
        raise TwinError(f"starts at {speed:.4g} m/s; allowed: less than {FASTEST:g}")
    return max(speed, 0.0)


def _speeds(piece: Drive, radius: float) -> Array:
    """(N,) NaN where nothing tells it."""
    wheels = np.sort([piece.channel(name) for name in WHEEL_SPEEDS], axis=0)  # NaN come last
    count = np.isfinite(wheels).sum(axis=0)
    low, high = np.maximum(count - 1, 0) // 2, np.minimum(count // 2, 3)
    at = np.arange(len(piece))
    speed = np.where(count > 0, 0.5 * radius * (wheels[low, at] + wheels[high, at]), np.nan)
    if "vx" in piece.output_names:
        vx = piece.channel("vx")
        speed = np.where(np.isfinite(vx), vx, speed)
    return speed


def _with_all_channels(drive: Drive, done: list[str]) -> tuple[Drive, bool]:
    """Channels in the twin's order; whether there are no torques."""
    known = dict(zip(drive.input_names, drive.inputs.T, strict=True))
    if not any(name in known for name in ROAD):
        known |= dict.fromkeys(ROAD, np.zeros(len(drive)))
        done.append("road_height: 0 m throughout, as the log has none.")
    follows = not any(name in known for name in TORQUES)
    if follows and "vx" not in drive.output_names:
        raise TwinError(
            f"has neither torques nor vx; allowed: {TORQUES[0]} and so on, or a measured vx for "
            "the twin to follow"
        )
    names = tuple(name for name in INPUTS if not (follows and name in TORQUES))
    for name in names:
        if name not in known:
            raise TwinError(f"input {name} is missing; allowed: a column input.{name}, or a map")
    outputs = (*OUTPUTS, *(name for name in ("vx",) if name in drive.output_names))
    missing = np.full(len(drive), np.nan)
    has = drive.output_names
    full = drive.replace(
        inputs=np.column_stack([known[name] for name in names]),
        input_names=names,
        measurements=np.column_stack(
            [drive.channel(name) if name in has else missing for name in outputs]
        ),
        output_names=outputs,
    )
    return full, follows


def _uniform(drive: Drive, dt: float, done: list[str]) -> list[Drive]:
    """Pieces of the sample time; a drive that has it stays as it is."""
    steps = np.diff(drive.time)
    if _has_steps_of(dt, drive.time):
        return [drive]
    cuts = np.flatnonzero(steps > LONGEST_GAP) + 1
    short = np.count_nonzero((steps > LONGEST_STEP) & (steps <= LONGEST_GAP))
    step = float(np.median(steps))
    if abs(step - dt) > 1e-6 * dt:
        done.append(
            f"Samples every {step:.4g} s are brought to every {dt:g} s, linear between them."
        )
    if short:
        done.append(
            f"{short} gaps of up to {LONGEST_GAP:g} s are bridged: inputs held, nothing measured."
        )
    if cuts.size:
        done.append(
            f"{cuts.size} gaps of more than {LONGEST_GAP:g} s: behind each the twin starts again "
            "at the measured speed and keeps what it knows of the parameters."
        )
    bounds = [0, *cuts.tolist(), len(drive)]
    pieces = [(a, b) for a, b in pairwise(bounds) if b - a > 1]
    found = [_on_grid(drive, slice(a, b), dt) for a, b in pieces]
    good = [piece for piece in found if piece is not None]
    if not good:
        raise TwinError(f"has no two samples within {LONGEST_GAP:g} s of each other")
    return good


def _has_steps_of(dt: float, time: Array) -> bool:
    """Whether times have that step throughout."""
    rounding = 2.0 * np.spacing(np.abs(time).max())
    return bool(np.abs(np.diff(time) - dt).max() <= 1e-6 * dt + rounding)


def _on_grid(drive: Drive, part: slice, dt: float) -> Drive | None:
    """A part of a drive at uniform times; None if it is shorter than two of them."""
    time = drive.time[part]
    if _has_steps_of(dt, time):
        return drive[part]
    n = int((time[-1] - time[0]) / dt + 1e-3) + 1
    if n < 2:
        return None
    grid = time[0] + dt * np.arange(n)
    held = np.clip(np.searchsorted(time, grid + 1e-3 * dt, side="right") - 1, 0, time.size - 1)

    def at_grid(values: Array) -> Array:
        return resample(time, values[part], grid, LONGEST_STEP)

    inputs = np.column_stack([at_grid(column) for column in drive.inputs.T])
    return drive.replace(
        time=grid,
        inputs=np.where(np.isnan(inputs), drive.inputs[part][held], inputs),
        measurements=np.column_stack([at_grid(column) for column in drive.measurements.T]),
        truth={name: at_grid(values) for name, values in drive.truth.items()},
    )


def _from_known_speed(piece: Drive) -> Drive | None:
    """The piece from the first sample on that tells a speed; None if none does."""
    known = np.isfinite(_speeds(piece, 1.0))
    first = int(np.argmax(known))
    if not known[first] or first > len(piece) - 2:
        return None
    return piece[first:]
