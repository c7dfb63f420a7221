"""Sideslip and mass together, TiL Section 5: drives of real vehicles, observers and their errors.

The paper's car and its data cannot be had. A second simulation plays the real vehicle, one that
differs from the twin as its name says (`scenarios.plants.mismatch`), or another program's car. The
real
vehicle is unloaded; the observers believe at the start that 350 kg are missing, as the paper's.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimators.base import Estimate
from estimators.benchmarks import double_track, static_map
from estimators.til import state_and_mass
from estimators.til.observer import Observer
from scenarios.driving.drivers import driver_of, limits_of
from scenarios.driving.manoeuvres import lane_changes, laps
from scenarios.driving.record import CourseManoeuvre, record
from scenarios.plants.mismatch import MISMATCHES, real_drive, real_vehicle
from scenarios.tuning import double_track_fit, gains
from twin import Drive, Twin, TwinError, Vehicle

Array = NDArray[np.float64]

TWIN = "sports_car"
COMMONROAD = "commonroad"  # a real vehicle, the BMW 320i of another program; its twin is ours
DRIVES = {"laps": laps, "lane-change": lane_changes}
MISSING = -350.0  # [kg], TiL Section 5.3
SNR = 20.0  # [dB]; chosen: a tenth of each signal, and not less than `twin.noise` has
LAST = 60.0  # [s], over which the mass is scored
PAPERS_LAST = 10.0  # [s], TiL Eq. (26)
FIT_SEED = 1000  # of the drive that the static map is fitted to
# [1/s]; chosen: quicker than a bend, and a fifth of what is missing
AXLE_FORCE_BANDWIDTH, AXLE_FORCE_LEAK = 2.0, 8.0

BOUNDS: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "til": {
        **state_and_mass.STATE_BOUNDS,
        **state_and_mass.CROSS_BOUNDS,
        **state_and_mass.LEAST_SQUARES_BOUNDS,
    },
    "til-paper": {**state_and_mass.STATE_BOUNDS, **state_and_mass.SIGN_BOUNDS},
    "double-track": double_track.BOUNDS,
}
ESTIMATORS = (*BOUNDS, "static-map", "zero")
# The default observer with the axles' lateral forces as extended states
WITH_FORCES = "til-axle-forces"


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One observer over one noisy drive.

    Attributes:
        case: the real vehicle, of `scenarios.plants.mismatch.MISMATCHES` or `COMMONROAD`.
        drive: of `DRIVES`.
        estimator: of `ESTIMATORS`, or `WITH_FORCES`.
        seed: of all noise.
        snr: of the sensors [dB].
        start: what is believed of the mass beforehand [kg].
        duration: of the drive [s]; None: all of it.
        gains: by name; None: those of the project.
        every: corrections at every so-manieth sample.
    """

    case: str
    drive: str
    estimator: str
    seed: int = 0
    snr: float = SNR
    start: float = MISSING
    duration: float | None = None
    gains: tuple[tuple[str, float], ...] | None = None
    every: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """What an observer says, whichever it is.

    Attributes:
        sideslip: (N,) [rad].
        mass: (N,) error of the mass [kg]; NaN where it estimates none.
        axle_force: (N, 2) lateral forces of the front and the rear tyres [N], likewise.
        estimate: of a twin or the double track, with all else it has.
    """

    sideslip: Array
    mass: Array
    axle_force: Array
    estimate: Estimate | None = field(default=None)


def twin_of(case: str) -> str:
    """The twin's car."""
    return "bmw_320i" if case == COMMONROAD else TWIN


@cache
def clean_drive(case: str, drive: str, duration: float | None) -> Drive:
    """The real vehicle's drive, without noise."""
    if case == COMMONROAD:
        from scenarios.plants import commonroad

        return commonroad.record(manoeuvre(case, drive, duration))
    car = twin_of(case)
    vehicle = real_vehicle(Vehicle.load(car), MISMATCHES[case])
    return record(vehicle, manoeuvre(case, drive, duration), driver_of(vehicle))


def manoeuvre(case: str, drive: str, duration: float | None) -> CourseManoeuvre:
    """What the real vehicle is to do."""
    if case != COMMONROAD:
        return DRIVES[drive](duration=duration, limits=limits_of(Vehicle.load(TWIN)))
    from scenarios.plants import commonroad

    limits = commonroad.commonroad_limits()
    if drive == "laps":
        return laps(duration=duration, limits=limits)
    return lane_changes(duration=duration, limits=limits, lateral=commonroad.LANE_CHANGE_LATERAL)


def noisy_drive(run: Run) -> Drive:
    """The drive as the observer gets to see it."""
    clean = clean_drive(run.case, run.drive, run.duration)
    # another program's car has faults enough of its own
    mismatch = MISMATCHES["same" if run.case == COMMONROAD else run.case]
    return real_drive(clean, mismatch, run.snr, np.random.default_rng(run.seed))


@cache
def gains_of(car: str, estimator: str) -> Mapping[str, float]:
    """The project's own."""
    return gains.shipped(car, estimator, BOUNDS[estimator])


def observe(run: Run) -> tuple[Drive, Belief]:
    """Drives with the noise of the run's seed and observes.

    Raises:
        TwinError: no such estimator, or the gains blow it up.
    """
    drive = noisy_drive(run)
    car = twin_of(run.case)
    if run.estimator == "static-map":
        return drive, _from_map(run, drive)
    if run.estimator == "double-track":
        values = double_track.Gains(**_values(run, car, run.estimator))
        model = double_track.load(double_track_fit.path(car))
        benchmark = double_track.DoubleTrackObserver(model, values)
        benchmark.reset(float(drive.truth["vx"][0]), {"mass": run.start})
        found = benchmark.run(drive)
        return drive, _belief(found, drive, _missing(drive, car))
    observer = make_observer(run)
    observer.reset(float(drive.truth["vx"][0]), {"mass": run.start})
    return drive, _belief(observer.run(drive), drive, _missing(drive, car))


def make_observer(run: Run) -> Observer:
    """The observer of a run that has a twin.

    Raises:
        TwinError: no such estimator.
    """
    car = twin_of(run.case)
    twin = Twin(Vehicle.load(car))
    if run.estimator == "zero":
        return Observer(twin, [])
    if run.estimator == "til-paper":
        values = _values(run, car, "til-paper")
        law = state_and_mass.paper_mass_law(values)
        return Observer(twin, [law], state_and_mass.state_gains(values), every=run.every)
    if run.estimator not in ("til", WITH_FORCES):
        raise TwinError(f"estimator is {run.estimator!r}; allowed: {', '.join(ESTIMATORS)}")
    values = _values(run, car, "til")
    laws = [state_and_mass.mass_law(values, wheels_of(twin))]
    if run.estimator == WITH_FORCES:
        model = double_track.load(double_track_fit.path(car))
        axles = (model.front.x, model.rear.x)
        laws += state_and_mass.axle_force_laws(
            values, AXLE_FORCE_BANDWIDTH, AXLE_FORCE_LEAK, model.mass, model.yaw_inertia, axles
        )
    return Observer(twin, laws, state_and_mass.state_gains(values), every=run.every)


@cache
def wheels_of_car(car: str) -> state_and_mass.Wheels:
    """The same of a car by its name."""
    return wheels_of(Twin(Vehicle.load(car)))


def wheels_of(twin: Twin) -> state_and_mass.Wheels:
    """What the mass law has to know of a car."""
    mass = float(twin.model.body_mass.sum())
    radii = np.array([tyre["unloaded_radius"] for tyre in twin.vehicle.tyres()])
    return state_and_mass.Wheels(mass, float(np.mean(twin.car.spin_inertia / radii) / mass))


def _values(run: Run, car: str, estimator: str) -> Mapping[str, float]:
    return gains_of(car, estimator) if run.gains is None else dict(run.gains)


def _missing(drive: Drive, car: str) -> float:
    """What the twin would have to believe of its chassis' mass to be right [kg]."""
    return float(drive.truth["mass"][0]) - Vehicle.load(car).chassis().mass


def _belief(found: Estimate, drive: Drive, missing: float) -> Belief:
    if "fy_fl" in found.extended_names:
        forces = np.column_stack([found["fy_fl"] + found["fy_fr"], found["fy_rl"] + found["fy_rr"]])
        forces += np.column_stack([found["axle_force_front"], found["axle_force_rear"]])
    else:
        forces = np.full((len(drive), 2), np.nan)
    return Belief(
        sideslip=found.sideslip,
        mass=found["mass"] - missing,
        axle_force=forces,
        estimate=found,
    )


@cache
def _map(case: str) -> static_map.StaticMap:
    """Fitted to laps of the mismatched car, with its true sideslip: more than a user has."""
    own = case if case == COMMONROAD else "mismatched"
    drive = noisy_drive(Run(case=own, drive="laps", estimator="static-map", seed=FIT_SEED))
    return static_map.fit(*_map_inputs(drive), drive.truth["sideslip"])


def _map_inputs(drive: Drive) -> tuple[Array, Array, Array]:
    """Lateral acceleration, yaw rate and mean speed of the rear wheels, low-passed."""
    speed = 0.5 * (drive.channel("wheel_speed_rl") + drive.channel("wheel_speed_rr"))
    signals = drive.channel("ay"), drive.channel("yaw_rate"), speed
    ay, yaw_rate, speed = (static_map.low_pass(signal, drive.dt) for signal in signals)
    return ay, yaw_rate, np.maximum(speed, 1.0)


def _from_map(run: Run, drive: Drive) -> Belief:
    nothing = np.full(len(drive), np.nan)
    return Belief(
        sideslip=static_map.predict(_map(run.case), *_map_inputs(drive)),
        mass=nothing,
        axle_force=np.column_stack([nothing, nothing]),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Rms errors of a run.

    Attributes:
        sideslip: [deg].
        mass: over the last minute [kg].
        mass_at_end: error at the end [kg].
        mass_last_10s: as in TiL Eq. (26) [kg].
        axle_force: (front, rear) [N].
    """

    sideslip: float
    mass: float
    mass_at_end: float
    mass_last_10s: float
    axle_force: tuple[float, float]


def score(run: Run) -> Score:
    """The errors of a run.

    Raises:
        TwinError: as `observe`.
    """
    drive, belief = observe(run)
    truth = drive.truth
    forces = np.column_stack([truth["fy_fl"] + truth["fy_fr"], truth["fy_rl"] + truth["fy_rr"]])
    front, rear = np.sqrt(np.mean((belief.axle_force - forces) ** 2, axis=0)).tolist()
    return Score(
        sideslip=_rms(np.degrees(belief.sideslip - truth["sideslip"])),
        mass=_rms(belief.mass[-round(LAST / drive.dt) :]),
        mass_at_end=float(belief.mass[-1]),
        mass_last_10s=_rms(belief.mass[-round(PAPERS_LAST / drive.dt) :]),
        axle_force=(front, rear),
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def gains_from(path: Path, case: str) -> tuple[tuple[str, float], ...]:
    """The default observer's gains of a user's file.

    Raises:
        TwinError: the file is broken or for another car.
    """
    found = gains.read(path, vehicle=twin_of(case), estimator="til", names=BOUNDS["til"])
    return tuple(found.items())


def runs(
    cases: Sequence[str], drives: Sequence[str], estimators: Sequence[str], seeds: Sequence[int]
) -> list[Run]:
    """All of them."""
    return [
        Run(case=case, drive=drive, estimator=estimator, seed=seed)
        for case in cases
        for drive in drives
        for estimator in estimators
        for seed in seeds
    ]
