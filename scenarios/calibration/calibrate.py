"""Fits a twin to a log: `til calibrate`.

The twin runs over the log and its outputs are compared with the measured ones; bounded least
squares over such black-box runs changes what the user has freed
(`scenarios.logs.free_parameters`). What
comes out is a TOML file with values, confidence intervals and where they come from.
"""

import hashlib
import math
import os
import time
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

import models
from estimators.least_squares import Fit, fit
from estimators.speed_follower import TORQUES
from scenarios.experiment.progress import parallel
from scenarios.experiment.result import Result, Row, replacing, versions
from scenarios.logs.candidate import Candidate
from scenarios.logs.follower import driven
from scenarios.logs.free_parameters import (
    BAND,
    DEFAULTS,
    DEFAULTS_OF_SIDESLIP,
    FREE,
    NOISES,
    starts,
)
from scenarios.logs.pieces import prepared
from twin import OUTPUTS, WHEEL_SPEEDS, WHEELS, Drive, Twin, TwinError, Vehicle
from twin.car.signals import signals_of

Array = NDArray[np.float64]

# What an error of a signal is measured in; chosen: what a good model of a car leaves
SIZES = {
    "sideslip": np.radians(0.2),
    **dict.fromkeys(("ax", "ay", "az"), 0.3),
    **dict.fromkeys(("roll_rate", "pitch_rate", "yaw_rate"), 0.02),
    **dict.fromkeys(OUTPUTS[WHEEL_SPEEDS], 0.3),
    **{f"{force}_{wheel}": 150.0 for force in ("fx", "fy", "fz") for wheel in WHEELS},
}
HELD_OUT = 0.25  # of each log, at its end, that the result is scored on; chosen
RATE = 20.0  # [Hz] at which residuals are taken: above what a driver excites
INERTIA_SD = 0.3  # of the moments that the files say; chosen: rules by mass and size are as good
BLOCK = 2.0  # [s], see `estimators.least_squares`; chosen: some times the memory of a car
MEMORY = 0.5  # [s], of residuals: what a sample says against a prior; chosen
_NORMAL_95 = 1.96
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
    return np.concatenate([_errors(candidate, drive, task.signals) for drive in task.drives])


def _errors(candidate: Candidate, drive: Drive, signals: Sequence[str]) -> Array:
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
    if BAND in task.free:
        raise TwinError(f"calibrate: {BAND} is free; allowed: others, it follows from the errors")
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
        if not any(_has(drive, signal) for drive in task.drives):
            raise TwinError(f"calibrate: the log has no {signal}; allowed: signals that it has")
    for name, of in (("sideslip_offset", "sideslip"), ("sideslip_lever", "sideslip")):
        if name in task.free and of not in task.signals:
            raise TwinError(f"calibrate: {name} is free; allowed: with {of} among the signals")


def _has(drive: Drive, signal: str) -> bool:
    if signal not in OUTPUTS:
        return signal in drive.truth and bool(np.isfinite(drive.truth[signal]).any())
    return signal in drive.output_names and bool(np.isfinite(drive.channel(signal)).any())


def calibrate(task: Task, *, jobs: int = 1, evaluations: int = 20) -> Fit:
    """Fits the task's free parameters; a run per parameter and step, so many side by side.

    Raises:
        TwinError: see `check`; or the twin cannot drive this log at the start.
    """
    check(task)
    start = starts(task.free, {n: v for n, v in task.candidate.values.items() if n in task.free})
    named = [FREE[name] for name in task.free]
    # tells what is wrong with channels, sample time or start
    for drive in task.drives:
        task.at(np.array(list(start.values()))).run(drive)

    def side_by_side(points: Sequence[Array]) -> Sequence[Array]:
        return parallel(partial(residuals, task), points, min(jobs, len(points)), "runs")

    return fit(
        side_by_side,
        list(start.values()),
        ([free.low for free in named], [free.high for free in named]),
        [free.scale for free in named],
        block=round(BLOCK * RATE),
        memory=round(MEMORY * RATE),
        prior_sd=[task.prior_sd.get(name, FREE[name].prior_sd) for name in task.free],
        evaluations=evaluations,
    )


def _as_driven(task: Task, found: Fit) -> tuple[Task, Fit]:
    """Both with the load that the twin drove with: a rigid body's, which may have other moments."""
    candidate = task.at(found.values)
    load = candidate.of("load")
    if not load:
        return task, found
    twin = Twin(candidate.vehicle.scaled(**candidate.of("scale")))
    asked = [load.get(name, 0.0) for name in twin.parameters]
    given = zip(twin.parameters, twin.set_parameters(asked).tolist(), strict=True)
    # what the car's files are scaled by shares names with parameters of a running twin
    kept = {name: value for name, value in given if name in FREE and FREE[name].kind == "load"}
    lifted = {n: v for n, v in kept.items() if v != load.get(n, 0.0) and n not in task.free}
    values = [kept.get(n, v) for n, v in zip(task.free, found.values.tolist(), strict=True)]
    known = {**task.candidate.values, **lifted}
    task = replace(task, candidate=replace(task.candidate, values=known))
    return task, replace(found, values=np.array(values))


def task_of(
    logs: Sequence[Path],
    map_path: Path | None,
    vehicle: str,
    free: Sequence[str],
    signals: Sequence[str],
    between: tuple[float | None, float | None] = (None, None),
    held_out: float = HELD_OUT,
) -> tuple[Task, tuple[Drive, ...]]:
    """A task of the command line: the twin runs free, but for gains that are freed.

    A constant offset of each fitted signal of an IMU is freed along. Where the sideslip is measured
    and torques are not, the twin runs in the observer that `til estimate` uses, and the noises of
    that are freed along.

    Args:
        logs: recorded drives, read as `til estimate` reads them.
        map_path: which channels of the logs are ours; None: they are drives of this project.
        vehicle: a car of the project by its name, or an MJCF or TOML file.
        free: what is fitted, see `Task`; nothing: what `defaults` says.
        signals: what to, see `Task`; nothing: what `defaults` says.
        between: the logs' times that are used [s]; None: from their start, to their end.
        held_out: share of each log, at its end, that is not fitted.

    Returns:
        The task, over all but the last share of each log; and what is held out.

    Raises:
        TwinError: a file is missing or broken, or nothing lies between the times.
    """
    car = Vehicle.load(vehicle)
    dt = float(car.compile().opt.timestep)
    first, last = between
    used, kept = [], []
    for log in logs:
        drive = Drive.load(log, map_path, signals_of(car))
        for piece in prepared(_between(drive, first, last), dt).pieces:
            end = round((1.0 - held_out) * len(piece))
            used.append(cut(piece, slice(0, end)))
            if len(piece) - end > 1:
                kept.append(cut(piece, slice(end, len(piece))))
    follows = any(not set(TORQUES) & set(piece.input_names) for piece in used)
    signals = signals or default_signals(used, follows=follows)
    free = free or default_free(signals)
    offsets = [f"{s}_offset" for s in signals if s != "sideslip" and f"{s}_offset" in FREE]
    blocks = sum(len(piece) for piece in used) * dt / BLOCK
    if blocks <= len(free) + len(offsets) + 1:  # too short a drive for more
        offsets = []
    scheduled = follows and "sideslip" in signals
    task = Task(
        candidate=Candidate(
            vehicle=car,
            values={name: value for name, value in car.calibration if name in FREE},
            follower=driven(car),
            scheduled=scheduled,
        ),
        free=tuple(dict.fromkeys((*free, *offsets, *(NOISES if scheduled else ())))),
        signals=tuple(signals),
        drives=tuple(used),
        prior_sd=_priors(car),
    )
    return task, tuple(kept)


def default_signals(drives: Sequence[Drive], *, follows: bool) -> tuple[str, ...]:
    """The measured sideslip, if there is one and the twin follows the speed; else ay, yaw rate."""
    if follows and any(_has(drive, "sideslip") for drive in drives):
        return ("sideslip",)
    return "ay", "yaw_rate"


def default_free(signals: Sequence[str]) -> tuple[str, ...]:
    """What a data sheet knows least of, as far as these signals show it."""
    return (*DEFAULTS, *(DEFAULTS_OF_SIDESLIP if "sideslip" in signals else ()))


def _priors(vehicle: Vehicle) -> dict[str, float]:
    """How far the inertia of a car is believed to lie from its file's: what a guess is worth."""
    moments = np.diag(vehicle.chassis().inertia)
    believed = {
        f"J{axis}{axis}": INERTIA_SD * float(m) for axis, m in zip("xyz", moments, strict=True)
    }
    return {name: min(sd, FREE[name].prior_sd) for name, sd in believed.items()}


def _between(drive: Drive, first: float | None, last: float | None) -> Drive:
    used = (drive.time >= (-np.inf if first is None else first)) & (
        drive.time <= (np.inf if last is None else last)
    )
    if np.count_nonzero(used) < 2:
        raise TwinError(
            f"calibrate: no samples lie between {first} and {last} s; allowed: times from "
            f"{drive.time[0]:g} to {drive.time[-1]:g} s"
        )
    return cut(drive, used)


def cut(drive: Drive, samples: slice | NDArray[np.bool_]) -> Drive:
    """These samples of a drive."""
    return drive.replace(
        time=drive.time[samples],
        inputs=drive.inputs[samples],
        measurements=drive.measurements[samples],
        truth={name: values[samples] for name, values in drive.truth.items()},
    )


def run(
    task: Task,
    logs: Sequence[Path],
    path: Path,
    *,
    jobs: int,
    evaluations: int,
    held_out: Sequence[Drive] = (),
) -> Result:
    """Calibrates, and writes the TOML file whole or not at all; `--vehicle` takes that file.

    Args:
        task: what is fitted.
        logs: the files, to be named in what is written.
        path: of what is written.
        jobs: processes.
        evaluations: how many steps at most.
        held_out: drives that were not fitted, on which the result is scored.
    """
    start = time.perf_counter()
    found = calibrate(task, jobs=jobs, evaluations=evaluations)
    task, found = _as_driven(task, found)
    task = with_band(task, found.values, held_out)
    write(path, task, logs, found)
    return Result(
        name="calibrate",
        settings={
            "logs": [log.name for log in logs],
            "vehicle": task.candidate.vehicle.source.stem,
            "free": list(task.free),
            "signals": list(task.signals),
            "evaluations": evaluations,
        },
        seconds=time.perf_counter() - start,
        rows=[*_rows(task, found), *_held_out(task, found, held_out)],
    )


def with_band(task: Task, values: Array, held_out: Sequence[Drive] = ()) -> Task:
    """The task with the factor on the observer's standard deviations that its errors ask for.

    95 % of the errors of the sideslip are then below twice the standard deviation, over what was
    fitted and over what was not.
    """
    candidate = task.at(values)
    if not candidate.scheduled or "sideslip" not in task.signals:
        return task
    band = max(_band(candidate, drives) for drives in (task.drives, held_out) if drives)
    band_before = task.candidate.values.get(BAND, 0.0)
    known = {**task.candidate.values, BAND: band_before + math.log(band)}
    return replace(task, candidate=replace(task.candidate, values=known))


def _band(candidate: Candidate, drives: Sequence[Drive]) -> float:
    """95 % quantile of the sideslip's errors in standard deviations, over that of a normal one."""
    scaled = []
    for drive in drives:
        found = candidate.run(drive)
        assert found.sideslip_sd is not None
        error = np.abs(candidate.sideslip(found) - drive.truth["sideslip"])
        scaled.append(error / np.maximum(found.sideslip_sd, 1e-9))
    return max(float(np.nanquantile(np.concatenate(scaled), 0.95)) / _NORMAL_95, 1e-3)


def _held_out(task: Task, found: Fit, drives: Sequence[Drive]) -> list[Row]:
    """Residuals of what was not fitted, with the car as it was and as it was found."""
    if not drives:
        return []
    rows = []
    for case, candidate in (
        ("held out, before", task.candidate),
        ("held out, after", task.at(found.values)),
    ):
        errors = np.concatenate([_errors(candidate, drive, task.signals) for drive in drives])
        rms = float(np.sqrt(np.mean(errors**2)))
        rows.append(_residuals_row(case, rms))
    return rows


def _residuals_row(case: str, value: float) -> Row:
    return Row.over_seeds(
        [value], case=case, quantity="residuals", metric="rms", unit="1", estimator="least-squares"
    )


def _rows(task: Task, found: Fit) -> list[Row]:
    """Value and ends of the interval of each parameter, and the residuals before and after."""
    table = zip(task.free, found.values, found.low, found.high, found.at_bound, strict=True)
    rows = []
    for name, value, low, high, at_bound in table:
        for metric, number in (("value", value), ("low_95", low), ("high_95", high)):
            rows.append(
                Row.over_seeds(
                    [number],
                    case="at its bound" if at_bound else "within bounds",
                    quantity=name,
                    metric=metric,
                    unit=FREE[name].unit,
                    estimator="least-squares",
                )
            )
    for case, value in (("before", found.rms_before), ("after", found.rms_after)):
        rows.append(_residuals_row(case, value))
    return rows


def write(path: Path, task: Task, logs: Sequence[Path], found: Fit) -> None:
    """Writes what was found, and from what, as TOML; whole or not at all."""
    fixed = dict(task.candidate.values)
    content: dict[str, Any] = {
        "vehicle": _base(task.candidate.vehicle, path),
        "logs": [log.name for log in logs],
        "log_sha256": [hashlib.sha256(log.read_bytes()).hexdigest() for log in logs],
        "from_s": [float(drive.time[0]) for drive in task.drives],
        "to_s": [float(drive.time[-1]) for drive in task.drives],
        "signals": list(task.signals),
        "residuals_rms_before": found.rms_before,
        "residuals_rms_after": found.rms_after,
        "evaluations": found.evaluations,
        "converged": found.converged,
        "versions": versions(),
        "fixed": {name: float(v) for name, v in fixed.items() if name not in task.free},
        "gains": {f"{of}->{to}": float(g) for (to, of), g in task.candidate.gains.items()},
        "values": {},
    }
    table = zip(task.free, found.values, found.low, found.high, found.at_bound, strict=True)
    for name, value, low, high, at_bound in table:
        content["values"][name] = {
            "value": float(value),
            "low_95": float(low),
            "high_95": float(high),
            "unit": FREE[name].unit,
            "at_bound": bool(at_bound),
            "prior_sd": task.prior_sd.get(name, FREE[name].prior_sd),
        }
    with replacing(path) as partial_file:
        partial_file.write_bytes(tomli_w.dumps(content).encode())


def _base(vehicle: Vehicle, path: Path) -> str:
    """The car as its calibration names it: by its name, or by its file seen from there."""
    if vehicle.source.parent == models.path("suv").parent:
        return vehicle.source.stem
    return os.path.relpath(vehicle.source, path.parent)


def read(path: Path) -> dict[str, float]:
    """The values that `write` wrote, the fixed ones included.

    Raises:
        TwinError: the file is missing or no calibration.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        values = {name: float(entry["value"]) for name, entry in content["values"].items()}
        return {**content["fixed"], **values}
    except OSError as error:
        raise TwinError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise TwinError(f"{path}: is no calibration: {error!r}") from error
