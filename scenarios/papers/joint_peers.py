"""What the joint observer is measured against, over the same drives."""

from collections.abc import Callable, Mapping

from numpy.typing import ArrayLike

from estimators.base import Estimate
from estimators.ensemble.offline_fit import OfflineFit
from estimators.ensemble.staged import StagedObserver
from estimators.ensemble.unscented import UnscentedObserver
from estimators.til.law import ParameterLaw
from estimators.til.observer import Observer
from scenarios import mass, pitch, roll_yaw
from twin import LOAD, SCALES, Drive, Twin, Vehicle

NAMES = (*LOAD, *SCALES)
Peer = Callable[[Vehicle, Drive, ArrayLike, float], Estimate]
"""Observes with a vehicle's twin a drive, given its noise (10,) and its first speed [m/s]."""


# Here the twin knows the road exactly, and its own signal is a clean instrument, unlike in the
# study of a noisy road. The mode is that of the SUV; all chosen by a drive on which all else was
# known, where the law is within 4 % after 20 s.
PITCH_LAW = ParameterLaw(
    parameter="Jyy",
    signal="pitch_acceleration",
    scale=3640.0,  # kg m2, the twin's chassis
    prior_sd=600.0,
    noise_density=0.02,
    drift=1.0,
    filter_time=0.03,
    mode_frequency=1.7,
    mode_damping=0.5,
)
# One law each, of mass, pitch, roll and yaw inertia; the others are those of the single studies of
# TiL Section 4
STAGED_LAWS = (*mass.STUDY.laws["til"], PITCH_LAW, *roll_yaw.STUDY.laws["til"])
PAPER_LAWS = tuple(
    law for study in (mass.STUDY, pitch.STUDY, roll_yaw.STUDY) for law in study.laws["til-paper"]
)


def _staged(vehicle: Vehicle, drive: Drive, noise_sd: ArrayLike, speed: float) -> Estimate:
    observer = StagedObserver(vehicle, noise_sd, STAGED_LAWS)
    observer.reset(speed, road=drive.inputs[0, 9:13])
    return observer.run(drive)


def _paper(vehicle: Vehicle, drive: Drive, noise_sd: ArrayLike, speed: float) -> Estimate:
    """All laws of the paper at once; they know no noise, and there is none for the CM."""
    observer = Observer(Twin(vehicle), PAPER_LAWS)
    observer.reset(speed)
    return observer.run(drive)


def _unscented(vehicle: Vehicle, drive: Drive, noise_sd: ArrayLike, speed: float) -> Estimate:
    observer = UnscentedObserver(vehicle, noise_sd, NAMES)
    observer.reset(speed, road=drive.inputs[0, 9:13])
    return observer.run(drive)


def _least_squares(vehicle: Vehicle, drive: Drive, noise_sd: ArrayLike, speed: float) -> Estimate:
    fit = OfflineFit(vehicle, noise_sd, NAMES)
    fit.reset(speed, road=drive.inputs[0, 9:13])
    return fit.run(drive)


NAMES = (*LOAD, *SCALES)

PEERS: Mapping[str, Peer] = {
    "staged": _staged,
    "til-paper": _paper,
    "unscented": _unscented,
    "least-squares": _least_squares,
}
