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
from estimators import single_track, static_map
from estimators.speed_follower import SpeedFollower
from scenarios import calibrate
from scenarios.calibrate import cut
from scenarios.candidate import Candidate
from scenarios.catalogue import Scenario, Settings
from scenarios.ferrari_log import PARTS, data_file, load, part
from scenarios.result import Result, Row
from twin import Drive, TwinError, Vehicle

Array = NDArray[np.float64]

VEHICLE = "ferrari_250lm"
CALIBRATION = "ferrari_250lm.toml"
CALIBRATED_ON, SCORED_ON = PARTS
# Freed by `tune`, each with a reason to be what the files do not know; cross-validated within the
# first two thirds
FREE = (
    *("front_tyre_friction", "rear_tyre_friction"),
    *("front_cornering_stiffness", "rear_cornering_stiffness"),
    *("front_load_of_largest_stiffness", "rear_load_of_largest_stiffness"),
    *("rear_relaxation", "combined_slip", "slip_stiffness", "front_anti_roll"),
    *("cm_x", "cm_y", "Jzz", "steering_ratio", "steering_offset"),
    *("brake_front", "locking", "sideslip_offset", "sideslip_lever"),
    *("yaw_rate_to_yaw_rate", "yaw_rate_to_vy"),
)
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


def tune(estimator: str, evaluations: int, jobs: int, path: Path) -> Result:
    """Calibrates the twin on the first two thirds of the log.

    Raises:
        TwinError: another estimator is asked for, or the log is not there.
    """
    if estimator != "til":
        raise TwinError(f"tune: estimator is {estimator!r}; allowed: til")
    file = data_file()
    drive = load(file)
    task = calibrate.Task(
        candidate=nominal(),
        free=FREE,
        signals=SIGNALS,
        drive=cut(drive, part(drive, CALIBRATED_ON)),
    )
    return calibrate.run(task, file, path, jobs=jobs, evaluations=evaluations)


def _drive(settings: Settings) -> Drive:
    if not math.isnan(settings.snr):
        raise TwinError(f"ferrari: snr is {settings.snr:g}; the log is measured: it takes none")
    if settings.duration is not None:
        raise TwinError("ferrari: takes no duration; its parts are shares of the whole log")
    return load(data_file())


def timeline(settings: Settings, path: Path) -> None:
    """The calibrated twin over the log as a Rerun recording."""
    from scenarios.timeline import write_timeline

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


SCENARIO = Scenario(run=run, timeline=timeline, tune=tune, vehicle=VEHICLE)


if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "ferrari", *sys.argv[1:]]))
