"""Tunes an estimator of an experiment, on noise that no result is reported on: `til tune`."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenarios.experiment import gains_file
from scenarios.experiment.engine import recipe, score
from scenarios.experiment.experiment import Experiment, Run
from scenarios.experiment.result import Result, Row
from scenarios.tuning.tune import Objective, search, tuning_rows, with_bounds
from twin import TwinError


@dataclass(frozen=True, slots=True)
class RunCost:
    """A cost of an experiment, of the gains of an estimator by name."""

    experiment: Experiment
    estimator: str
    cost: str
    on: tuple[str, ...] = ()

    def __call__(self, values: Mapping[str, float]) -> float:
        """The cost.

        Raises:
            TwinError: the gains blow the estimator up.
        """
        cost = self.experiment.costs[self.cost]
        if self.on and cost.on:
            cost = cost.on(self.on)
        runs = cost.runs(self.experiment, self.estimator, tuple(values.items()))
        return cost.of([score(run)[0] for run in runs], runs)


def tune(
    experiment: Experiment,
    estimator: str,
    path: Path,
    *,
    evaluations: int,
    jobs: int = 1,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    cost: str = "",
    on: Sequence[str] = (),
    held_out: Sequence[str] = (),
    method: str = "bayes",
) -> Result:
    """Chooses gains and writes them as TOML; a journal beside lets an interrupted search go on.

    Args:
        experiment: whose estimator.
        estimator: a label of its estimators.
        path: of the file.
        evaluations: points to try.
        jobs: evaluations side by side.
        bounds: of gains by name, instead of the estimator's own.
        cost: by name; empty: the experiment's first.
        on: real vehicles and drives that are tuned on, by name; none: the cost's own.
        held_out: those that the gains are reported on besides; none: the cost's own.
        method: of the search.

    Raises:
        TwinError: nothing to tune, no such estimator or cost, or bounds are wrong.
    """
    start = time.perf_counter()
    tunable = [name for name, own in experiment.estimators.items() if own.tunable]
    if not tunable or not experiment.costs:
        raise TwinError(f"tune: {experiment.name} has no gains to choose")
    if estimator not in tunable:
        raise TwinError(f"tune: estimator is {estimator!r}; allowed: {', '.join(tunable)}")
    name = cost or next(iter(experiment.costs))
    if name not in experiment.costs:
        raise TwinError(f"tune: cost is {cost!r}; allowed: {', '.join(experiment.costs)}")
    chosen = experiment.costs[name]
    if chosen.on is None and (on or held_out):
        raise TwinError(
            f"tune: {experiment.name} has one real vehicle and drive; allowed: neither --on nor "
            "--hold-out"
        )
    if chosen.on and on:
        chosen = chosen.on(on)
    case = chosen.runs(experiment, estimator, ())[0].case
    others = tuple(held_out) or chosen.held_out
    both = sorted(set(others) & set(chosen.made.get("tuned_on", ())))
    if both:
        raise TwinError(f"tune: {both[0]} is tuned on and held out; allowed: one of them")
    if chosen.on and others:
        chosen.on(others)  # a wrong name is told before the search
    gains_of = recipe(Run(experiment=experiment, case=case, estimator=estimator)).tunable
    assert gains_of is not None
    objective = Objective(
        name=f"{experiment.name} {estimator}",
        gains=with_bounds(gains_of(case.twin), bounds or {}),
        cost=RunCost(experiment, estimator, name, tuple(on)),
        metric=chosen.metric,
        unit="1",
        worst=chosen.worst,
        method=method,
    )
    tuned = search(objective, evaluations, jobs, path.with_suffix(".journal"))
    made = {
        "tuning": f"til tune {experiment.name}",
        "metric": chosen.metric,
        **chosen.made,
        "bounds": {gain.name: [gain.low, gain.high] for gain in objective.gains},
        "evaluations": tuned.evaluations,
        "cost": tuned.cost,
        "method": method,
        "best_after": best_after(tuned.costs),
        "at_bounds": _at_bounds(objective, tuned.evaluated),
    }
    checked: dict[str, float] = {}
    today = {gain.name: gain.today for gain in objective.gains}
    before: dict[str, float] = {}
    for other in others if chosen.on else ():
        cost_there = RunCost(experiment, estimator, name, (other,))
        checked[other], before[other] = cost_there(tuned.evaluated), cost_there(today)
    if checked:
        made["held_out"] = {key: _rounded(value) for key, value in checked.items()}
        made["held_out_before"] = {key: _rounded(value) for key, value in before.items()}
    gains_file.write(
        path,
        vehicle=case.twin,
        estimator=estimator,
        gains=tuned.evaluated,
        predicted=tuned.predicted,
        made=made,
    )
    return Result(
        name=f"tune {experiment.name}",
        settings={"estimator": estimator, **made},
        seconds=time.perf_counter() - start,
        rows=[*tuning_rows(objective, tuned, estimator), *_held_out(checked, objective, estimator)],
    )


def best_after(costs: Sequence[float]) -> dict[str, float]:
    """The lowest cost after so many evaluations, where it fell: the search's convergence."""
    found: dict[str, float] = {}
    best = float("inf")
    for count, cost in enumerate(costs, 1):
        if cost < best:
            best = cost
            found[str(count)] = _rounded(cost)
    return found


def _rounded(value: float) -> float:
    return float(f"{value:.5g}")


def _at_bounds(objective: Objective, gains: Mapping[str, float]) -> list[str]:
    """Gains that lie on a bound, which is then what was chosen."""
    return [
        gain.name
        for gain in objective.gains
        if min(gains[gain.name] / gain.low, gain.high / gains[gain.name]) < 1.0 + 1e-6
    ]


def _held_out(checked: Mapping[str, float], objective: Objective, estimator: str) -> list[Row]:
    return [
        Row.over_seeds(
            [value], case=f"held out, {name}", quantity="cost", metric=objective.metric,
            unit=objective.unit, estimator=estimator,
        )
        for name, value in checked.items()
    ]  # fmt: skip
