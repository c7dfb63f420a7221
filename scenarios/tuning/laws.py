"""Tunes the laws of a study of TiL Section 4.

The cost, the same for every study and estimator: the geometric mean, over parameters and over the
cases in which the twin is right in all else (noiseless, noisy sensors, noisy road), of the rms
error in percent, its mean over noise seeds that no result is reported on.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimators.til.law import ParameterLaw
from scenarios.cli.catalogue import Tuning
from scenarios.experiment.result import Result
from scenarios.experiment.study import CM, MASS, TWIN, Case, Study, find, runs, score
from scenarios.tuning import gains as gains_file
from scenarios.tuning.tune import Gain, Objective, search, tuning_rows, with_bounds
from twin import TwinError

SEEDS = tuple(range(1000, 1004))
WORST = 1000.0  # [%], what gains cost that do worse than this
LEAST = 0.1  # [%], better than this is as good


def gains_of(laws: Sequence[ParameterLaw]) -> tuple[Gain, ...]:
    """What is chosen of each law: bounds span the decades that make sense for its parameter."""
    found = []
    for law in laws:
        fields = {"gain": (1.0, 1e4)}
        if law.form != "sign":
            fields = {
                "noise_density": (1e-3, 1.0),
                "drift": (1e-4 * law.prior_sd, 1e-1 * law.prior_sd),
            }
        found += [
            Gain(name=f"{law.parameter} {field}", low=low, high=high, today=getattr(law, field))
            for field, (low, high) in fields.items()
        ]
    return tuple(found)


def with_gains(
    laws: Sequence[ParameterLaw], values: Mapping[str, float]
) -> tuple[ParameterLaw, ...]:
    """The laws with these gains, named as in `gains_of`."""
    changed = {law.parameter: law for law in laws}
    for name, value in values.items():
        parameter, field = name.split()
        changed[parameter] = replace(changed[parameter], **{field: value})
    return tuple(changed.values())


def cases_of(study: Study) -> list[Case]:
    """The cases in which the twin is right in all that is not estimated."""
    return [
        case
        for case in study.cases
        if set(MASS + CM) <= {*case.known, *study.parameters} and case.noise_on == "rates"
    ]


@dataclass(frozen=True, slots=True)
class Cost:
    """Geometric mean of the rms errors [%] of gains."""

    study: str
    estimator: str

    def __call__(self, values: Mapping[str, float]) -> float:
        """See the module.

        Raises:
            TwinError: the gains blow the twin up.
        """
        study = find(self.study)
        laws = with_gains(study.laws[self.estimator], values)
        todo = [
            run for run in runs(study, cases_of(study), SEEDS) if run.estimator == self.estimator
        ]
        by_case: dict[str, list[list[float]]] = {}
        for one in todo:
            errors = [min(error, WORST) for error, _ in score(one, laws)]
            by_case.setdefault(one.case.name, []).append(errors)
        means = [np.maximum(np.mean(found, axis=0), LEAST) for found in by_case.values()]
        return float(np.exp(np.mean(np.log(means))))


def run(study: Study, tuning: Tuning) -> Result:
    """Tunes one estimator of a study and writes the gains as TOML.

    Raises:
        TwinError: the study has no such estimator or cost, or bounds are wrong.
    """
    estimator = tuning.estimator
    if estimator not in study.laws:
        raise TwinError(f"tune: estimator is {estimator!r}; allowed: {', '.join(study.laws)}")
    if tuning.cost not in ("", "robust"):
        raise TwinError(f"tune: cost is {tuning.cost!r}; {study.name} allows: robust")
    start = time.perf_counter()
    objective = Objective(
        name=f"{study.name} {estimator}",
        gains=with_bounds(gains_of(study.laws[estimator]), tuning.bounds),
        cost=Cost(study.target, estimator),
        metric="geometric_mean_rms_pct",
        unit="%",
        worst=WORST,
    )
    tuned = search(objective, tuning.evaluations, tuning.jobs, tuning.journal)
    made = {"tuning": study.name, "metric": objective.metric, "seeds": list(SEEDS)}
    gains_file.write(tuning.path, vehicle=TWIN, estimator=estimator, tuned=tuned, made=made)
    return Result(
        name=f"tune {study.name}",
        settings={"estimator": estimator, "evaluations": tuned.evaluations, "seeds": list(SEEDS)},
        seconds=time.perf_counter() - start,
        rows=tuning_rows(objective, tuned, estimator),
    )
