"""Fits a twin to a log: `til calibrate`.

The twin runs over the log and its outputs are compared with the measured ones; bounded least
squares over such black-box runs changes what the user has freed
(`scenarios.logs.free_parameters`). What comes out is a TOML file with values, confidence intervals
and where they come from.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimators.least_squares import Fit, fit
from scenarios.calibration.car_file import write
from scenarios.calibration.plan import Plan
from scenarios.calibration.task import RATE, Task, check, residuals, scaled_errors
from scenarios.experiment.progress import parallel
from scenarios.experiment.result import Result, Row
from scenarios.logs.candidate import Candidate
from scenarios.logs.free_parameters import BAND, FREE, SIDESLIP_SD, starts
from twin import Drive, Twin

Array = NDArray[np.float64]

BLOCK = 2.0  # [s], see `estimators.least_squares`; chosen: some times the memory of a car
MEMORY = 0.5  # [s], of residuals: what a sample says against a prior; chosen
_NORMAL_95 = 1.96


def calibrate(task: Task, *, jobs: int = 1, evaluations: int = 20) -> Fit:
    """Fits the task's free parameters; a run per parameter and step.

    Args:
        task: what is fitted.
        jobs: processes side by side.
        evaluations: how many steps at most.

    Raises:
        TwinError: see `check`; or the twin cannot drive this log at the start.
    """
    check(task)
    known = {n: v for n, v in task.candidate.values.items() if n in task.free}
    start = np.array(list(starts(task.free, known).values()))
    named = [FREE[name] for name in task.free]
    # tells what is wrong with channels, sample time or start
    for drive in task.drives:
        task.at(start).run(drive)

    def side_by_side(points: Sequence[Array]) -> Sequence[Array]:
        return parallel(partial(residuals, task), points, min(jobs, len(points)), "runs")

    return fit(
        side_by_side,
        start,
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


def run(plan: Plan, logs: Sequence[Path], path: Path, *, jobs: int, evaluations: int) -> Result:
    """Calibrates, and writes the TOML file whole or not at all; `--vehicle` takes that file.

    What is held out scores a first fit. The last fit is to all. The band of the sideslip is the
    mean of what its own errors ask for and of what the first one's ask for in what it did not see:
    the last fit's errors in another drive lie between.

    Args:
        plan: what is fitted and what is held out.
        logs: the files, to be named in what is written.
        path: of what is written.
        jobs: processes.
        evaluations: how many steps at most.
    """
    start = time.perf_counter()
    task = plan.task
    found = calibrate(task, jobs=jobs, evaluations=evaluations)
    scores, unseen = [], None
    if plan.held_out:
        first = task.at(found.values)
        scores = _held_out(task, first, plan.held_out)
        unseen = band(first, plan.held_out) if has_band(task, first) else None
        task = replace(task, drives=plan.whole)
        found = calibrate(task, jobs=jobs, evaluations=evaluations)
    task, found = _as_driven(task, found)
    task = with_band(task, found.values, unseen)
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
        rows=[*_rows(task, found), *scores],
    )


def has_band(task: Task, candidate: Candidate) -> bool:
    """Whether the errors ask for a band of the sideslip: it is fitted, by an observer."""
    return "sideslip" in task.signals and (candidate.scheduled or bool(candidate.of("gain")))


def with_band(task: Task, values: Array, unseen: float | None = None) -> Task:
    """The task with the standard deviation of the sideslip that its errors ask for, see `band`.

    An observer with scheduled gains has one, which a factor widens or narrows; that of constant
    gains is constant.

    Args:
        task: what was fitted.
        values: (n,) that were found.
        unseen: what errors of a drive that was not fitted ask for; None: there is none.
    """
    candidate = task.at(values)
    if not has_band(task, candidate):
        return task
    found = band(candidate, task.drives)
    if unseen is not None:
        found = 0.5 * (found + unseen)
    known = dict(task.candidate.values)
    if candidate.scheduled:
        known[BAND] = known.get(BAND, 0.0) + math.log(found)
    else:
        known[SIDESLIP_SD] = found
    return replace(task, candidate=replace(task.candidate, values=known))


def band(candidate: Candidate, drives: Sequence[Drive]) -> float:
    """95 % quantile of the sideslip's errors over that of a normal one.

    In standard deviations where gains are scheduled, else in rad.
    """
    scaled = []
    for drive in drives:
        found = candidate.run(drive)
        error = np.abs(candidate.sideslip(found) - drive.truth["sideslip"])
        if candidate.scheduled:
            assert found.sideslip_sd is not None
            error /= np.maximum(found.sideslip_sd, 1e-9)
        scaled.append(error)
    return max(float(np.nanquantile(np.concatenate(scaled), 0.95)) / _NORMAL_95, 1e-3)


def _held_out(task: Task, found: Candidate, drives: Sequence[Drive]) -> list[Row]:
    """Residuals of what was not fitted, with the car as it was and as it was found."""
    rows = []
    for case, candidate in (("held out, before", task.candidate), ("held out, after", found)):
        errors = np.concatenate([scaled_errors(candidate, drive, task.signals) for drive in drives])
        rows.append(_residuals_row(case, float(np.sqrt(np.mean(errors**2)))))
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
