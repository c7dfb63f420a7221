"""Chooses the gains of a study's laws from data: TiL Algorithm 1.

The rule, the same for every study and estimator: gains minimise the geometric mean, over parameters
and over the cases in which the twin is right in all else (noiseless, noisy sensors, noisy road), of
the rms error in percent, its mean over noise seeds that no result is reported on. Today's gains are
tried first, then Sobol points, then expected improvement under a Gaussian process, over the decimal
logarithm of the gains.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimators.law import ParameterLaw
from scenarios.progress import parallel, progress
from scenarios.result import Result, Row, replacing, versions
from scenarios.study import CM, MASS, Case, Run, Study, runs, score
from twin import TwinError

SEEDS = tuple(range(1000, 1004))
SOBOL = 8
WORST = 1000.0  # [%], what gains cost that blow the twin up or do worse than this
LEAST = 0.1  # [%], better than this is as good


@dataclass(frozen=True, slots=True)
class Gain:
    """One number that is chosen.

    Attributes:
        law: index in the estimator's laws.
        field: of `ParameterLaw`.
        low, high: bounds.
    """

    law: int
    field: str
    low: float
    high: float


def gains_of(laws: Sequence[ParameterLaw]) -> list[Gain]:
    """What is chosen of each law: bounds span the decades that make sense for its parameter."""
    found = []
    for k, law in enumerate(laws):
        if law.form == "sign":
            found.append(Gain(k, "gain", 1.0, 1e4))
        else:
            found.append(Gain(k, "noise_density", 1e-3, 1.0))
            found.append(Gain(k, "drift", 1e-4 * law.prior_sd, 1e-1 * law.prior_sd))
    return found


def with_gains(
    laws: Sequence[ParameterLaw], gains: Sequence[Gain], values: Sequence[float]
) -> tuple[ParameterLaw, ...]:
    """The laws with these gains."""
    changed = list(laws)
    for gain, value in zip(gains, values, strict=True):
        changed[gain.law] = replace(changed[gain.law], **{gain.field: value})
    return tuple(changed)


def cases_of(study: Study) -> list[Case]:
    """The cases in which the twin is right in all that is not estimated."""
    return [
        case
        for case in study.cases
        if set(MASS + CM) <= {*case.known, *study.parameters} and case.noise_on == "rates"
    ]


def run(study: Study, estimator: str, evaluations: int, jobs: int, path: Path) -> Result:
    """Tunes one estimator of a study and writes the gains as TOML.

    Raises:
        TwinError: the study has no such estimator.
    """
    if estimator not in study.laws:
        raise TwinError(f"tune: estimator is {estimator!r}; allowed: {', '.join(study.laws)}")
    start = time.perf_counter()
    laws = study.laws[estimator]
    gains = gains_of(laws)
    points, costs, predicted = _search(study, estimator, gains, evaluations, jobs)
    best = points[int(np.argmin(costs))]
    _write(path, study, estimator, gains, {"evaluated": best, "predicted": predicted}, min(costs))
    rows = [
        Row.over_seeds(
            [10.0 ** point[i]],
            case=f"best {which}",
            quantity=f"{laws[gain.law].parameter} {gain.field}",
            metric="gain",
            unit="1",
            estimator=estimator,
        )
        for which, point in (("evaluated", best), ("predicted", predicted))
        for i, gain in enumerate(gains)
    ]
    rows.append(
        Row.over_seeds(
            [min(costs)], case="best evaluated", quantity="cost", metric="geometric_mean_rms_pct",
            unit="%",
            estimator=estimator,
        )
    )  # fmt: skip
    return Result(
        name=f"tune {study.name}",
        settings={"estimator": estimator, "evaluations": evaluations, "seeds": list(SEEDS)},
        seconds=time.perf_counter() - start,
        rows=rows,
    )


def _search(
    study: Study, estimator: str, gains: Sequence[Gain], evaluations: int, jobs: int
) -> tuple[list[list[float]], list[float], list[float]]:
    """Points tried, log10 of the gains; their costs; and the point predicted best."""
    from skopt import Optimizer
    from threadpoolctl import threadpool_limits

    bounds = [(float(np.log10(gain.low)), float(np.log10(gain.high))) for gain in gains]
    with threadpool_limits(1):  # five times quicker here than with two threads
        optimizer = Optimizer(
            bounds,
            base_estimator="GP",
            n_initial_points=min(SOBOL, evaluations),
            initial_point_generator="sobol",
            acq_func="EI",
            random_state=0,
        )
        laws = study.laws[estimator]
        today = [float(np.log10(getattr(laws[gain.law], gain.field))) for gain in gains]
        for k in progress(range(evaluations), f"tune {study.name}", evaluations):
            point: Any = optimizer.ask() if k else today
            optimizer.tell(point, _cost(study, estimator, gains, point, jobs))
        predicted = _predicted_best(optimizer)
    return optimizer.Xi, optimizer.yi, predicted


def _predicted_best(optimizer: Any) -> list[float]:
    """The point at which the last surrogate is lowest, of many in the box."""
    if not optimizer.models:
        return optimizer.Xi[int(np.argmin(optimizer.yi))]
    space = optimizer.space
    candidates = [*space.rvs(4096, random_state=1), *optimizer.Xi]
    values = optimizer.models[-1].predict(space.transform(candidates))
    return candidates[int(np.argmin(values))]


def _cost(
    study: Study, estimator: str, gains: Sequence[Gain], point: Sequence[float], jobs: int
) -> float:
    """Geometric mean of the rms errors [%] of these gains."""
    laws = with_gains(study.laws[estimator], gains, [10.0**x for x in point])
    todo = [run for run in runs(study, cases_of(study), SEEDS) if run.estimator == estimator]
    errors = parallel(_Scored(laws), todo, jobs, "seeds")
    by_case: dict[str, list[NDArray[np.float64]]] = {}
    for one, error in zip(todo, errors, strict=True):
        by_case.setdefault(one.case.name, []).append(error)
    means = [np.maximum(np.mean(found, axis=0), LEAST) for found in by_case.values()]
    return float(np.exp(np.mean(np.log(means))))


@dataclass(frozen=True, slots=True)
class _Scored:
    """Scores runs with the same laws; a worker can be sent it."""

    laws: tuple[ParameterLaw, ...]

    def __call__(self, one: Run) -> NDArray[np.float64]:
        """Rms errors [%] of the parameters."""
        try:
            errors = np.array(score(one, self.laws))[:, 0]
        except TwinError:  # the gains blow the twin up
            return np.full(len(self.laws), WORST)
        return np.minimum(errors, WORST)


def _write(
    path: Path,
    study: Study,
    estimator: str,
    gains: Sequence[Gain],
    points: dict[str, Sequence[float]],
    cost: float,
) -> None:
    import tomli_w

    laws = study.laws[estimator]
    content: dict[str, Any] = {
        "study": study.name,
        "estimator": estimator,
        "seeds": list(SEEDS),
        "geometric_mean_rms_pct": float(cost),
        "versions": versions(),
    }
    for which, point in points.items():
        chosen: dict[str, dict[str, float]] = {}
        for gain, x in zip(gains, point, strict=True):
            chosen.setdefault(laws[gain.law].parameter, {})[gain.field] = float(10.0**x)
        content[which] = chosen
    with replacing(path) as partial:
        partial.write_bytes(tomli_w.dumps(content).encode())
