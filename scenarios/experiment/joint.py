"""Everything at once: the joint observer on four drives, against every real vehicle.

The real vehicle of `same` is the twin's own model with the loads on board, an inverse crime; the
others of `scenarios.plants.mismatch` differ from it in what is estimated along or in what is not.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimators.identifiability.cramer_rao import cramer_rao
from estimators.identifiability.report import report
from estimators.joint.observer import JointEstimate, JointObserver, JointSettings
from estimators.joint.sensor_errors import SENSOR_ERRORS
from estimators.score import settling_time
from scenarios.cli.catalogue import Scenario, Settings
from scenarios.driving import joint_drives
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import Manoeuvre, record
from scenarios.experiment.progress import parallel, progress
from scenarios.experiment.result import Result, Row
from scenarios.experiment.study import REAL, TWIN, variation
from scenarios.papers.limits import sensitivity_at_truth
from scenarios.plants.mismatch import MISMATCHES, real_drive, real_vehicle
from scenarios.plants.sensors import Sensors
from scenarios.plants.vehicles import SUV_LOADS
from twin import LOAD, OUTPUTS, SCALES, Drive, Vehicle, noise_sd

Array = NDArray[np.float64]

MANOEUVRES: dict[str, Callable[[float | None], Manoeuvre]] = {
    "mixed": lambda duration: joint_drives.mixed(duration=duration),
    "hard": lambda duration: joint_drives.hard(duration=duration),
    "straight": lambda duration: joint_drives.straight(duration=duration),
    "urban": lambda duration: urban(duration=duration),
}
LOAD_CHANGE = "load-change"
GET_OUT = ("rear_left_passenger", "rear_right_passenger")  # 145 kg
BLOCK = 10  # samples
NAMES = (*LOAD, *SCALES)  # estimated in all of them


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One observer over one noisy drive.

    Attributes:
        drive: of `MANOEUVRES`, or LOAD_CHANGE.
        mismatch: of `scenarios.plants.mismatch.MISMATCHES`.
        snr: of the sensors [dB].
        seed: of their noise.
        duration: of the drive [s]; None: all of it.
    """

    drive: str
    mismatch: str
    snr: float
    seed: int
    duration: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Of one run, each of `NAMES`.

    Attributes:
        error: at the end, estimate less truth.
        sd: claimed.
        valid: whether it is claimed to be known.
        time: until the error is below 10 % of the variation for good [s]; NaN of a scale.
        seconds: of driving until a change of the load was found; NaN: none was.
        report: what the drive could not tell, in words.
        worst: largest error of a parameter that no change of load touches, over its claimed sd.
    """

    error: Array
    sd: Array
    valid: NDArray[np.bool_]
    time: Array
    seconds: float
    worst: float
    report: tuple[str, ...]


@cache
def clean_drive(drive: str, mismatch: str, duration: float | None) -> Drive:
    """The real vehicle's drive, without noise."""
    if drive == LOAD_CHANGE:
        full = Vehicle.load(TWIN).with_loads(SUV_LOADS)
        rest = Vehicle.load(TWIN).with_loads(x for x in SUV_LOADS if x.name not in GET_OUT)
        cars = [real_vehicle(car, MISMATCHES[mismatch]) for car in (full, rest)]
        return joint_drives.load_change(*cars)
    return record(
        real_vehicle(Vehicle.load(REAL), MISMATCHES[mismatch]), MANOEUVRES[drive](duration)
    )


def truth(drive: Drive) -> Array:
    """(N, p) deltas of the real vehicle from the twin's, of `NAMES`."""
    nominal = Vehicle.load(TWIN).chassis()
    values = np.column_stack([drive.truth[name] for name in NAMES])
    inertia = nominal.inertia[[0, 0, 1], [1, 2, 2]]
    base = [nominal.mass, *nominal.cm, *np.diag(nominal.inertia), *inertia, *(1.0 for _ in SCALES)]
    return values - np.array(base)


def faults(sensors: Sensors) -> dict[str, float]:
    """What the observer should find of the sensors, by name of `SENSOR_ERRORS`."""
    biases = (*sensors.acceleration_bias, *sensors.rate_bias)
    found = (*biases, sensors.delay, *sensors.position, 0.0)
    return dict(zip(SENSOR_ERRORS, found, strict=True))


def observe(
    run: Run,
    settings: JointSettings = JointSettings(),  # noqa: B008
) -> tuple[Drive, JointEstimate]:
    """Drives with the noise of the run's seed and observes from an empty car on."""
    clean = clean_drive(run.drive, run.mismatch, run.duration)
    rng = np.random.default_rng(run.seed)
    drive = real_drive(clean, MISMATCHES[run.mismatch], run.snr, rng)
    sd = [drive.settings["noise_sd"][name] for name in OUTPUTS]
    observer = JointObserver(Vehicle.load(TWIN), sd, settings)
    observer.reset(float(clean.truth["vx"][0]), road=drive.inputs[0, 9:13])
    return drive, observer.run(drive)


def score(run: Run) -> Score:
    """Scores one run."""
    drive, estimate = observe(run)
    off = estimate.parameters[:, : len(NAMES)] - truth(drive)
    variations = units()
    sd = estimate.sd[:, : len(NAMES)]
    times = [
        settling_time(off[:, i] + variations[i], variations[i], drive.dt)
        if name in LOAD
        else np.nan
        for i, name in enumerate(NAMES)
    ]
    found = np.flatnonzero(np.diff(estimate.changes))
    moving = np.cumsum(drive.truth["vx"] > 1.0) * drive.dt
    change = np.flatnonzero(np.abs(np.diff(drive.truth["mass"])) > 0.0)
    seconds = float(moving[found[0]] - moving[change[0]]) if found.size and change.size else np.nan
    others = slice(len(LOAD), None)
    after = slice(change[0] if change.size else 0, None)
    return Score(
        error=off[-1],
        sd=sd[-1],
        valid=estimate.valid[-1, : len(NAMES)],
        time=np.array(times),
        seconds=seconds,
        report=tuple(report(estimate)),
        worst=float((np.abs(off[after, others]) / sd[after, others]).max()),
    )


@cache
def bound(drive: str, snr: float, duration: float | None) -> Array:
    """(p,) the Cramer-Rao bound of all parameters together, of `same`, of perfect sensors.

    Means of ten samples stand for them, as the observer takes them: a tenth of the memory.
    """
    clean = clean_drive(drive, "same", duration)
    n = len(clean) // BLOCK * BLOCK
    columns = [
        sensitivity_at_truth(TWIN, clean, [name], variation())[0, :n]
        for name in progress(NAMES, "bound", len(NAMES))
    ]
    means = np.array([c.reshape(-1, BLOCK, len(OUTPUTS)).mean(axis=1) for c in columns])
    sd = noise_sd(clean.measurements, snr) / np.sqrt(BLOCK)
    return cramer_rao(NAMES, means, sd).joint


def units() -> Array:
    """(p,) what 100 % is: of a load what it changes, of a scale its nominal value."""
    return np.array([abs(variation()[n]) if n in LOAD else 1.0 for n in NAMES])


def rows(
    drive: str,
    mismatch: str,
    snr: float,
    seeds: Sequence[int],
    jobs: int,
    duration: float | None = None,
    *,
    with_bound: bool = False,
) -> list[Row]:
    """All seeds of one drive of one real vehicle; the Cramer-Rao bound takes a minute more."""
    scores = all_scores(drive, mismatch, snr, seeds, jobs, duration)
    least = bound(drive, snr, duration) if with_bound else None
    return rows_of(scores, drive, mismatch, least)


def all_scores(
    drive: str,
    mismatch: str,
    snr: float,
    seeds: Sequence[int],
    jobs: int,
    duration: float | None = None,
) -> list[Score]:
    """One of each seed."""
    todo = [Run(drive=drive, mismatch=mismatch, snr=snr, seed=s, duration=duration) for s in seeds]
    clean_drive(drive, mismatch, duration)
    return parallel(score, todo, jobs, f"{drive} {mismatch}")


def rows_of(scores: list[Score], drive: str, mismatch: str, least: Array | None) -> list[Row]:
    """The rows of all seeds; least: the Cramer-Rao bound, (p,)."""
    case = f"{drive}, {mismatch}"
    found: list[Row] = []
    covered = []
    for i, name in enumerate(NAMES):
        one = partial(Row.over_seeds, case=case, quantity=name, estimator="joint")
        errors = np.array([s.error[i] for s in scores])
        sds = np.array([s.sd[i] for s in scores])
        covered.append(np.abs(errors) <= 2.0 * sds)
        limit = None if least is None else float(100.0 * least[i] / units()[i])
        found += [
            one(100.0 * np.abs(errors) / units()[i], metric="pct", unit="%", limit=limit),
            one(100.0 * sds / units()[i], metric="claimed_sd_pct", unit="%"),
            _single(case, name, "rmse_over_sd", np.sqrt(np.mean((errors / sds) ** 2)), len(scores)),
            _single(case, name, "valid", np.mean([s.valid[i] for s in scores]), len(scores)),
        ]
        if least is not None:
            ratio = np.sqrt(np.mean(errors**2)) / least[i]
            found.append(_single(case, name, "rms_over_limit", ratio, len(scores)))
        if name in LOAD and drive != LOAD_CHANGE:
            found.append(one([s.time[i] for s in scores], metric="time_to_10pct", unit="s"))
    found.append(_single(case, "all", "coverage", np.mean(covered), len(scores)))
    if drive == LOAD_CHANGE:
        one = partial(Row.over_seeds, case=case, estimator="joint")
        found += [
            one([s.seconds for s in scores], quantity="load", metric="found_after", unit="s"),
            one([s.worst for s in scores], quantity="others", metric="worst_over_sd", unit="1"),
        ]
    return found


def _single(case: str, quantity: str, metric: str, value: float | np.floating, seeds: int) -> Row:
    """A figure that all seeds make together."""
    return Row(
        case=case, quantity=quantity, metric=metric, unit="1", estimator="joint", seeds=seeds,
        median=float(value), p90=float(value),
    )  # fmt: skip


def scenario(name: str) -> Scenario:
    """A drive as a scenario of the command line."""

    def run(settings: Settings) -> Result:
        start = time.perf_counter()
        duration = None if name == LOAD_CHANGE else settings.duration
        scores = all_scores(name, "same", settings.snr, settings.seeds, settings.jobs, duration)
        return Result(
            name=name,
            settings=asdict(settings) | {"report": list(scores[0].report)},
            seconds=time.perf_counter() - start,
            rows=rows_of(scores, name, "same", None),
        )

    def timeline(settings: Settings, path: Path) -> None:
        from scenarios.timeline.joint import write_joint_timeline

        duration = None if name == LOAD_CHANGE else settings.duration
        seed = settings.seeds[0]
        drive, estimate = observe(
            Run(drive=name, mismatch="same", snr=settings.snr, seed=seed, duration=duration)
        )
        write_joint_timeline(
            path,
            vehicle=Vehicle.load(REAL),
            drive=drive.replace(settings=drive.settings | {"report": report(estimate)}),
            estimate=estimate,
            faults=faults(MISMATCHES["same"].sensors),
            title=name,
        )

    known = (
        {}
        if name == LOAD_CHANGE
        else {
            "drive": lambda settings: clean_drive(name, "same", settings.duration),
            "variation": variation,
        }
    )
    return Scenario(run=run, timeline=timeline, vehicle=TWIN, default_snr=10.0, **known)


MIXED = scenario("mixed")
HARD = scenario("hard")
STRAIGHT = scenario("straight")
LOAD_CHANGES = scenario(LOAD_CHANGE)
