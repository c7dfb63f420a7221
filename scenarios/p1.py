"""Measured wheel forces: sideslip and tyre forces of Stanford's P1 (`til run p1`).

P1 is an electric research car whose front wheels carry force transducers. Its drives lie in the
folder that STANFORD_P1 names, one Parquet file each; they are not shipped. A ramp steer and a
straight line calibrate the twin and its rivals on the measured sideslip alone; a step steer and
another straight line are estimated. Forces are never fitted: on the second half of the ramp they
come from a twin that was calibrated on the first half.
"""

import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

import models
from estimators.base import Estimate
from estimators.benchmarks import bicycle_ekf, static_map
from scenarios.calibration import calibrate
from scenarios.calibration.plan import cut
from scenarios.calibration.task import Task
from scenarios.experiment.experiment import Experiment, Study
from scenarios.experiment.metrics import rms
from scenarios.experiment.result import Result, Row
from scenarios.logs.candidate import Candidate
from scenarios.logs.fits import fit
from scenarios.logs.follower import driven
from scenarios.logs.free_parameters import NOISES
from scenarios.logs.pieces import prepared
from scenarios.report.pictures import figure
from twin import Drive, TwinError, Vehicle

Array = NDArray[np.float64]

VARIABLE = "STANFORD_P1"
VEHICLE, MAP = "stanford_p1", "maps/stanford_p1.toml"
RAMP, STRAIGHT = "RAMP_STEER_L", "STRAIGHT_LINE_1"
SCORED = ("STEP_STEER", "STRAIGHT_LINE_0")
FREE = (
    *("front_cornering_stiffness", "rear_cornering_stiffness"),
    *("front_tyre_friction", "rear_tyre_friction"),
    *("steering_offset", "sideslip_offset", "ay_offset", "yaw_rate_offset"),
)
PRIOR = {
    "steering_offset": 0.3,
    "sideslip_offset": 0.01,
    "ay_offset": 0.3,
    "yaw_rate_offset": 0.01,
}
EVALUATIONS = 10
RIVALS_RATE = 100.0  # [Hz], at which the rival is fitted, for speed
# Of its users: mass, axles from the centre of mass, yaw inertia, cornering stiffness per load
BICYCLE = bicycle_ekf.Bicycle(
    mass=1724.0, front=1.35, rear=1.15, yaw_inertia=1300.0, front_stiffness=9.6,
    rear_stiffness=14.8, steering_ratio=16.0,
)  # fmt: skip
# The navigation system's channels; on one run they are late against yaw rate and steering
NAVIGATION = ("axG", "ayG", "lat_vel", "long_vel", "body_slip")
LATE = 0.2  # [s] of a_y against v_x r, from which that is no property of tyres
SMOOTH = 0.2  # [s] over which measured forces are averaged: the wheels' vibrations
SLOWEST = 2.0  # [m/s]; slower, the measured sideslip is noise
REST = 0.05  # [m/s]
_NAMED = ("fx", "fy", "fz")


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """One drive.

    Attributes:
        name: of the file.
        drive: in the twin's channels and steps.
        forces: (N,) [N] by name, as fy_fl, measured and averaged over `SMOOTH`.
        late: of the navigation system's channels, already made up for [s].
    """

    name: str
    drive: Drive
    forces: Mapping[str, Array]
    late: float


def read(name: str) -> Log:
    """A drive of the folder.

    Raises:
        TwinError: STANFORD_P1 names no folder with it.
    """
    place = os.environ.get(VARIABLE, "")
    path = Path(place, f"{name}.parquet")
    if not place or not path.is_file():
        raise TwinError(f"{VARIABLE}: is {place!r}; allowed: a folder with {name}.parquet")
    table = pq.read_table(path)
    columns = {n: table[n].to_numpy().astype(np.float64) for n in table.column_names}
    late = _late(columns)
    for channel in NAVIGATION:
        columns[channel] = np.interp(columns["time"] + late, columns["time"], columns[channel])
    vehicle = Vehicle.load(VEHICLE)
    drive = Drive.from_frame(columns, models.path(MAP))
    (piece,) = prepared(drive, float(vehicle.compile().opt.timestep)).pieces
    forces = {
        f"{kind}_{wheel}": np.interp(
            piece.time, columns["time"], _smooth(columns[f"F{kind[1]}_{wheel.upper()}"], columns)
        )
        for kind in _NAMED
        for wheel in ("fl", "fr")
    }
    piece = piece.replace(truth={**piece.truth, **forces})
    return Log(name=name, drive=piece, forces=forces, late=late)


def _late(columns: Mapping[str, Array]) -> float:
    """By how much the navigation system is late against the yaw rate [s]; 0 if nothing shows it."""
    side, step = columns["long_vel"] * columns["yaw_rate"], 10
    if side.std() < 0.2:
        return 0.0
    dt = step * float(np.median(np.diff(columns["time"])))
    good = np.ones(side[::step].size, dtype=np.bool_)
    lag = fit(columns["ayG"][::step], side[::step], good, dt).lag
    return lag if lag > LATE else 0.0


def _smooth(values: Array, columns: Mapping[str, Array]) -> Array:
    size = max(round(SMOOTH / float(np.median(np.diff(columns["time"])))), 1)
    padded = np.pad(values, (size // 2, size - 1 - size // 2), mode="edge")
    return np.convolve(padded, np.full(size, 1.0 / size), "valid")


def calibrated(drives: Sequence[Drive], jobs: int) -> Candidate:
    """The twin, calibrated on the measured sideslip of drives with the noises of its observer."""
    vehicle = Vehicle.load(VEHICLE)
    task = Task(
        candidate=Candidate(vehicle=vehicle, follower=driven(vehicle), scheduled=True),
        free=(*FREE, *NOISES),
        signals=("sideslip",),
        drives=tuple(drives),
        prior_sd=PRIOR,
    )
    found = calibrate.calibrate(task, jobs=jobs, evaluations=EVALUATIONS)
    return calibrate.with_band(task, found.values).at(found.values)


def run(seeds: Sequence[int], jobs: int, duration: float | None) -> Result:
    """Calibrates, estimates and scores sideslip and forces."""
    start = time.perf_counter()
    if duration is not None:
        raise TwinError("p1: takes no duration; the drives are used whole")
    logs = {name: read(name) for name in (RAMP, STRAIGHT, *SCORED)}
    known = [logs[RAMP].drive, logs[STRAIGHT].drive]
    twin = calibrated(known, jobs)
    bicycle = _bicycle(known)
    rows = []
    for name in SCORED:
        log, found = logs[name], twin.observe(logs[name].drive)
        rows += _sideslip_rows(log, "til", found.sideslip, found.sideslip_sd)
        rival = bicycle_ekf.BicycleFilter(bicycle).run(log.drive)
        rows += _sideslip_rows(log, "bicycle-ekf", rival.sideslip, rival.sideslip_sd)
        rows += _sideslip_rows(log, "static-map", _mapped(known, log.drive), None)
        rows += _force_rows(log.name, log.forces, found)
    rows += _second_half(logs, jobs)
    rows += _at_rest(logs[STRAIGHT])
    late = [f"{log.name}: the navigation system is {log.late:.2f} s late." for log in logs.values()]
    return Result(
        name="p1",
        settings={
            "seeds": list(seeds),
            "jobs": jobs,
            "duration": duration,
            "notes": [line for line, log in zip(late, logs.values(), strict=True) if log.late],
        },
        seconds=time.perf_counter() - start,
        rows=rows,
    )


def _bicycle(known: Sequence[Drive]) -> bicycle_ekf.Bicycle:
    """The rival, fitted to the known drives at `RIVALS_RATE`."""
    free = [name for name in bicycle_ekf.FREE if name not in ("lever", "brake_front", "height")]
    slow = [cut(one, slice(None, None, round(1.0 / one.dt / RIVALS_RATE))) for one in known]
    return bicycle_ekf.fit_filter(BICYCLE, slow, free, evaluations=EVALUATIONS)[0]


def _mapped(known: Sequence[Drive], drive: Drive) -> Array:
    """The static map's sideslip, fitted to the known drives."""
    inputs = [static_map.map_inputs(one) for one in known]
    ay, yaw_rate, speed = (np.concatenate(column) for column in zip(*inputs, strict=True))
    truth = np.concatenate([one.truth["sideslip"] for one in known])
    fitted = static_map.fit(ay, yaw_rate, np.maximum(speed, SLOWEST), truth)
    ay, yaw_rate, speed = static_map.map_inputs(drive)
    return static_map.predict(fitted, ay, yaw_rate, np.maximum(speed, SLOWEST))


def _second_half(logs: Mapping[str, Log], jobs: int) -> list[Row]:
    """Forces on the second half of the ramp, of a twin calibrated on its first half."""
    log = logs[RAMP]
    middle = len(log.drive) // 2
    known = [cut(log.drive, slice(0, middle)), logs[STRAIGHT].drive]
    rest = cut(log.drive, slice(middle, len(log.drive)))
    forces = {name: values[middle:] for name, values in log.forces.items()}
    found = calibrated(known, jobs).observe(rest)
    return _force_rows(f"{RAMP}, second half", forces, found)


def _sideslip_rows(log: Log, estimator: str, sideslip: Array, sd: Array | None) -> list[Row]:
    moves = log.drive.channel("vx") > SLOWEST
    error = np.degrees(sideslip - log.drive.truth["sideslip"])[moves]
    rows = [_row(log.name, "sideslip", "rmse", "deg", rms(error), estimator)]
    if sd is not None:
        inside = np.abs(error) < 2.0 * np.degrees(sd[moves])
        rows.append(_row(log.name, "sideslip", "coverage", "1", float(inside.mean()), estimator))
    return rows


def _force_rows(case: str, measured: Mapping[str, Array], found: Estimate) -> list[Row]:
    """Errors of the front axle's forces, and of both wheels' loads, in N and % of their range."""
    rows = []
    pairs = {
        "fx_front": ([measured["fx_fl"] + measured["fx_fr"]], [found["fx_fl"] + found["fx_fr"]]),
        "fy_front": ([measured["fy_fl"] + measured["fy_fr"]], [found["fy_fl"] + found["fy_fr"]]),
        "fz_wheel": ([measured["fz_fl"], measured["fz_fr"]], [found["fz_fl"], found["fz_fr"]]),
    }
    for quantity, (truth, estimate) in pairs.items():
        error = rms(np.concatenate(estimate) - np.concatenate(truth))
        share = 100.0 * error / float(np.ptp(np.concatenate(truth)))
        rows.append(_row(case, quantity, "rmse", "N", error, "til"))
        rows.append(_row(case, quantity, "rmse_of_range", "%", share, "til"))
    return rows


def _at_rest(log: Log) -> list[Row]:
    """The front axle's load at rest, measured and of the twin's file."""
    rest = np.abs(log.drive.channel("vx")) < REST
    if not rest.any():
        return []
    measured = float((log.forces["fz_fl"] + log.forces["fz_fr"])[rest].mean())
    nominal = Vehicle.load(VEHICLE).figures.axle_load[0]
    return [
        _row("at rest", "front axle load", "measured", "N", measured, "transducers"),
        _row("at rest", "front axle load", "nominal", "N", nominal, "car file"),
    ]


def _row(case: str, quantity: str, metric: str, unit: str, value: float, estimator: str) -> Row:
    return Row.over_seeds(
        [value], case=case, quantity=quantity, metric=metric, unit=unit, estimator=estimator
    )


def picture(path: Path, jobs: int) -> None:
    """Sideslip with band and rival on the step steer; forces on it and on the ramp."""
    logs = {name: read(name) for name in (RAMP, STRAIGHT, SCORED[0])}
    known = [logs[RAMP].drive, logs[STRAIGHT].drive]
    twin = calibrated(known, jobs)
    bicycle = _bicycle(known)
    step, ramp = logs[SCORED[0]], logs[RAMP]
    found, on_ramp = twin.observe(step.drive), twin.observe(ramp.drive)
    rival = bicycle_ekf.BicycleFilter(bicycle).run(step.drive)
    assert found.sideslip_sd is not None
    title = "Stanford P1: step steer (above), ramp steer (below)"
    with figure(path, title=title, rows=4, shared=False) as axes:
        at, truth = step.drive.time, np.degrees(step.drive.truth["sideslip"])
        slip, sd = np.degrees(found.sideslip), np.degrees(found.sideslip_sd)
        axes[0].fill_between(at, slip - 2.0 * sd, slip + 2.0 * sd, alpha=0.25, label="til, 2 sd")
        axes[0].plot(at, slip, lw=1.0, label="til")
        axes[0].plot(at, np.degrees(rival.sideslip), lw=0.8, label="bicycle EKF")
        axes[0].plot(at, truth, "k", lw=1.0, label="measured")
        axes[0].set(ylabel="sideslip [deg]")
        for axis, log, one in ((axes[1], step, found), (axes[2], ramp, on_ramp)):
            axis.plot(log.drive.time, 1e-3 * (one["fy_fl"] + one["fy_fr"]), lw=1.0, label="til")
            axis.plot(
                log.drive.time, 1e-3 * (log.forces["fy_fl"] + log.forces["fy_fr"]), "k", lw=1.0,
                label="measured",
            )  # fmt: skip
            axis.set(ylabel="F_y, front axle [kN]")
        for wheel, colour in (("fl", "C0"), ("fr", "C1")):
            axes[3].plot(ramp.drive.time, 1e-3 * on_ramp[f"fz_{wheel}"], colour, lw=1.0)
            axes[3].plot(ramp.drive.time, 1e-3 * ramp.forces[f"fz_{wheel}"], colour, ls=":")
        axes[3].set(ylabel="F_z fl, fr [kN], dotted: measured", xlabel="time [s]")
        for axis in axes[:3]:
            axis.legend(ncols=4, fontsize=7)


EXPERIMENT = Experiment(name="p1", quantities=("sideslip",), study=Study(run, picture))


if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "p1", *sys.argv[1:]]))
