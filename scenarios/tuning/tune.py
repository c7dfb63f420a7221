"""Chooses gains from data: TiL Algorithm 1.

Today's gains are tried first, then Sobol points, then expected improvement under a Gaussian process
of the cost's logarithm, over the decimal logarithms of the gains. Points are asked for in batches
of a fixed size, however many jobs there are: one batch hides its own costs from itself behind the
best cost so far (Ginsbourger's constant liar). Each batch goes to a journal; a tuning that was
interrupted reads it and goes on, to the same result as one that was not.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from scenarios.experiment.experiment import Gain
from scenarios.experiment.progress import bar, parallel
from scenarios.experiment.result import Row
from scenarios.tuning import journal
from scenarios.tuning.methods import method_of
from twin import TwinError

BATCH = 4
SOBOL = 12  # points before the first surrogate, today's among them
Point = tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective:
    """What is minimised.

    Attributes:
        name: of the tuning; a journal belongs to one.
        gains: that are chosen.
        cost: of the gains by their names; inf, NaN or a `TwinError` if they let the twin blow up.
            A worker can be sent it.
        metric, unit: of the cost.
        worst: what such gains cost; no finite cost counts for more.
        method: of `methods.METHODS`.
        first: points before the first surrogate, today's among them; at most 16.
    """

    name: str
    gains: tuple[Gain, ...]
    cost: Callable[[Mapping[str, float]], float]
    metric: str
    unit: str
    worst: float
    method: str = "bayes"
    first: int = SOBOL


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuned:
    """What a search found.

    Attributes:
        evaluated: the best point tried, gains by name.
        predicted: the point that the last surrogate has for best.
        cost: of the best point tried.
        evaluations: how many.
        points: of all of them, in order, gains by name.
        costs: (evaluations,) what they cost, at most the objective's worst.
    """

    evaluated: dict[str, float]
    predicted: dict[str, float]
    cost: float
    evaluations: int
    points: tuple[dict[str, float], ...] = ()
    costs: tuple[float, ...] = ()


def with_bounds(
    gains: Sequence[Gain], bounds: Mapping[str, tuple[float, float]]
) -> tuple[Gain, ...]:
    """The gains, some with other bounds.

    Raises:
        TwinError: a name that is none of them, or bounds that are reversed.
    """
    names = [gain.name for gain in gains]
    for name in bounds:
        if name not in names:
            raise TwinError(f"tune: has no gain {name!r}; allowed: {', '.join(names)}")
    return tuple(
        Gain(name=g.name, low=low, high=high, today=g.today)
        for g in gains
        for low, high in (bounds.get(g.name, (g.low, g.high)),)
    )


def search(objective: Objective, evaluations: int, jobs: int, path: Path) -> Tuned:
    """Searches, or goes on where the journal ends; at the end the journal is removed.

    Args:
        objective: what is minimised.
        evaluations: how many; rounded up to whole batches of `BATCH`.
        jobs: evaluations side by side.
        path: of the journal, see `scenarios.tuning.journal`.

    Raises:
        TwinError: the journal is damaged or belongs to another tuning.
    """
    batches = -(-evaluations // BATCH)
    header = _header(objective)
    done = journal.read(path, header, BATCH, objective.name)[:batches]
    points: list[Point] = []
    costs: list[float] = []
    cost = _Cost(objective.cost, tuple(gain.name for gain in objective.gains))
    with threadpool_limits(1), bar(f"tune {objective.name}", batches * BATCH) as shown:
        # five times quicker here than with two threads
        optimizer = method_of(objective.method, _box(objective), objective.first)
        first = _first_points(objective)
        for k in range(batches):
            asked = first[BATCH * k : BATCH * (k + 1)] or optimizer.ask(BATCH, strategy="cl_min")
            batch = [tuple(float(x) for x in point) for point in asked]
            if k < len(done):
                found = done[k]
            else:
                found = parallel(cost, batch, jobs, "")
                journal.append(path, header, found)
            bounded = [min(x, objective.worst) for x in found]
            optimizer.tell([list(p) for p in batch], [math.log(x) for x in bounded])
            points += batch
            costs += bounded
            shown.set_postfix(best=f"{min(costs):.4g}", refresh=False)
            shown.update(BATCH)
        predicted = _predicted_best(optimizer, points, costs)
    path.unlink(missing_ok=True)
    best = points[int(np.argmin(costs))]
    return Tuned(
        evaluated=_named(objective, best),
        predicted=_named(objective, predicted),
        cost=min(costs),
        evaluations=len(points),
        points=tuple(_named(objective, point) for point in points),
        costs=tuple(costs),
    )


@dataclass(frozen=True, slots=True)
class _Cost:
    """The cost of a point; a worker can be sent it."""

    of: Callable[[Mapping[str, float]], float]
    names: tuple[str, ...]

    def __call__(self, point: Point) -> float:
        """Infinite where the gains blow the twin up."""
        gains = {name: 10.0**x for name, x in zip(self.names, point, strict=True)}
        try:
            found = float(self.of(gains))
        except TwinError:
            return math.inf
        return math.inf if math.isnan(found) else found


def _named(objective: Objective, point: Sequence[float]) -> dict[str, float]:
    return {g.name: float(10.0**x) for g, x in zip(objective.gains, point, strict=True)}


def _box(objective: Objective) -> list[tuple[float, float]]:
    return [(math.log10(gain.low), math.log10(gain.high)) for gain in objective.gains]


def _first_points(objective: Objective) -> list[Point]:
    """Today's gains and Sobol points, log10."""
    from scipy.stats import qmc

    box = _box(objective)
    today = tuple(
        min(max(math.log10(gain.today), low), high)
        for gain, (low, high) in zip(objective.gains, box, strict=True)
    )
    # 2^4 of them, as Sobol wants a power of two; what is too many is left
    sobol = qmc.Sobol(len(box), seed=0)  # pyright: ignore[reportCallIssue]  # rng from scipy 1.15
    spread = qmc.scale(sobol.random_base2(4), *np.transpose(box))
    return [today, *(tuple(point) for point in spread[: objective.first - 1].tolist())]


def _predicted_best(
    optimizer: Any, points: Sequence[Point], costs: Sequence[float]
) -> Sequence[float]:
    """The point at which the last surrogate is lowest, of many in the box."""
    if not optimizer.models:
        return points[int(np.argmin(costs))]
    space = optimizer.space
    candidates = [*space.rvs(4096, random_state=1), *map(list, points)]
    values = optimizer.models[-1].predict(space.transform(candidates))
    return candidates[int(np.argmin(values))]


def _header(objective: Objective) -> dict[str, Any]:
    """What a journal has to agree in."""
    bounds = {gain.name: [gain.low, gain.high, gain.today] for gain in objective.gains}
    header = {"tuning": objective.name, "metric": objective.metric, "bounds": bounds}
    # what began before there were others goes on
    return header | ({} if objective.method == "bayes" else {"method": objective.method})


def tuning_rows(objective: Objective, tuned: Tuned, estimator: str) -> list[Row]:
    """Both points, and the cost of the evaluated one."""
    rows = [
        Row.over_seeds(
            [value], case=f"best {which}", quantity=name, metric="gain", unit="1",
            estimator=estimator,
        )
        for which, point in (("evaluated", tuned.evaluated), ("predicted", tuned.predicted))
        for name, value in point.items()
    ]  # fmt: skip
    rows.append(
        Row.over_seeds(
            [tuned.cost], case="best evaluated", quantity="cost", metric=objective.metric,
            unit=objective.unit, estimator=estimator,
        )
    )  # fmt: skip
    return rows
