"""Runs the estimators over the truck's drives and scores them by KBF Eq. (10)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimators.base import Estimate
from scenarios.experiment.progress import parallel
from scenarios.experiment.result import Row
from scenarios.papers.truck_drive import LOAD_STEPS, NOISE, SAMPLE_TIME, TruckCase, make_drive
from scenarios.papers.truck_estimators import Estimator
from twin import Drive
from twin.truck.model import RATES
from twin.truck.twin import TRUCK_PARAMETERS

UNITS: dict[str, str] = dict(
    zip(
        (*TRUCK_PARAMETERS, *RATES),
        ("kg", "kg m2", "kg m2", "m/s", "rad/s", "rad/s"),
        strict=True,
    )
)
PAPER: dict[tuple[str, str], float] = {
    ("mass", "rmse"): 509.4,
    ("Jxx", "rmse"): 566.7,
    ("Jyy", "rmse"): 1829.5,
    ("vz", "rmse"): 0.007,
    ("roll_rate", "rmse"): 0.014,
    ("pitch_rate", "rmse"): 0.012,
    ("mass", "mape_pct"): 4.18,
    ("Jxx", "mape_pct"): 3.29,
    ("Jyy", "mape_pct"): 3.51,
    ("vz", "mape_pct"): 3.50,
    ("roll_rate", "mape_pct"): 1.21,
    ("pitch_rate", "mape_pct"): 0.851,
    **{(name, "time_to_10pct"): 0.5 for name in TRUCK_PARAMETERS},
}
"""KBF, Table 2, by quantity and metric; the times are those of its conclusions."""

HOLD = 0.1
"""How long an error has to stay below 10 % to count as settled [s]; chosen."""


Scores = dict[tuple[str, str], float]
"""Figures of one drive by quantity and metric."""


@dataclass(frozen=True)
class Run:
    """Estimators over one drive."""

    case: TruckCase
    seed: int
    estimators: Mapping[str, Estimator]


def absolute(estimate: Estimate) -> NDArray[np.float64]:
    """Mass [kg], roll and pitch inertia [kg m2]. Shape (3, n)."""
    return np.array([estimate.absolute(name) for name in TRUCK_PARAMETERS])


def score(drive: Drive, estimate: Estimate) -> Scores:
    """RMSE and MAPE of KBF Eq. (10), and the time to 10 % after a load step.

    That time is the longest over the steps, as in `settling_times`; NaN for a drive without any.
    The percentage leaves out the sample at rest, whose true velocities are zero.
    """
    scores: Scores = {}
    columns = np.vstack([absolute(estimate), estimate.outputs.T])
    for name, own in zip(UNITS, columns, strict=True):
        true = drive.truth[name]
        relative = np.divide(true - own, true, out=np.zeros_like(own), where=true != 0)
        scores[name, "mape_pct"] = float(100 * np.abs(relative).mean())
        scores[name, "rmse"] = float(np.sqrt(np.mean((true - own) ** 2)))
    for name, own in zip(TRUCK_PARAMETERS, absolute(estimate), strict=True):
        times = settling_times(drive, name, own)[1:]
        scores[name, "time_to_10pct"] = max(times, default=np.nan)
    return scores


def settling_times(drive: Drive, name: str, found: NDArray[np.float64]) -> list[float]:
    """How long after the start and each load step the error falls below 10 % [s].

    It has to stay there for `HOLD`; infinite where it never does before the next step.

    Args:
        drive: with its truth.
        name: of the parameter.
        found: its estimate. Shape (n,).
    """
    wrong = np.abs(found / drive.truth[name] - 1) >= 0.1
    hold = round(HOLD / SAMPLE_TIME)
    steps = (round(start / SAMPLE_TIME) for start, _ in LOAD_STEPS)
    starts = [0, *(step for step in steps if step < wrong.size)]
    times = []
    for first, last in zip(starts, [*starts[1:], wrong.size], strict=True):
        faults = np.concatenate([[0], np.cumsum(wrong[first:last])])
        settled = np.flatnonzero(faults[hold:] == faults[:-hold])
        times.append(float(settled[0] * SAMPLE_TIME if settled.size else np.inf))
    return times


def run_cases(
    cases: Sequence[TruckCase],
    estimators: Mapping[str, Estimator],
    seeds: Sequence[int],
    *,
    jobs: int = 1,
    quantities: Sequence[str] = TRUCK_PARAMETERS,
    metrics: Sequence[str] = ("mape_pct", "rmse", "time_to_10pct"),
) -> list[Row]:
    """Drives each case once per seed and scores every estimator on the same drives.

    Args:
        cases: the drives.
        estimators: by name, e.g. some of `ESTIMATORS`.
        seeds: of the drives.
        jobs: processes.
        quantities: rows to give, of `UNITS`.
        metrics: rows to give, of `score`.
    """
    runs = [Run(case, seed, estimators) for case in cases for seed in seeds]
    scored = parallel(_score_run, runs, jobs, "truck")
    rows = []
    for i, case in enumerate(cases):
        of_case = scored[i * len(seeds) : (i + 1) * len(seeds)]
        rows += [
            _row(case, name, quantity, metric, [each[name][quantity, metric] for each in of_case])
            for name in estimators
            for metric in metrics
            for quantity in quantities
            if (quantity, metric) in of_case[0][name]
        ]
    return rows


def _score_run(run: Run) -> dict[str, Scores]:
    drive = make_drive(run.case, run.seed)
    return {name: score(drive, found(run.case, drive)) for name, found in run.estimators.items()}


def _row(
    case: TruckCase, estimator: str, quantity: str, metric: str, values: Sequence[float]
) -> Row:
    return Row.over_seeds(
        values,
        case=case.name,
        quantity=quantity,
        metric=metric,
        unit={"mape_pct": "%", "time_to_10pct": "s"}.get(metric, UNITS[quantity]),
        estimator=estimator,
        paper=PAPER.get((quantity, metric)) if case.name in NOISE else None,
    )
