"""A measured drive: the sideslip of a Ferrari 250 LM on a race track.

Two thirds of the log calibrate the twin and its competitors, measured sideslip included. Over the
last third each has steering, speed, accelerations and yaw rate alone.

`models/ferrari_250lm.toml` is the calibration that ships; `til tune ferrari` makes it anew.
"""

import math
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import models
from estimators.benchmarks import single_track, static_map
from estimators.speed_follower import SpeedFollower
from scenarios.calibration import calibrate
from scenarios.calibration.calibrate import cut
from scenarios.calibration.candidate import Candidate
from scenarios.calibration.ferrari_log import PARTS, data_file, load, part
from scenarios.cli.catalogue import Scenario, Settings, Tuning
from scenarios.experiment.result import Result, Row
from scenarios.report.pictures import figure
from twin import Drive, TwinError, Vehicle

Array = NDArray[np.float64]

VEHICLE = "ferrari_250lm"
CALIBRATION = "ferrari_250lm.toml"
CALIBRATED_ON, SCORED_ON = PARTS
# Freed by `tune`, each with how far the car is believed to lie from its files (chosen). Where the
# log tells little a number so stays one that a car can have.
FREE = {
    **dict.fromkeys(("front_tyre_friction", "rear_tyre_friction"), 0.2),
    **dict.fromkeys(("front_cornering_stiffness", "rear_cornering_stiffness"), 0.35),
    "front_load_of_largest_stiffness": 0.35,
    "rear_load_of_largest_stiffness": 0.35,
    **{"relaxation": 0.4, "combined_slip": 0.4, "slip_stiffness": 0.3, "front_anti_roll": 0.7},
    **{"cm_x": 0.08, "cm_y": 0.03},  # [m]; the driver sits on the right
    "steering_offset": 0.004,  # [rad]
    "brake_front": 0.1,
    "sideslip_offset": 0.004,  # [rad]
    **{"yaw_rate_to_yaw_rate": 20.0, "yaw_rate_to_vy": 15.0},
    **{"locking": 400.0, "sideslip_lever": 0.2, "Jzz": 250.0},
}
SIGNALS = ("sideslip",)
# Mass and drag area of models/ferrari_250lm.xml, wheel radii of the log
FOLLOWER = SpeedFollower(mass=982.0, drag_area=0.55, radius_front=0.298, radius_rear=0.33)
GEOMETRY = single_track.Geometry(mass=982.0, front=1.33, rear=1.07, yaw_inertia=1350.0)


def nominal() -> Candidate:
    """The car of the files, uncalibrated."""
    return Candidate(vehicle=Vehicle.load(VEHICLE), follower=FOLLOWER)


def calibrated() -> Candidate:
    """The car with the calibration that ships."""
    return replace(nominal(), values=calibrate.read(models.path(CALIBRATION)))


def twin_sideslip(drive: Drive) -> Array:
    """(N,) of the calibrated twin [rad]."""
    candidate = calibrated()
    return candidate.sideslip(candidate.run(drive))


def single_track_sideslip(drive: Drive) -> Array:
    """(N,) of a single-track car fitted to the first two thirds [rad]."""
    steering, speed = drive.channel("steering_wheel_angle"), drive.channel("vx")
    known = part(drive, CALIBRATED_ON)
    fitted = single_track.fit(
        GEOMETRY,
        steering[known],
        cut(drive, known),
        speed[known],
        drive.truth["sideslip"][known],
    )
    return single_track.predict(fitted, GEOMETRY, steering, drive, speed)


def static_map_sideslip(drive: Drive) -> Array:
    """(N,) of a static map fitted to the first two thirds, signals low-passed at 2 Hz [rad]."""
    known = part(drive, CALIBRATED_ON)
    ay, yaw_rate, speed = (
        static_map.low_pass(drive.channel(name), drive.dt) for name in ("ay", "yaw_rate", "vx")
    )
    fitted = static_map.fit(
        ay[known], yaw_rate[known], speed[known], drive.truth["sideslip"][known]
    )
    return static_map.predict(fitted, ay, yaw_rate, speed)


# A double-track observer will be one more line.
ESTIMATORS: dict[str, Callable[[Drive], Array]] = {
    "til": twin_sideslip,
    "single-track": single_track_sideslip,
    "static-map": static_map_sideslip,
    "zero": lambda drive: np.zeros(len(drive)),
}


def rmse_deg(estimate: Array, truth: Array) -> float:
    """Root mean square error [deg] of angles [rad]."""
    return float(np.degrees(np.sqrt(np.mean((estimate - truth) ** 2))))


def run(settings: Settings) -> Result:
    """Scores all estimators on both parts of the log."""
    start = time.perf_counter()
    drive = _drive(settings)
    sideslip = {name: estimator(drive) for name, estimator in ESTIMATORS.items()}
    rows = [
        Row.over_seeds(
            [rmse_deg(sideslip[name][samples], drive.truth["sideslip"][samples])],
            case=case,
            quantity="sideslip",
            metric="rmse",
            unit="deg",
            estimator=name,
        )
        for case, samples in ((case, part(drive, case)) for case in reversed(PARTS))
        for name in ESTIMATORS
    ]
    return Result(
        name="ferrari", settings=asdict(settings), seconds=time.perf_counter() - start, rows=rows
    )


def tune(tuning: Tuning) -> Result:
    """Calibrates the twin on the first two thirds of the log.

    Raises:
        TwinError: another estimator is asked for, bounds or a cost are, or the log is not there.
    """
    if tuning.estimator != "til":
        raise TwinError(f"tune: estimator is {tuning.estimator!r}; allowed: til")
    if tuning.bounds or tuning.cost:
        raise TwinError("tune: ferrari takes no --bounds and no --cost; allowed: neither")
    file = data_file()
    drive = load(file)
    task = calibrate.Task(
        candidate=nominal(),
        free=tuple(FREE),
        prior_sd=FREE,
        signals=SIGNALS,
        drive=cut(drive, part(drive, CALIBRATED_ON)),
    )
    return calibrate.run(task, file, tuning.path, jobs=tuning.jobs, evaluations=tuning.evaluations)


def _drive(settings: Settings) -> Drive:
    if not math.isnan(settings.snr):
        raise TwinError(f"ferrari: snr is {settings.snr:g}; the log is measured: it takes none")
    if settings.duration is not None:
        raise TwinError("ferrari: takes no duration; its parts are shares of the whole log")
    return load(data_file())


def picture(settings: Settings, path: Path) -> None:
    """Sideslip and its errors over the last third, and where on the track the twin's error sits."""
    drive = _drive(settings)
    samples = part(drive, SCORED_ON)
    time, truth = drive.time[samples], drive.truth["sideslip"][samples]
    sideslip = {name: one(drive)[samples] for name, one in ESTIMATORS.items() if name != "zero"}
    with figure(path, title="Ferrari 250 LM, last third of the log", rows=3, shared=False) as axes:
        above, middle, below = axes
        above.plot(time, np.degrees(truth), "k", lw=1.0, label="measured")
        for name, values in sideslip.items():
            above.plot(time, np.degrees(values), lw=0.8, label=name)
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


def timeline(settings: Settings, path: Path) -> None:
    """The calibrated twin over the log as a Rerun recording."""
    from scenarios.timeline.timeline import write_timeline

    drive, candidate = _drive(settings), calibrated()
    estimate = candidate.run(drive)
    write_timeline(
        path,
        vehicle=candidate.vehicle,
        drive=drive.replace(truth={}),
        estimate=estimate,
        parameters=(),
        title="ferrari",
    )


SCENARIO = Scenario(run=run, timeline=timeline, tune=tune, picture=picture, vehicle=VEHICLE)


if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "ferrari", *sys.argv[1:]]))
