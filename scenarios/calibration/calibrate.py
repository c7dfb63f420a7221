"""Fits a twin to a log: `til calibrate`.

The twin runs over the log and its outputs are compared with the measured ones; bounded least
squares over such black-box runs changes what the user has freed
(`scenarios.calibration.free_parameters`). What
comes out is a TOML file with values, confidence intervals and where they come from.
"""

import hashlib
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimators.least_squares import Fit, fit
from estimators.speed_follower import TORQUES, SpeedFollower
from scenarios.calibration.candidate import Candidate
from scenarios.calibration.free_parameters import FREE, starts
from scenarios.experiment.progress import parallel
from scenarios.experiment.result import Result, Row, replacing, versions
from twin import OUTPUTS, Drive, Twin, TwinError, Vehicle

Array = NDArray[np.float64]

# What an error of a signal is measured in; chosen: what a good model of a car leaves
SIZES = {
    "sideslip": np.radians(0.2),
    **dict.fromkeys(("ax", "ay", "az"), 0.3),
    **dict.fromkeys(("roll_rate", "pitch_rate", "yaw_rate"), 0.02),
    **dict.fromkeys(OUTPUTS[6:], 0.3),
}
RATE = 20.0  # [Hz] at which residuals are taken: above what a driver excites
BLOCK = 2.0  # [s], see `estimators.least_squares`; chosen: some times the memory of a car
MEMORY = 0.5  # [s], of residuals: what a sample says against a prior; chosen
LARGEST = 20.0  # of a residual, and of all residuals of a twin that blows up


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What is fitted to what.

    Attributes:
        candidate: at the start; its values hold also what is not free.
        free: names of `FREE`.
        signals: of `SIZES`; sideslip is that of the drive's truth.
        drive: all of what may be used.
        prior_sd: how far a free parameter is believed to lie from its start, by name; nothing is
            believed of the others.
    """

    candidate: Candidate
    free: tuple[str, ...]
    signals: tuple[str, ...]
    drive: Drive
    prior_sd: Mapping[str, float] = field(default_factory=dict)

    def at(self, point: Array) -> Candidate:
        """The candidate of a point (n,)."""
        named = dict(zip(self.free, map(float, point), strict=True))
        return replace(self.candidate, values={**self.candidate.values, **named})


def residuals(task: Task, point: Array) -> Array:
    """(N, m) scaled errors of a point (n,), a column per signal, rows at `RATE`."""
    candidate, stride = task.at(point), max(round(1.0 / RATE / task.drive.dt), 1)
    try:
        estimate = candidate.run(task.drive)
    except TwinError:  # the point is no car that can drive so
        rows = len(range(0, len(task.drive), stride))
        return np.full((rows, len(task.signals)), LARGEST)
    columns = [
        ((candidate.sideslip(estimate) if s == "sideslip" else estimate[s]) - measured(task, s))
        / SIZES[s]
        for s in task.signals
    ]
    # samples without a measurement say nothing
    errors = np.nan_to_num(np.column_stack(columns)[::stride], nan=0.0, posinf=LARGEST)
    return np.clip(errors, -LARGEST, LARGEST)


def measured(task: Task, signal: str) -> Array:
    """(N,) of a signal, as the candidate's twin should show it."""
    if signal == "sideslip":
        return task.drive.truth["sideslip"]
    offset = task.candidate.values.get("ay_offset", 0.0) if signal == "ay" else 0.0
    return task.drive.channel(signal) - offset


def check(task: Task) -> None:
    """Refuses a task that cannot be done.

    Raises:
        TwinError: nothing is free, a signal is unknown or not measured, the drive is too coarse, or
            the mass is to be found from a speed that is followed.
    """
    if not task.free:
        raise TwinError(f"calibrate: nothing is free; allowed: {', '.join(FREE)}")
    torqueless = not set(TORQUES) & set(task.drive.input_names)
    if torqueless and "mass" in task.free:
        raise TwinError(
            "calibrate: mass is free, but the log has no torques and the twin follows the measured "
            "speed: mass is not observable then; allowed: do not free it"
        )
    for signal in task.signals:
        if signal not in SIZES:
            raise TwinError(f"calibrate: signal {signal!r} is unknown; allowed: {', '.join(SIZES)}")
        known = (*task.drive.truth, *task.drive.output_names)
        if signal not in known or not np.isfinite(measured(task, signal)).any():
            raise TwinError(f"calibrate: the log has no {signal}; allowed: signals that it has")
    for name, of in (("sideslip_offset", "sideslip"), ("sideslip_lever", "sideslip")):
        if name in task.free and of not in task.signals:
            raise TwinError(f"calibrate: {name} is free; allowed: with {of} among the signals")


def calibrate(task: Task, *, jobs: int = 1, evaluations: int = 20) -> Fit:
    """Fits the task's free parameters; a run per parameter and step, so many side by side.

    Raises:
        TwinError: see `check`; or the twin cannot drive this log at the start.
    """
    check(task)
    start = starts(task.free, {n: v for n, v in task.candidate.values.items() if n in task.free})
    named = [FREE[name] for name in task.free]
    # tells what is wrong with channels, sample time or start
    task.at(np.array(list(start.values()))).run(task.drive)

    def side_by_side(points: Sequence[Array]) -> Sequence[Array]:
        return parallel(partial(residuals, task), points, min(jobs, len(points)), "runs")

    return fit(
        side_by_side,
        list(start.values()),
        ([free.low for free in named], [free.high for free in named]),
        [free.scale for free in named],
        block=round(BLOCK * RATE),
        memory=round(MEMORY * RATE),
        prior_sd=[task.prior_sd.get(name, np.inf) for name in task.free],
        evaluations=evaluations,
    )


def driven(vehicle: Vehicle) -> SpeedFollower:
    """A follower of the speed for a car of which nothing is known but its files: rear drive."""
    twin = Twin(vehicle)
    twin.reset(0.0)
    model, radius = twin.model, twin.data.xpos[twin.car.wheel_body, 2]
    return SpeedFollower(
        mass=float(model.body_subtreemass[0]),
        drag_area=float(twin.car.drag_area),
        radius_front=float(radius[:2].mean()),
        radius_rear=float(radius[2:].mean()),
    )


def task_of(
    log: Path,
    vehicle: str,
    free: Sequence[str],
    signals: Sequence[str],
    between: tuple[float | None, float | None] = (None, None),
) -> Task:
    """A task of the command line: the twin runs free, but for gains that are freed.

    Args:
        log: a drive.
        vehicle: a car of the project by its name, or an MJCF file.
        free: what is fitted, see `Task`.
        signals: what to, see `Task`.
        between: the log's times that are used [s]; None: from its start, to its end.

    Raises:
        TwinError: a file is missing or broken, or nothing lies between the times.
    """
    drive, car = Drive.load(log), Vehicle.load(vehicle)
    first, last = between
    used = (drive.time >= (-np.inf if first is None else first)) & (
        drive.time <= (np.inf if last is None else last)
    )
    if np.count_nonzero(used) < 2:
        raise TwinError(
            f"calibrate: no samples lie between {first} and {last} s; allowed: times from "
            f"{drive.time[0]:g} to {drive.time[-1]:g} s"
        )
    candidate = Candidate(vehicle=car, follower=driven(car))
    return Task(
        candidate=candidate, free=tuple(free), signals=tuple(signals), drive=cut(drive, used)
    )


def cut(drive: Drive, samples: slice | NDArray[np.bool_]) -> Drive:
    """These samples of a drive."""
    return drive.replace(
        time=drive.time[samples],
        inputs=drive.inputs[samples],
        measurements=drive.measurements[samples],
        truth={name: values[samples] for name, values in drive.truth.items()},
    )


def run(task: Task, log: Path, path: Path, *, jobs: int, evaluations: int) -> Result:
    """Calibrates, and writes the TOML file whole or not at all."""
    start = time.perf_counter()
    found = calibrate(task, jobs=jobs, evaluations=evaluations)
    write(path, task, log, found)
    return Result(
        name="calibrate",
        settings={
            "log": log.name,
            "vehicle": task.candidate.vehicle.source.stem,
            "free": list(task.free),
            "signals": list(task.signals),
            "evaluations": evaluations,
        },
        seconds=time.perf_counter() - start,
        rows=list(_rows(task, found)),
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
        rows.append(
            Row.over_seeds(
                [value], case=case, quantity="residuals", metric="rms", unit="1",
                estimator="least-squares",
            )
        )  # fmt: skip
    return rows


def write(path: Path, task: Task, log: Path, found: Fit) -> None:
    """Writes what was found, and from what, as TOML; whole or not at all."""
    import tomli_w

    drive, fixed = task.drive, dict(task.candidate.values)
    content: dict[str, Any] = {
        "vehicle": task.candidate.vehicle.source.stem,
        "log": log.name,
        "log_sha256": hashlib.sha256(log.read_bytes()).hexdigest(),
        "from_s": float(drive.time[0]),
        "to_s": float(drive.time[-1]),
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
            "prior_sd": task.prior_sd.get(name, math.inf),
        }
    with replacing(path) as partial_file:
        partial_file.write_bytes(tomli_w.dumps(content).encode())


def read(path: Path) -> dict[str, float]:
    """The values that `write` wrote, the fixed ones included.

    Raises:
        TwinError: the file is missing or no calibration.
    """
    import tomllib

    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        values = {name: float(entry["value"]) for name, entry in content["values"].items()}
        return {**content["fixed"], **values}
    except OSError as error:
        raise TwinError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise TwinError(f"{path}: is no calibration: {error!r}") from error
