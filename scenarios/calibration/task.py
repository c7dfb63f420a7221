"""What a calibration fits: numbers of a car to signals of drives; the errors of a candidate."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from estimators.speed_follower import TORQUES
from scenarios.logs.candidate import Candidate
from scenarios.logs.free_parameters import FOLLOWING, FREE
from twin import OUTPUTS, WHEEL_SPEEDS, WHEELS, Drive, TwinError

Array = NDArray[np.float64]

# What an error of a signal is measured in; chosen: what a good model of a car leaves
SIZES = {
    "sideslip": np.radians(0.2),
    **dict.fromkeys(("ax", "ay", "az"), 0.3),
    **dict.fromkeys(("roll_rate", "pitch_rate", "yaw_rate"), 0.02),
    **dict.fromkeys(OUTPUTS[WHEEL_SPEEDS], 0.3),
    **{f"{force}_{wheel}": 150.0 for force in ("fx", "fy", "fz") for wheel in WHEELS},
}
RATE = 20.0  # [Hz] at which residuals are taken: above what a driver excites
LARGEST = 20.0  # of a residual, and of all residuals of a twin that blows up


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What is fitted to what.

    Attributes:
        candidate: at the start; its values hold also what is not free.
        free: names of `FREE`.
        signals: of `SIZES`; sideslip and tyre forces are those of the drive's truth.
        drives: all of what may be used.
        prior_sd: how far a free parameter is believed to lie from its start, by name; nothing is
            believed of the others.
    """

    candidate: Candidate
    free: tuple[str, ...]
    signals: tuple[str, ...]
    drives: tuple[Drive, ...]
    prior_sd: Mapping[str, float] = field(default_factory=dict)

    def at(self, point: Array) -> Candidate:
        """The candidate of a point (n,)."""
        named = dict(zip(self.free, map(float, point), strict=True))
        return replace(self.candidate, values={**self.candidate.values, **named})


def residuals(task: Task, point: Array) -> Array:
    """(N, m) scaled errors of a point (n,), a column per signal, rows at `RATE`."""
    candidate = task.at(point)
    return np.concatenate([scaled_errors(candidate, drive, task.signals) for drive in task.drives])


def scaled_errors(candidate: Candidate, drive: Drive, signals: Sequence[str]) -> Array:
    """(N, m) scaled errors of a candidate over one drive."""
    stride = max(round(1.0 / RATE / drive.dt), 1)
    try:
        estimate = candidate.run(drive)
    except TwinError:  # the point is no car that can drive so
        rows = len(range(0, len(drive), stride))
        return np.full((rows, len(signals)), LARGEST)
    columns = [
        (
            (candidate.sideslip(estimate) if s == "sideslip" else estimate[s])
            - measured(candidate, drive, s)
        )
        / SIZES[s]
        for s in signals
    ]
    # samples without a measurement say nothing
    errors = np.nan_to_num(np.column_stack(columns)[::stride], nan=0.0, posinf=LARGEST)
    return np.clip(errors, -LARGEST, LARGEST)


def measured(candidate: Candidate, drive: Drive, signal: str) -> Array:
    """(N,) of a signal of a drive, as the candidate's twin should show it."""
    if signal not in OUTPUTS:
        return drive.truth[signal]
    return drive.channel(signal) - candidate.values.get(f"{signal}_offset", 0.0)


def check(task: Task) -> None:
    """Refuses a task that cannot be done.

    Raises:
        TwinError: nothing is free, a signal is unknown or not measured, the drive is too coarse, or
            the mass is to be found from a speed that is followed.
    """
    for name in FOLLOWING:
        if name in task.free:
            raise TwinError(
                f"calibrate: {name} is free; allowed: others, it follows from the errors"
            )
    if not task.free:
        raise TwinError(f"calibrate: nothing is free; allowed: {', '.join(FREE)}")
    if not task.drives:
        raise TwinError("calibrate: there is no drive; allowed: one or more")
    torqueless = any(not set(TORQUES) & set(drive.input_names) for drive in task.drives)
    if torqueless and "mass" in task.free:
        raise TwinError(
            "calibrate: mass is free, but the log has no torques and the twin follows the measured "
            "speed: mass is not observable then; allowed: do not free it"
        )
    for signal in task.signals:
        if signal not in SIZES:
            raise TwinError(f"calibrate: signal {signal!r} is unknown; allowed: {', '.join(SIZES)}")
        if not any(has_signal(drive, signal) for drive in task.drives):
            raise TwinError(f"calibrate: the log has no {signal}; allowed: signals that it has")
    for name, of in (("sideslip_offset", "sideslip"), ("sideslip_lever", "sideslip")):
        if name in task.free and of not in task.signals:
            raise TwinError(f"calibrate: {name} is free; allowed: with {of} among the signals")


def has_signal(drive: Drive, signal: str) -> bool:
    """Whether a drive has a signal, as a measurement or, what is none, in its truth."""
    if signal not in OUTPUTS:
        return signal in drive.truth and bool(np.isfinite(drive.truth[signal]).any())
    return signal in drive.output_names and bool(np.isfinite(drive.channel(signal)).any())
