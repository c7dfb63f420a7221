"""Tunes an estimator of an experiment, on noise that no result is reported on: `til tune`."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from scenarios.experiment import gains_file
from scenarios.experiment.engine import recipe, score
from scenarios.experiment.experiment import Experiment, Run
from scenarios.experiment.result import Result
from scenarios.tuning.tune import Objective, search, tuning_rows, with_bounds
from twin import TwinError


@dataclass(frozen=True, slots=True)
class RunCost:
    """A cost of an experiment, of the gains of an estimator by name."""

    experiment: Experiment
    estimator: str
    cost: str

    def __call__(self, values: Mapping[str, float]) -> float:
        """The cost.

        Raises:
            TwinError: the gains blow the estimator up.
        """
        cost = self.experiment.costs[self.cost]
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

    Raises:
        TwinError: nothing to tune, no such estimator or cost, or bounds are wrong.
    """
    start = time.perf_counter()
    if experiment.calibrate:
        if bounds or cost:
            raise TwinError(
                f"tune: {experiment.name} takes no --bounds and no --cost; allowed: neither"
            )
        return experiment.calibrate(estimator, path, jobs=jobs, evaluations=evaluations)
    tunable = [name for name, own in experiment.estimators.items() if own.tunable]
    if not tunable or not experiment.costs:
        raise TwinError(f"tune: {experiment.name} has no gains to choose")
    if estimator not in tunable:
        raise TwinError(f"tune: estimator is {estimator!r}; allowed: {', '.join(tunable)}")
    name = cost or next(iter(experiment.costs))
    if name not in experiment.costs:
        raise TwinError(f"tune: cost is {cost!r}; allowed: {', '.join(experiment.costs)}")
    chosen, case = experiment.costs[name], experiment.cases[0]
    gains_of = recipe(Run(experiment=experiment, case=case, estimator=estimator)).tunable
    assert gains_of is not None
    objective = Objective(
        name=f"{experiment.name} {estimator}",
        gains=with_bounds(gains_of(case.twin), bounds or {}),
        cost=RunCost(experiment, estimator, name),
        metric=chosen.metric,
        unit="1",
        worst=chosen.worst,
    )
    tuned = search(objective, evaluations, jobs, path.with_suffix(".journal"))
    made = {
        "tuning": f"til tune {experiment.name}",
        "metric": chosen.metric,
        **chosen.made,
        "bounds": {gain.name: [gain.low, gain.high] for gain in objective.gains},
        "evaluations": tuned.evaluations,
        "cost": tuned.cost,
    }
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
        rows=tuning_rows(objective, tuned, estimator),
    )
