"""The plan of a calibration by command line: what is fitted to which parts of which logs."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.speed_follower import TORQUES
from scenarios.calibration.task import Task, has_signal
from scenarios.logs.candidate import Candidate
from scenarios.logs.follower import driven
from scenarios.logs.free_parameters import (
    DEFAULTS,
    DEFAULTS_OF_SIDESLIP,
    FREE,
    GAINS,
    NOISES,
    SIDESLIP_SD,
)
from scenarios.logs.pieces import prepared
from twin import Drive, TwinError, Vehicle
from twin.car.signals import signals_of

HELD_OUT = 0.25  # of each log, at its end, that a first fit does not see; chosen
INERTIA_SD = 0.3  # of the moments that the files say; chosen: rules by mass and size are as good
SHORTEST = 2.0  # [s] of drive per number that is freed; chosen


class Plan(NamedTuple):
    """What is fitted to logs.

    Attributes:
        task: over all but the last share of each log.
        held_out: those shares.
        whole: both in one.
    """

    task: Task
    held_out: tuple[Drive, ...]
    whole: tuple[Drive, ...]


def plan_of(
    logs: Sequence[Path],
    map_path: Path | None,
    vehicle: str,
    free: Sequence[str],
    signals: Sequence[str],
    between: tuple[float | None, float | None] = (None, None),
    held_out: float = HELD_OUT,
    prior_sd: Mapping[str, float] | None = None,
) -> Plan:
    """A task of the command line: the twin runs free, but for gains that are freed.

    A constant offset of each fitted signal of an IMU is freed along. Where the sideslip is measured
    and torques are not, the twin runs in the observer that `til estimate` uses: with constant gains
    if one of them is freed, else with scheduled ones, whose noises are freed along.

    Args:
        logs: recorded drives, read as `til estimate` reads them.
        map_path: which channels of the logs are ours; None: they are drives of this project.
        vehicle: a car of the project by its name, or an MJCF or TOML file.
        free: what is fitted, see `Task`; nothing: what `defaults` says.
        signals: what to, see `Task`; nothing: what `defaults` says.
        between: the logs' times that are used [s]; None: from their start, to their end.
        held_out: share of each log, at its end, that is not fitted at first.
        prior_sd: how far a parameter is believed to lie from the car's file, by name; the others
            as `FREE` says.

    Raises:
        TwinError: a file is missing or broken, nothing lies between the times, or a belief is not
            positive or of something else.
    """
    car = Vehicle.load(vehicle)
    dt = float(car.compile().opt.timestep)
    first, last = between
    used, kept, whole = [], [], []
    for log in logs:
        drive = Drive.load(log, map_path, signals_of(car))
        for piece in prepared(_between(drive, first, last), dt).pieces:
            end = round((1.0 - held_out) * len(piece))
            whole.append(piece)
            used.append(cut(piece, slice(0, end)))
            if len(piece) - end > 1:
                kept.append(cut(piece, slice(end, len(piece))))
    follows = any(not set(TORQUES) & set(piece.input_names) for piece in used)
    signals = signals or default_signals(used, follows=follows)
    free = free or default_free(signals)
    offsets = [f"{s}_offset" for s in signals if s != "sideslip" and f"{s}_offset" in FREE]
    blocks = sum(len(piece) for piece in used) * dt / SHORTEST
    if blocks <= len(free) + len(offsets) + 1:  # too short a drive for more
        offsets = []
    scheduled = follows and "sideslip" in signals and not set(GAINS) & set(free)
    freed = tuple(dict.fromkeys((*free, *offsets, *(NOISES if scheduled else ()))))
    task = Task(
        candidate=Candidate(
            vehicle=car,
            values=_known(car, scheduled=scheduled),
            follower=driven(car),
            scheduled=scheduled,
        ),
        free=freed,
        signals=tuple(signals),
        drives=tuple(used),
        prior_sd={**_priors(car), **_beliefs(prior_sd or {}, freed)},
    )
    return Plan(task, tuple(kept), tuple(whole))


def _known(car: Vehicle, *, scheduled: bool) -> dict[str, float]:
    """What a former calibration says, but for gains where they are scheduled now."""
    gone = {*GAINS, SIDESLIP_SD} if scheduled else set[str]()
    return {name: value for name, value in car.calibration if name in FREE and name not in gone}


def default_signals(drives: Sequence[Drive], *, follows: bool) -> tuple[str, ...]:
    """The measured sideslip, if there is one and the twin follows the speed; else ay, yaw rate."""
    if follows and any(has_signal(drive, "sideslip") for drive in drives):
        return ("sideslip",)
    return "ay", "yaw_rate"


def default_free(signals: Sequence[str]) -> tuple[str, ...]:
    """What a data sheet knows least of, as far as these signals show it."""
    return (*DEFAULTS, *(DEFAULTS_OF_SIDESLIP if "sideslip" in signals else ()))


def _beliefs(prior_sd: Mapping[str, float], free: Sequence[str]) -> Mapping[str, float]:
    for name, sd in prior_sd.items():
        if name not in free:
            raise TwinError(
                f"calibrate: --prior of {name!r}; allowed: of what is free: {', '.join(free)}"
            )
        if not 0.0 < sd < np.inf:
            raise TwinError(f"calibrate: --prior of {name} is {sd:g}; allowed: a positive number")
    return prior_sd


def _priors(vehicle: Vehicle) -> dict[str, float]:
    """How far the inertia of a car is believed to lie from its file's: what a guess is worth."""
    moments = np.diag(vehicle.chassis().inertia)
    believed = {
        f"J{axis}{axis}": INERTIA_SD * float(m) for axis, m in zip("xyz", moments, strict=True)
    }
    return {name: min(sd, FREE[name].prior_sd) for name, sd in believed.items()}


def _between(drive: Drive, first: float | None, last: float | None) -> Drive:
    used = (drive.time >= (-np.inf if first is None else first)) & (
        drive.time <= (np.inf if last is None else last)
    )
    if np.count_nonzero(used) < 2:
        raise TwinError(
            f"calibrate: no samples lie between {first} and {last} s; allowed: times from "
            f"{drive.time[0]:g} to {drive.time[-1]:g} s"
        )
    return cut(drive, used)


def cut(drive: Drive, samples: slice | NDArray[np.bool_]) -> Drive:
    """These samples of a drive."""
    return drive.replace(
        time=drive.time[samples],
        inputs=drive.inputs[samples],
        measurements=drive.measurements[samples],
        truth={name: values[samples] for name, values in drive.truth.items()},
    )
