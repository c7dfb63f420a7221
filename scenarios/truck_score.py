"""Runs the estimators over the truck's drives and scores them by KBF Eq. (10)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from estimators.kalman_bucy import Estimate, KalmanBucy, KalmanBucySettings, detecting, matched
from estimators.kalman_bucy_ode import run_literal
from scenarios.truck import LOAD_STEPS, NOISE, SAMPLE_TIME, TruckCase, TruckDrive, make_drive
from twin.truck_parameters import TruckParameters

Array = NDArray[np.float64]
Estimator = Callable[[TruckCase, TruckDrive], Estimate]

PARAMETERS = ("mass", "Jxx", "Jyy")
VELOCITIES = ("vz", "roll_rate", "pitch_rate")
UNITS: dict[str, str] = dict(
    zip((*PARAMETERS, *VELOCITIES), ("kg", "kg m2", "kg m2", "m/s", "rad/s", "rad/s"), strict=True)
)
TABLE_2: dict[str, dict[str, float]] = {
    "rmse": dict(
        zip((*PARAMETERS, *VELOCITIES), (509.4, 566.7, 1829.5, 0.007, 0.014, 0.012), strict=True)
    ),
    "mape_pct": dict(
        zip((*PARAMETERS, *VELOCITIES), (4.18, 3.29, 3.51, 3.50, 1.21, 0.851), strict=True)
    ),
}
"""KBF, Table 2."""


HOLD = 0.1
"""How long an error has to stay below 10 % to count as settled [s]; chosen."""


class Row(NamedTuple):
    """One figure of a result table: the median and the 90th percentile over the seeds."""

    case: str
    quantity: str
    metric: str
    unit: str
    estimator: str
    seeds: int
    median: float
    p90: float
    paper: float | None
    limit: float | None


class Score(NamedTuple):
    """One figure of one drive."""

    quantity: str
    metric: str
    value: float


def filter_with(make: Callable[[TruckCase], KalmanBucySettings]) -> Estimator:
    """An estimator from what gives its settings for a case."""

    def run(case: TruckCase, drive: TruckDrive) -> Estimate:
        gravity = case.gravity if case.gravity_aware else 0.0
        observer = KalmanBucy(TruckParameters(), SAMPLE_TIME, make(case), gravity=gravity)
        return observer.run(drive.time, drive.deflections, drive.rates)

    return run


def matched_settings(case: TruckCase) -> KalmanBucySettings:
    """R from the sensors of the case."""
    noise = NOISE[case.noise]
    return matched(noise.sensors, SAMPLE_TIME, parameter_density=noise.parameter_density)


def literal(case: TruckCase, drive: TruckDrive) -> Estimate:
    """The filter as printed; the case tells it nothing."""
    del case
    settings = KalmanBucySettings(parametrisation="p")
    return run_literal(
        TruckParameters(), SAMPLE_TIME, settings, drive.time, drive.deflections, drive.rates
    )


ESTIMATORS: Mapping[str, Estimator] = {
    "kalman-bucy": filter_with(lambda case: KalmanBucySettings()),
    "kalman-bucy-matched": filter_with(matched_settings),
    "kalman-bucy-detecting": filter_with(lambda case: detecting(matched_settings(case))),
    "kalman-bucy-sharp": filter_with(lambda case: detecting(matched_settings(case), robust=False)),
    "kalman-bucy-p": filter_with(lambda case: replace(KalmanBucySettings(), parametrisation="p")),
    "kalman-bucy-log": filter_with(
        lambda case: replace(KalmanBucySettings(), parametrisation="log p")
    ),
    "kalman-bucy-literal": literal,
}


def score(drive: TruckDrive, estimate: Estimate) -> list[Score]:
    """RMSE and MAPE of KBF Eq. (10), and the time to 10 % after a load step.

    That time is how long after a load step the error falls below 10 % and stays there for
    `HOLD`, the longest over the steps; infinite where it never does. The percentage leaves out
    the sample at rest, whose true velocities are zero.
    """
    truth, found = drive.truth.parameters, estimate.parameters
    scores = []
    for quantities, true, own in (
        (PARAMETERS, truth, found),
        (VELOCITIES, drive.truth.rates, estimate.velocity),
    ):
        rmse = np.sqrt(np.mean((true - own) ** 2, axis=0))
        relative = np.abs(np.divide(true - own, true, out=np.zeros_like(own), where=true != 0))
        mape = 100 * relative.mean(axis=0)
        scores += [Score(q, "rmse", float(v)) for q, v in zip(quantities, rmse, strict=True)]
        scores += [Score(q, "mape_pct", float(v)) for q, v in zip(quantities, mape, strict=True)]
    wrong = np.abs(found / truth - 1) >= 0.1
    for i, quantity in enumerate(PARAMETERS):
        scores.append(Score(quantity, "time_to_10pct", _settling_time(wrong[:, i])))
    return scores


def _settling_time(wrong: NDArray[np.bool_]) -> float:
    """Longest time from a load step to the first `HOLD` seconds without a wrong sample [s]."""
    hold = round(HOLD / SAMPLE_TIME)
    starts = [round(start / SAMPLE_TIME) for start, _ in LOAD_STEPS]
    longest = 0.0
    for first, last in zip(starts, [*starts[1:], len(wrong)], strict=True):
        faults = np.concatenate([[0], np.cumsum(wrong[first:last])])
        settled = np.flatnonzero(faults[hold:] == faults[:-hold])
        longest = max(longest, settled[0] * SAMPLE_TIME if settled.size else np.inf)
    return float(longest)


def run_case(
    case: TruckCase,
    estimators: Mapping[str, Estimator],
    seeds: Sequence[int],
    *,
    jobs: int = 1,
) -> list[Row]:
    """Drives a case once per seed and scores every estimator on the same drives.

    Args:
        case: the drive.
        estimators: by name, e.g. some of `ESTIMATORS`.
        seeds: of the drives.
        jobs: threads; the simulation and the filters run without Python's lock.
    """

    def one(seed: int) -> dict[str, list[Score]]:
        drive = make_drive(case, seed)
        return {name: score(drive, run(case, drive)) for name, run in estimators.items()}

    parallel = Parallel(n_jobs=jobs, backend="threading")
    results: Any = parallel(delayed(one)(seed) for seed in seeds)
    of_paper = case.name in NOISE
    rows = []
    for name in estimators:
        for column in zip(*(result[name] for result in results), strict=True):
            rows.append(_row(case, name, column, of_paper))
    return rows


def _row(case: TruckCase, estimator: str, scores: Sequence[Score], of_paper: bool) -> Row:
    quantity, metric = scores[0].quantity, scores[0].metric
    values = np.array([s.value for s in scores])
    unit = {"mape_pct": "%", "time_to_10pct": "s"}.get(metric, UNITS[quantity])
    return Row(
        case=case.name,
        quantity=quantity,
        metric=metric,
        unit=unit,
        estimator=estimator,
        seeds=len(scores),
        median=float(np.median(values)),
        p90=float(np.quantile(values, 0.9, method="higher")),
        paper=TABLE_2.get(metric, {}).get(quantity) if of_paper else None,
        limit=None,
    )
