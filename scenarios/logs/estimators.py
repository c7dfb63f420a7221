"""The estimators that recorded drives are given to."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.base import Estimate
from estimators.joint.noise import noise_of_record
from estimators.joint.observer import JointObserver, JointSettings
from estimators.joint.real_car import REAL_CAR
from estimators.til.default_observer import default_observer
from estimators.til.observer import Observer
from estimators.til.stream import rolling_radius
from scenarios.logs.candidate import candidate_of
from scenarios.logs.guessed_priors import guessed_priors
from scenarios.logs.pieces import Prepared, lacking, measured, start_speed
from scenarios.planning.advice import missing, what_to_drive
from twin import LOAD, OUTPUTS, PARAMETER, SCALES, WHEELS, Drive, Twin, TwinError, Vehicle

Array = NDArray[np.float64]


class Found(NamedTuple):
    """What an estimator made of a log.

    Attributes:
        drive: the log in the twin's channels and steps, pieces one behind the other.
        estimate: over it.
        parameters: that were estimated.
        sd: standard deviation at the end, where the estimator knows it.
        done: sentences.
        faults: sentences, each of which makes the estimates not trustworthy.
    """

    drive: Drive
    estimate: Estimate
    parameters: tuple[str, ...]
    sd: dict[str, float]
    done: tuple[str, ...]
    faults: tuple[str, ...] = ()


def til(vehicle: Vehicle, log: Prepared) -> Found:
    """States and mass by the default observer; without torques states by the car's calibration.

    Raises:
        TwinError: an input is out of range, or the twin has blown up.
    """
    return _following(vehicle, log) if log.follows else _with_mass(vehicle, log)


def _following(vehicle: Vehicle, log: Prepared) -> Found:
    """States and sideslip with a standard deviation, by what a calibration found of the car."""
    candidate = candidate_of(vehicle)
    estimate = _joined([candidate.observe(piece) for piece in log.pieces])
    missing = [name for name in ("ay", "yaw_rate") if name not in measured(log.pieces)]
    return Found(
        drive=Drive.joined(log.pieces),
        estimate=estimate,
        parameters=(),
        sd={},
        done=(
            *(f"Without {name} the twin is not corrected by it." for name in missing),
            *estimate.notes,
        ),
    )


def _with_mass(vehicle: Vehicle, log: Prepared) -> Found:
    names = measured(log.pieces)
    default = default_observer(
        vehicle, names, mass=not lacking("mass", names), ax_noise=log.ax_noise
    )
    estimates = []
    for piece in log.pieces:
        speed = start_speed(piece, default.rolling_radius)
        if estimates:
            default.observer.restart(speed)
        else:
            default.observer.reset(speed)
        estimates.append(default.observer.run(piece))
    estimate, faults = _off_their_bounds(_joined(estimates), default.largest)
    return Found(
        drive=Drive.joined(log.pieces),
        estimate=estimate,
        parameters=default.parameters,
        sd=default.observer.parameter_sd(),
        done=default.left_out,
        faults=faults,
    )


def at_bound(values: Array, largest: float) -> NDArray[np.bool_]:
    """Where an estimate rests on its own bound, in either direction."""
    return np.abs(values) >= (1.0 - 1e-6) * largest


def _off_their_bounds(
    estimate: Estimate, largest: Mapping[str, float]
) -> tuple[Estimate, tuple[str, ...]]:
    """Not trustworthy while a parameter rests on its bound; sentences where one does at the end."""
    faults = []
    for name, bound in largest.items():
        resting = at_bound(estimate[name], bound)
        if estimate.trustworthy is not None:
            estimate = replace(estimate, trustworthy=estimate.trustworthy & ~resting)
        if resting[-1]:
            faults.append(
                f"{name} rests on the bound of its estimate, {estimate[name][-1]:.6g} "
                f"{unit_of(name)}."
            )
    return estimate, tuple(faults)


def joint(vehicle: Vehicle, log: Prepared) -> Found:
    """All load parameters, tyres, springs and dampers at once, with their covariance.

    Raises:
        TwinError: the log has no torques or long gaps, or a twin has blown up.
    """
    if log.follows:
        raise TwinError("the joint estimator needs torques; allowed: --estimator til")
    if len(log.pieces) > 1:
        raise TwinError("the joint estimator takes no gaps of this length; allowed: til")
    piece = Drive.joined(log.pieces)
    names = measured(log.pieces)
    if any(f"brake_torque_{wheel}" not in names for wheel in WHEELS):
        raise TwinError(
            "the joint estimator needs brake torques, which the map declares constant; allowed: "
            "--estimator til"
        )
    noise = np.where(
        [name in names for name in OUTPUTS], noise_of_record(piece.measurements), np.nan
    )
    priors = guessed_priors(vehicle)
    settings = JointSettings(parameters=REAL_CAR, prior_sd=priors)
    observer = JointObserver(vehicle, noise, settings)
    observer.reset(start_speed(piece, rolling_radius(Observer(Twin(vehicle), []))))
    plain = piece.replace(measurements=piece.measurements[:, : len(OUTPUTS)], output_names=OUTPUTS)
    estimate = observer.run(plain)
    parameters = (*LOAD, *SCALES)
    sd = dict(zip(estimate.estimated, estimate.sd[-1].tolist(), strict=True))
    told = what_to_drive(missing(estimate))
    if priors:
        told = (
            *told,
            f"Wider before the drive, as the car's file holds guesses: {', '.join(priors)}.",
        )
    return Found(piece, estimate, parameters, {name: sd[name] for name in parameters}, told)


ESTIMATORS: dict[str, Callable[[Vehicle, Prepared], Found]] = {"til": til, "joint": joint}


def unit_of(parameter: str) -> str:
    """Of a parameter of `twin.PARAMETERS`."""
    return PARAMETER[parameter].unit


def _joined(estimates: Sequence[Estimate]) -> Estimate:
    """Estimates over consecutive pieces as one."""
    first, together = estimates[0], {}
    for field in fields(first):
        value = getattr(first, field.name)
        if isinstance(value, np.ndarray) and field.name != "nominal":
            together[field.name] = np.concatenate([getattr(one, field.name) for one in estimates])
    notes = tuple(note for one in estimates for note in one.notes)
    return replace(first, **together, notes=notes)
