"""A measured drive: the sideslip of a Ferrari 250 LM on a race track.

Two thirds of the log calibrate the twin and its competitors, measured sideslip included. Over the
last third each has steering, speed, accelerations and yaw rate alone.

The twin runs as `til estimate` runs it, with the calibration that ships: `til calibrate` made
`models/calibrations/ferrari_250lm.toml` from the first two thirds of the log, by its map.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

import models
from estimators.base import Estimate, sideslip_estimate
from estimators.benchmarks import bicycle_ekf, single_track, static_map
from estimators.entry import Given
from scenarios.calibration.ferrari_log import PARTS, data_file, part
from scenarios.calibration.plan import cut
from scenarios.experiment.experiment import Case, Experiment, Recipe, Run, Score, Trial
from scenarios.experiment.metrics import rms
from scenarios.logs.candidate import Candidate, candidate_of
from scenarios.logs.pieces import prepared
from scenarios.report.pictures import figure
from twin import Drive, TwinError, Vehicle
from twin.car.signals import signals_of

Array = NDArray[np.float64]

VEHICLE = "ferrari_250lm"
CALIBRATION, MAP = "calibrations/ferrari_250lm.toml", "maps/ferrari_250lm.toml"
CALIBRATED_ON, SCORED_ON = PARTS
# Mass and axles of models/ferrari_250lm.xml
GEOMETRY = single_track.Geometry(mass=982.0, front=1.33, rear=1.07, yaw_inertia=1350.0)
BICYCLE = bicycle_ekf.Bicycle(mass=982.0, front=1.33, rear=1.07, yaw_inertia=1350.0)
BICYCLE_RATE = 100.0  # [Hz], the log's own, at which the filter is fitted
BICYCLE_FREE = tuple(bicycle_ekf.FREE)
BICYCLE_EVALUATIONS = 8  # chosen in the rival's favour: of 4, 8 and 12 the best on the last third


def calibrated() -> Candidate:
    """The car with the calibration that ships."""
    return candidate_of(Vehicle.load(models.path(CALIBRATION)))


@dataclass(frozen=True)
class _WholeDrive:
    """An estimator that is a function of a whole drive: it has no state to reset."""

    of: Callable[[Drive], Estimate]

    def reset(
        self,
        speed: float,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """See `estimators.base.Estimator`."""

    def run(self, drive: Drive) -> Estimate:
        """See `estimators.base.Estimator`."""
        return self.of(drive)


def _zero(drive: Drive) -> Estimate:
    """No sideslip at all: what every estimator has to beat."""
    return sideslip_estimate(drive.time, np.zeros(len(drive)))


def _single_track(run: Run, drive: Drive, given: Given) -> Given:
    """Fitted to the first two thirds."""
    steering, speed = drive.channel("steering_wheel_angle"), drive.channel("vx")
    known = part(drive, CALIBRATED_ON)
    fitted = single_track.fit(
        GEOMETRY,
        steering[known],
        cut(drive, known),
        speed[known],
        drive.truth["sideslip"][known],
    )
    return replace(given, model=(fitted, GEOMETRY))


def _static_map(run: Run, drive: Drive, given: Given) -> Given:
    """Fitted to the first two thirds, signals low-passed at 2 Hz."""
    known = part(drive, CALIBRATED_ON)
    ay, yaw_rate, speed = (values[known] for values in static_map.map_inputs(drive))
    fitted = static_map.fit(ay, yaw_rate, speed, drive.truth["sideslip"][known])
    return replace(given, model=fitted)


def _bicycle_ekf(run: Run, drive: Drive, given: Given) -> Given:
    """Fitted to the first two thirds, together with its noises."""
    known = part(drive, CALIBRATED_ON)
    stride = round(1.0 / drive.dt / BICYCLE_RATE)
    slow = cut(drive, slice(known.start, known.stop, stride))
    fitted, _ = bicycle_ekf.fit_filter(
        BICYCLE, [slow], BICYCLE_FREE, evaluations=BICYCLE_EVALUATIONS
    )
    return replace(given, model=fitted)


RECIPES = {
    "til": Recipe(estimator="til", make=lambda run, drive: _WholeDrive(calibrated().observe)),
    "bicycle-ekf": Recipe(estimator="bicycle-ekf", complete=_bicycle_ekf),
    "single-track": Recipe(estimator="single-track", complete=_single_track),
    "static-map": Recipe(estimator="static-map", complete=_static_map),
    "zero": Recipe(estimator="zero", make=lambda run, drive: _WholeDrive(_zero)),
}


@dataclass(frozen=True)
class Log:
    """The log as a plant: no seed changes it."""

    def drive(self, case: Case, rng: np.random.Generator, duration: float | None) -> Drive:
        """The whole log.

        Raises:
            TwinError: it is to be shorter, or it is not there.
        """
        if duration is not None:
            raise TwinError("ferrari: takes no duration; its parts are shares of the whole log")
        return _log(data_file())

    def vehicle(self) -> Vehicle:
        """What is drawn."""
        return calibrated().vehicle


@cache
def _log(file: Path) -> Drive:
    return log_of(file)


def log_of(path: Path) -> Drive:
    """The log in the twin's channels and steps, as `til estimate` reads it.

    Raises:
        TwinError: the file is no such log, or has gaps.
    """
    car = Vehicle.load(VEHICLE)
    log = Drive.load(path, models.path(MAP), signals_of(car))
    pieces = prepared(log, float(car.compile().opt.timestep)).pieces
    if len(pieces) != 1:
        raise TwinError(f"{path}: is {len(pieces)} pieces; allowed: a log without long gaps")
    return pieces[0]


def errors(trial: Trial) -> list[Score]:
    """Of the sideslip on both parts of the log: rms error [deg], share of errors within 2 sd."""
    error = trial.estimate.sideslip - trial.drive.truth["sideslip"]
    sd = trial.estimate.sideslip_sd
    scores = []
    for name in reversed(PARTS):
        samples = part(trial.drive, name)
        rmse = rms(np.degrees(error[samples]))
        scores.append(Score("sideslip", "rmse", "deg", rmse, case=name))
        if sd is not None:
            inside = np.abs(error[samples]) < 2.0 * sd[samples]
            scores.append(Score("sideslip", "coverage", "1", float(inside.mean()), case=name))
    return scores


def picture(trials: Sequence[Trial], path: Path) -> None:
    """Sideslip and its errors over the last third, and where on the track the twin's error sits."""
    drive = trials[0].drive
    samples = part(drive, SCORED_ON)
    time, truth = drive.time[samples], drive.truth["sideslip"][samples]
    sideslip = {
        trial.run.estimator: trial.estimate.sideslip[samples]
        for trial in trials
        if trial.run.estimator != "zero"
    }
    bands = {
        trial.run.estimator: 2.0 * trial.estimate.sideslip_sd[samples]
        for trial in trials
        if trial.estimate.sideslip_sd is not None
    }
    with figure(path, title="Ferrari 250 LM, last third of the log", rows=3, shared=False) as axes:
        above, middle, below = axes
        above.plot(time, np.degrees(truth), "k", lw=1.0, label="measured")
        for name, values in sideslip.items():
            (line,) = above.plot(time, np.degrees(values), lw=0.8, label=name)
            if name in bands:
                low, high = np.degrees(values - bands[name]), np.degrees(values + bands[name])
                above.fill_between(time, low, high, color=line.get_color(), alpha=0.25, lw=0)
            middle.plot(time, np.degrees(values - truth), lw=0.8, label=name)
        above.set(ylabel="sideslip [deg]")
        middle.set(ylabel="error [deg]", xlabel="time [s]", ylim=(-2.0, 2.0))
        above.legend(ncols=4, fontsize=7)
        x, y = _track(drive, samples)
        error = np.degrees(sideslip["til"] - truth)
        dots = below.scatter(x, y, c=error, s=3, cmap="coolwarm", vmin=-0.6, vmax=0.6)
        below.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
        below.figure.colorbar(
            dots, ax=below, label="til: error [deg]", location="bottom", shrink=0.5
        )


def _track(drive: Drive, samples: slice) -> tuple[Array, Array]:
    """Where the car goes [m], from its speed and yaw rate."""
    yaw = np.cumsum(drive.channel("yaw_rate")[samples]) * drive.dt
    course = yaw + drive.truth["sideslip"][samples]
    step = drive.channel("vx")[samples] * drive.dt
    return np.cumsum(step * np.cos(course)), np.cumsum(step * np.sin(course))


EXPERIMENT = Experiment(
    name="ferrari",
    cases=(Case(name="log", plant=Log(), measured=True),),
    estimators=RECIPES,
    quantities=("sideslip",),
    metrics=errors,
    timeline="parameters",
    picture=picture,
)


if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "ferrari", *sys.argv[1:]]))
