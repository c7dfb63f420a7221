"""One or two load parameters at a time, all else known or not: the experiments of TiL Section 4.

The real vehicle is the twin's own model with Table 2's loads on board, as in the paper: an inverse
crime but for load, noise and what a case says the twin does not know.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np

from estimators.til.law import ParameterLaw
from scenarios.driving.record import Manoeuvre
from scenarios.experiment.bounds import law_limit, percent, sensitivities_at
from scenarios.experiment.experiment import CM, INFINITE, MASS, Case, Cost, Experiment, Run, Score
from scenarios.experiment.laws import recipes
from scenarios.experiment.metrics import parameter_errors
from scenarios.experiment.plants import SimulatedCar
from twin import noise_sd

TWIN, REAL = "suv", "suv_loaded"
SEEDS = tuple(range(1000, 1004))  # of tuning; no result is reported on them
WORST = 1000.0  # [%], what gains cost that do worse than this
LEAST = 0.1  # [%], better than this is as good


def row(
    manoeuvre: Callable[..., Manoeuvre],
    name: str,
    snr: float,
    paper: Mapping[str, float] | None = None,
    knows: tuple[str, ...] = MASS + CM,
    **noise,
) -> Case:
    """A row of the paper's table.

    Args:
        manoeuvre: what is driven.
        name: in the words of the paper.
        snr: of the sensors [dB].
        paper: the paper's rms error [%] by parameter.
        knows: parameters of the load that the twin is told.
        noise: `noise_on` and `road_noise` of the case.
    """
    figures = {(parameter, "rms_pct"): value for parameter, value in (paper or {}).items()}
    plant = SimulatedCar(car=REAL, manoeuvre=manoeuvre)
    return Case(name=name, plant=plant, twin=TWIN, snr=snr, knows=knows, paper=figures, **noise)


def experiment(
    name: str,
    laws: tuple[ParameterLaw, ...],
    paper: tuple[ParameterLaw, ...],
    table: tuple[Case, ...],
    driven: str,
) -> Experiment:
    """Laws that estimate the same parameters, over the cases of a table of the paper.

    Args:
        name: as `til run` takes it.
        laws: our defaults.
        paper: the paper's.
        table: all cases.
        driven: name of the case that `til run` drives.
    """
    return Experiment(
        name=name,
        cases=tuple(case for case in table if case.name == driven),
        table=table,
        estimators=recipes(laws, paper),
        quantities=tuple(law.parameter for law in laws),
        metrics=parameter_errors,
        limit=limit,
        costs={"robust": COST},
    )


def is_right_otherwise(experiment: Experiment, case: Case) -> bool:
    """Whether a twin is right in all that is not estimated, with white noise on its sensors."""
    told = {*case.knows, *experiment.quantities}
    return set(MASS + CM) <= told and case.noise_on == "rates"


def limit(
    experiment: Experiment, case: Case, duration: float | None
) -> Mapping[tuple[str, str], float]:
    """The bound on the rms errors over seeds of laws on the signals that ours use [%].

    None where it says nothing: without noise, with noise that is not white on a sensor, and for a
    twin that is wrong in what it does not estimate.
    """
    right = is_right_otherwise(experiment, case)
    if case.snr == INFINITE or case.road_noise > 0.0 or not right:
        return {}
    drive = case.plant.clean(duration)  # pyright: ignore[reportAttributeAccessIssue]
    sd = noise_sd(drive.measurements, case.snr, drive.output_names)
    load = case.load()
    return {
        (law.parameter, "rms_pct"): percent(
            law_limit(law, _sensitivity(case.plant, case.twin, duration, law.parameter), drive, sd),
            load[law.parameter],
        )
        for law in experiment.estimators["til"].laws
    }


@cache
def _sensitivity(plant: SimulatedCar, twin: str, duration: float | None, name: str) -> np.ndarray:
    case = Case(name=name, plant=plant, twin=twin)
    return sensitivities_at(case, plant.clean(duration), [name])


def _runs(
    experiment: Experiment, estimator: str, gains: tuple[tuple[str, float], ...]
) -> list[Run]:
    """The cases in which the twin is right in all that is not estimated, over the seeds."""
    return [
        Run(experiment=experiment, case=case, estimator=estimator, seed=seed, gains=gains)
        for case in experiment.table
        if is_right_otherwise(experiment, case)
        for seed in (SEEDS if case.is_random else SEEDS[:1])
    ]


def _geometric_mean(scored: Sequence[Sequence[Score]], runs: Sequence[Run]) -> float:
    """Over parameters and cases, of the rms error in percent, its mean over the seeds."""
    by_case: dict[str, list[list[float]]] = {}
    for run, scores in zip(runs, scored, strict=True):
        errors = [min(score.value, WORST) for score in scores if score.metric == "rms_pct"]
        by_case.setdefault(run.case.name, []).append(errors)
    means = [np.maximum(np.mean(found, axis=0), LEAST) for found in by_case.values()]
    return float(np.exp(np.mean(np.log(means))))


COST = Cost(
    runs=_runs,
    of=_geometric_mean,
    metric="geometric_mean_rms_pct",
    worst=WORST,
    made={"seeds": list(SEEDS)},
)
