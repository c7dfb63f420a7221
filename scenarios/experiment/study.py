"""A simulation study of TiL Section 4: one real drive, several laws, cases and noise seeds.

The real vehicle is the twin's own model with Table 2's loads on board, as in the paper: an inverse
crime but for load, noise and what a case says the twin does not know.
"""

import pkgutil
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Literal

import numpy as np

from estimators.base import Estimate
from estimators.score import rms_pct, settling_time
from estimators.til.law import ParameterLaw
from estimators.til.observer import Observer
from scenarios.cli.catalogue import Scenario, Settings, Tuning
from scenarios.driving.record import Manoeuvre, record
from scenarios.experiment.progress import parallel
from scenarios.experiment.result import Result, Row
from scenarios.papers.limits import law_limit, percent, sensitivity_at_truth
from twin import PARAMETERS, Drive, Twin, Vehicle, noise_sd, parameter_deltas, with_noise
from twin.road import noisy_heights

TWIN, REAL = "suv", "suv_loaded"
# What a twin knows of the load beforehand. The paper's loads leave the products of inertia alone;
# ours, of passengers and luggage behind and above the CM, do not, and a wrong J_xz alone is worth
# half of J_xx: who knows where the CM is knows what lies where.
MASS = ("mass",)
CM = ("cm_x", "cm_y", "cm_z", "Jxy", "Jxz", "Jyz")
INFINITE = float("inf")


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One row of a paper's table.

    Attributes:
        name: in the words of the paper's row.
        snr: of the sensors [dB].
        noise_on: where TiL Eq. (10) enters: the sensors' rates or, as Section 4.3 can be read, the
            angular accelerations, which the rates are then the integrals of.
        known: parameters of the load that the twin knows.
        road_noise: half width of TiL Eq. (17).
        paper: the paper's rms [%] by parameter.
    """

    name: str = field(compare=False)
    snr: float
    noise_on: Literal["rates", "accelerations"] = "rates"
    known: tuple[str, ...] = MASS + CM
    road_noise: float = 0.0
    paper: tuple[tuple[str, float], ...] = field(default=(), compare=False)

    @property
    def is_random(self) -> bool:
        """Whether seeds differ."""
        return self.snr < INFINITE or self.road_noise > 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """What is driven, what is estimated, and how.

    Attributes:
        target: "module:attribute" of this study, by which a worker finds it.
        manoeuvre: of the real vehicle, for a duration [s] or all of it.
        laws: of each estimator; "til" is our default, "til-paper" the paper's.
        cases: rows of the paper's table; the first noisy one is the scenario's own.
    """

    target: str
    manoeuvre: Callable[[float | None], Manoeuvre]
    laws: Mapping[str, tuple[ParameterLaw, ...]]
    cases: tuple[Case, ...]

    @property
    def parameters(self) -> tuple[str, ...]:
        """What is estimated."""
        return tuple(law.parameter for law in self.laws["til"])

    @property
    def name(self) -> str:
        """Of the scenario: its module's."""
        return self.target.partition(":")[0].rpartition(".")[2].replace("_", "-")


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One estimator over one noisy drive.

    Attributes:
        study: target of the study.
        estimator: whose laws.
        case: what is known, and how noisy it is.
        seed: of all noise.
        initial: what the twin believes at the start of the parameters that are estimated.
        duration: of the drive [s]; None: all of it.
    """

    study: str
    estimator: str
    case: Case
    seed: int
    initial: tuple[float, ...]
    duration: float | None = None


def find(target: str) -> Study:
    """The study of a target."""
    return pkgutil.resolve_name(target)


@cache
def real_drive(target: str, duration: float | None) -> Drive:
    """The loaded car's drive, without noise."""
    return record(Vehicle.load(REAL), find(target).manoeuvre(duration))


@cache
def variation() -> dict[str, float]:
    """What the load changes: the deltas of the chassis' parameters."""
    deltas = parameter_deltas(Vehicle.load(TWIN).chassis(), Vehicle.load(REAL).chassis())
    return dict(zip(PARAMETERS, deltas.tolist(), strict=True))


def noisy_drive(clean: Drive, case: Case, seed: int) -> Drive:
    """The drive as the observer gets to see it: noise on sensors and on the known road."""
    rng = np.random.default_rng(seed)
    drive = with_noise(clean, case.snr, rng)
    if case.noise_on == "accelerations" and case.snr < INFINITE:
        drive = _with_integrated_noise(clean, drive, case.snr, rng)
    if case.road_noise > 0.0:
        inputs = drive.inputs.copy()
        # rear on front, at the constant speed of a drive on a road
        lag = round(Twin(Vehicle.load(TWIN)).car.wheelbase / clean.truth["vx"][0] / clean.dt)
        inputs[:, 9:13] = noisy_heights(rng, inputs[:, 9:13], case.road_noise, lag)
        drive = drive.replace(inputs=inputs)
    return drive


def _with_integrated_noise(
    clean: Drive, noisy: Drive, snr: float, rng: np.random.Generator
) -> Drive:
    """Rates whose noise is the integral of white noise on the angular accelerations."""
    measurements = noisy.measurements.copy()
    for name in ("roll_rate", "pitch_rate", "yaw_rate"):
        rate = clean.channel(name)
        acceleration = np.gradient(rate, clean.dt)
        sd = acceleration.std() * 10.0 ** (-snr / 20.0)
        walk = np.cumsum(rng.normal(0.0, sd, len(clean))) * clean.dt
        measurements[:, clean.output_names.index(name)] = rate + walk
    return noisy.replace(measurements=measurements)


def observe(run: Run, laws: Sequence[ParameterLaw] | None = None) -> tuple[Drive, Estimate]:
    """Drives with the noise of the run's seed and observes, with other laws if some are given."""
    study = find(run.study)
    clean = real_drive(run.study, run.duration)
    drive = noisy_drive(clean, run.case, run.seed)
    observer = Observer(Twin(Vehicle.load(TWIN)), laws or study.laws[run.estimator])
    known = {name: variation()[name] for name in run.case.known}
    known |= dict(zip(study.parameters, run.initial, strict=True))
    observer.reset(float(clean.truth["vx"][0]), known)
    return drive, observer.run(drive)


def score(run: Run, laws: Sequence[ParameterLaw] | None = None) -> list[tuple[float, float]]:
    """Rms error [%] and time until below 10 % for good [s], of each parameter."""
    drive, estimate = observe(run, laws)
    return [
        (
            rms_pct(estimate[name], variation()[name], drive.dt),
            settling_time(estimate[name], variation()[name], drive.dt),
        )
        for name in find(run.study).parameters
    ]


_DONE: dict[Run, list[tuple[float, float]]] = {}  # tables and figures share many runs


def scores(todo: Sequence[Run], jobs: int, label: str) -> list[list[tuple[float, float]]]:
    """`score` of each run, in parallel; none is made twice."""
    missing = [run for run in dict.fromkeys(todo) if run not in _DONE]
    _DONE.update(zip(missing, parallel(score, missing, jobs, label), strict=True))
    return [_DONE[run] for run in todo]


@cache
def _sensitivity(target: str, duration: float | None, parameter: str) -> np.ndarray:
    drive = real_drive(target, duration)
    return sensitivity_at_truth(TWIN, drive, [parameter], variation())


def limit(study: Study, case: Case, law: ParameterLaw, duration: float | None) -> float | None:
    """The bound on the rms error over seeds of a law on this signal [%].

    None where it says nothing: without noise, with noise that is not white on a sensor, and for a
    twin that is wrong in what it does not estimate.
    """
    right = set(MASS + CM) <= {*case.known, *study.parameters}
    if case.snr == INFINITE or case.noise_on != "rates" or case.road_noise > 0.0 or not right:
        return None
    drive = real_drive(study.target, duration)
    sd = noise_sd(drive.measurements, case.snr, drive.output_names)
    sensitivity = _sensitivity(study.target, duration, law.parameter)
    return percent(law_limit(law, sensitivity, drive, sd), variation()[law.parameter])


def runs(
    study: Study, cases: Sequence[Case], seeds: Sequence[int], duration: float | None = None
) -> list[Run]:
    """All estimators and seeds of some cases; one seed is all where nothing is random."""
    return [
        Run(
            study=study.target,
            estimator=estimator,
            case=case,
            seed=seed,
            initial=(0.0,) * len(study.parameters),
            duration=duration,
        )
        for case in cases
        for estimator in study.laws
        for seed in (seeds if case.is_random else seeds[:1])
    ]


def rows(
    study: Study,
    cases: Sequence[Case],
    seeds: Sequence[int],
    jobs: int,
    duration: float | None = None,
) -> list[Row]:
    """All estimators over all seeds in each case."""
    todo = runs(study, cases, seeds, duration)
    scored = list(zip(todo, scores(todo, jobs, study.name), strict=True))
    found = []
    for case in cases:
        for i, law in enumerate(study.laws["til"]):
            paper = dict(case.paper).get(law.parameter)
            least = limit(study, case, law, duration)
            for estimator in study.laws:
                values = [
                    s[i] for run, s in scored if (run.case, run.estimator) == (case, estimator)
                ]
                found += _scored(values, case.name, law.parameter, estimator, paper, least)
    return found


def _scored(
    values: Sequence[tuple[float, float]],
    case: str,
    quantity: str,
    estimator: str,
    paper: float | None,
    least: float | None,
) -> list[Row]:
    """Error and settling time; and the error's rms over seeds beside the bound on just that."""
    errors, times = zip(*values, strict=True)
    one = partial(Row.over_seeds, case=case, quantity=quantity, estimator=estimator)
    found = [
        one(errors, metric="rms_pct", unit="%", paper=paper, limit=least),
        one(times, metric="time_to_10pct", unit="s"),
    ]
    if least is not None:
        ratio = float(np.sqrt(np.mean(np.square(errors)))) / least
        row = one([ratio], metric="rms_over_limit", unit="1")
        found.append(replace(row, seeds=len(errors)))
    return found


def scenario(study: Study) -> Scenario:
    """The study as a scenario of the command line: all else known, noise as the user wants it."""

    def own_case(settings: Settings) -> Case:
        same = (
            case
            for case in study.cases
            if (case.snr, case.known, case.road_noise) == (settings.snr, MASS + CM, 0.0)
        )
        noise = "noiseless" if settings.snr == INFINITE else f"SNR {settings.snr:g} dB"
        return next(same, Case(name=f"{noise}, correct mass, correct CM", snr=settings.snr))

    def run(settings: Settings) -> Result:
        start = time.perf_counter()
        scored = rows(study, [own_case(settings)], settings.seeds, settings.jobs, settings.duration)
        return Result(
            name=study.name,
            settings=asdict(settings),
            seconds=time.perf_counter() - start,
            rows=scored,
        )

    def timeline(settings: Settings, path: Path) -> None:
        from scenarios.timeline.timeline import write_timeline

        one = runs(study, [own_case(settings)], settings.seeds[:1], settings.duration)[0]
        drive, estimate = observe(one)
        write_timeline(
            path,
            vehicle=Vehicle.load(REAL),
            drive=drive,
            estimate=estimate,
            parameters=study.parameters,
            title=study.name,
        )

    def tune(tuning: Tuning) -> Result:
        from scenarios.tuning import laws as tune_laws

        return tune_laws.run(study, tuning)

    return Scenario(
        run=run,
        tune=tune,
        timeline=timeline,
        default_snr=10.0,
        vehicle=TWIN,
        drive=lambda settings: real_drive(study.target, settings.duration),
        variation=variation,
    )
