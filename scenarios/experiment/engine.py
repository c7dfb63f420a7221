"""Runs experiments: one way from a seed to a noisy drive, from a drive to scores, to rows."""

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from estimators.entry import Given
from estimators.registry import ESTIMATORS, make
from scenarios.experiment.experiment import (
    CarPlant,
    Case,
    Experiment,
    Recipe,
    Run,
    Score,
    Trial,
)
from scenarios.experiment.laws import with_gains
from scenarios.experiment.progress import parallel
from scenarios.experiment.recipes import recipe_of
from scenarios.experiment.result import Result, Row
from twin import Drive, TwinError, Vehicle


def recipe(run: Run) -> Recipe:
    """What the experiment or, for another estimator of the registry, its car's recipe says.

    Raises:
        TwinError: no such estimator.
    """
    known = run.experiment.estimators
    if run.estimator in known:
        return known[run.estimator]
    if run.estimator not in ESTIMATORS:
        allowed = ", ".join(dict.fromkeys((*known, *ESTIMATORS)))
        raise TwinError(
            f"{run.experiment.name}: estimator is {run.estimator!r}; allowed: {allowed}"
        )
    return recipe_of(run.estimator, run.case.twin)


def given(run: Run, drive: Drive) -> Given:
    """What the estimator of a run is given."""
    own = recipe(run)
    car = Vehicle.load(run.case.twin) if run.case.twin else None
    plain = Given(
        vehicle=car,
        noise_sd=drive.settings.get("noise_sd", {}),
        dt=drive.dt,
        laws=with_gains(own.laws, dict(run.gains or ())) if own.laws else (),
    )
    return own.complete(run, drive, plain) if own.complete else plain


def observe(run: Run) -> Trial:
    """Drives with the noise of the run's seed and estimates.

    Raises:
        TwinError: the estimator lacks something, or has blown up.
    """
    return estimate_on(run, run.case.noisy_drive(run.seed, run.duration))


def estimate_on(run: Run, drive: Drive) -> Trial:
    """The run's estimator over a drive.

    Raises:
        TwinError: as `observe`.
    """
    own = recipe(run)
    if own.make:
        estimator = own.make(run, drive)
    else:
        _check_channels(run, ESTIMATORS[own.estimator].channels, drive)
        estimator = make(own.estimator, given(run, drive))
    told = run.case.told(run.experiment.quantities)
    estimator.reset(_first_speed(drive), told, _first_road(run, drive))
    return Trial(run, drive, estimator.run(_shown(drive, own.channels)))


def _check_channels(run: Run, needed: Sequence[str], drive: Drive) -> None:
    lacking = [name for name in needed if name not in drive.output_names]
    if lacking:
        raise TwinError(
            f"{run.experiment.name}: has no measurement of {', '.join(lacking)}, "
            f"which {run.estimator} needs"
        )


def _shown(drive: Drive, channels: Sequence[str]) -> Drive:
    """The drive with some of its measurements."""
    if not channels:
        return drive
    measurements = np.column_stack([drive.channel(name) for name in channels])
    return drive.replace(measurements=measurements, output_names=tuple(channels))


def _first_speed(drive: Drive) -> float:
    """At the start [m/s]; a vehicle whose speed is no channel stands."""
    if "vx" in drive.output_names:
        return float(drive.channel("vx")[0])
    return float(drive.truth["vx"][0]) if "vx" in drive.truth else 0.0


def _first_road(run: Run, drive: Drive) -> np.ndarray | None:
    """(4,) heights under the wheels at the start, of a simulated car."""
    if not isinstance(run.case.plant, CarPlant):
        return None
    return drive.inputs[0, [n.startswith("road_height") for n in drive.input_names]]


def score(run: Run) -> tuple[list[Score], tuple[str, ...]]:
    """The figures of a run, and sentences about it."""
    trial = observe(run)
    notes = run.experiment.notes
    return run.experiment.metrics(trial), notes(trial) if notes else ()


def first_trials(
    experiment: Experiment,
    seed: int,
    *,
    snr: float | None = None,
    duration: float | None = None,
    estimators: Sequence[str] = (),
    gains: tuple[tuple[str, float], ...] | None = None,
    shown: Sequence[str] | None = None,
) -> list[Trial]:
    """One seed of the first case, of the estimators named.

    Args:
        experiment: which.
        seed: of the noise.
        snr: of the sensors [dB]; None: that of the case.
        duration: of the drive [s]; None: all of it.
        estimators: whose trials.
        gains: of the first of them.
        shown: estimators, unless some are named; by default the first of the experiment.
    """
    names = estimators or shown or tuple(experiment.estimators)[:1]
    case = experiment.at(snr)[0]
    return [
        observe(
            Run(
                experiment=experiment,
                case=case,
                estimator=name,
                seed=seed,
                duration=duration,
                gains=gains if name == names[0] else None,
            )
        )
        for name in names
    ]


def draw(experiment: Experiment, path: Path, *, seed: int, **settings: Any) -> None:
    """Draws the picture of an experiment, whole or not at all.

    Raises:
        TwinError: it has none.
    """
    if experiment.study and experiment.study.picture:
        experiment.study.picture(path, int(settings.get("jobs", 1)))
        return
    if experiment.picture is None:
        raise TwinError(f"{experiment.name}: draws no picture; allowed: --png with ferrari or i3")
    shown = tuple(experiment.estimators)
    experiment.picture(first_trials(experiment, seed, shown=shown, **settings), path)


_DONE: dict[Run, tuple[list[Score], tuple[str, ...]]] = {}  # tables and figures share many runs


def scores(todo: Sequence[Run], jobs: int, label: str) -> list[list[Score]]:
    """The figures of each run, in parallel; none is made twice."""
    missing = [run for run in dict.fromkeys(todo) if run not in _DONE]
    _DONE.update(zip(missing, parallel(score, missing, jobs, label), strict=True))
    return [_DONE[run][0] for run in todo]


def runs(
    experiment: Experiment,
    seeds: Sequence[int],
    duration: float | None = None,
    *,
    cases: Iterable[Case] = (),
    estimators: Iterable[str] = (),
) -> list[Run]:
    """All cases, estimators and seeds; one seed is all where nothing is random.

    Args:
        experiment: which.
        seeds: of the noise.
        duration: of the drives [s]; None: all of them.
        cases: by default those of `til run`.
        estimators: by default those of the experiment.
    """
    return [
        Run(experiment=experiment, case=case, estimator=name, seed=seed, duration=duration)
        for case in cases or experiment.cases
        for name in estimators or experiment.estimators
        for seed in (seeds if case.is_random else seeds[:1])
    ]


def rows(todo: Sequence[Run], jobs: int, label: str) -> list[Row]:
    """The rows of runs: their figures over the seeds of runs that differ in nothing else."""
    found: dict[tuple[Any, ...], list[list[Score]]] = {}
    for run, one in zip(todo, scores(todo, jobs, label), strict=True):
        key = run.experiment, run.case, run.case.name, run.estimator, run.duration
        found.setdefault(key, []).append(one)
    limits: dict[tuple[Any, ...], Mapping[tuple[str, str], float]] = {}
    made = []
    for (experiment, case, _, estimator, duration), over_seeds in found.items():
        key = experiment, case, duration
        if key not in limits:
            limit = experiment.limit
            limits[key] = limit(experiment, case, duration) if limit else {}
        made += _rows(case, estimator, over_seeds, limits[key])
    return made


def _rows(
    case: Case,
    estimator: str,
    over_seeds: Sequence[Sequence[Score]],
    limits: Mapping[tuple[str, str], float],
) -> list[Row]:
    """A row for each figure, and one for the ratio to what bounds it."""
    made = []
    for same in zip(*over_seeds, strict=True):
        one, values = same[0], np.array([score.value for score in same])
        key = one.quantity, one.metric
        row = _row(case, estimator, one, values)
        made.append(replace(row, paper=case.paper.get(key), limit=limits.get(key)))
        if limits.get(key):
            ratio = Score(one.quantity, "rms_over_limit", "1", 0.0, "rms", one.case)
            made.append(_row(case, estimator, ratio, values / limits[key]))
    return made


def _row(case: Case, estimator: str, one: Score, values: np.ndarray) -> Row:
    count = len(values)
    if one.over == "rms":
        values = np.sqrt(np.mean(values**2, keepdims=True))
    elif one.over == "mean":
        values = np.mean(values, keepdims=True)
    row = Row.over_seeds(
        values, case=one.case or case.name, quantity=one.quantity, metric=one.metric,
        unit=one.unit, estimator=estimator,
    )  # fmt: skip
    return replace(row, seeds=count)


def run_experiment(
    experiment: Experiment,
    *,
    seeds: Sequence[int],
    jobs: int = 1,
    snr: float | None = None,
    duration: float | None = None,
    estimators: Sequence[str] = (),
    gains: tuple[tuple[str, float], ...] | None = None,
) -> Result:
    """Drives an experiment's cases with its estimators over seeds, and scores them.

    Args:
        experiment: which.
        seeds: of the noise.
        jobs: processes.
        snr: of the sensors [dB]; None: that of the cases.
        duration: of the drives [s]; None: all of them.
        estimators: by default those of the experiment.
        gains: of the first estimator, instead of the project's.

    Raises:
        TwinError: an estimator lacks something, estimates nothing that is scored, or has blown up.
    """
    if experiment.study:
        _check_study(experiment, snr, estimators)
        return experiment.study.run(seeds, jobs, duration)
    start = time.perf_counter()
    first = next(iter(estimators or experiment.estimators))
    todo = [
        replace(run, gains=gains if run.estimator == first else None)
        for run in runs(
            experiment, seeds, duration, cases=experiment.at(snr), estimators=estimators
        )
    ]
    found = rows(todo, jobs, experiment.name)
    for name in estimators:
        if not any(row.estimator == name for row in found):
            raise TwinError(
                f"{experiment.name}: {name} estimates nothing that this scenario scores: "
                f"{', '.join(experiment.quantities)}"
            )
    settings: dict[str, Any] = {
        "snr": experiment.at(snr)[0].snr,
        "seeds": list(seeds),
        "jobs": jobs,
        "duration": duration,
    }
    notes = _DONE[todo[0]][1]
    return Result(
        name=experiment.name,
        settings=settings | ({"notes": list(notes)} if notes else {}),
        seconds=time.perf_counter() - start,
        rows=found,
    )


def _check_study(experiment: Experiment, snr: float | None, estimators: Sequence[str]) -> None:
    if snr is not None:
        raise TwinError(f"{experiment.name}: snr is {snr:g}; allowed: none, its noise is given")
    if estimators:
        raise TwinError(f"{experiment.name}: estimators are given; allowed: none, they are its own")
