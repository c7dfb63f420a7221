"""What the joint observer is measured against, over the same drives."""

from collections.abc import Callable, Mapping

from numpy.typing import ArrayLike

from estimators.estimate import Estimate
from estimators.law import ParameterLaw
from estimators.observer import Observer
from estimators.offline_fit import offline_fit
from estimators.staged import staged
from estimators.unscented import unscented
from scenarios import mass, pitch, roll_yaw
from twin import PARAMETERS, Drive, Twin, Vehicle

Peer = Callable[[Vehicle, Drive, ArrayLike, float], Estimate]
"""Observes with a vehicle's twin a drive, given its noise (10,) and its speed at the start [m/s]."""


def laws(estimator: str) -> tuple[ParameterLaw, ...]:
    """Those of mass, pitch, roll and yaw inertia in the studies of TiL Section 4."""
    studies = (mass.STUDY, pitch.STUDY, roll_yaw.STUDY)
    return tuple(law for study in studies for law in study.laws[estimator])


def _staged(vehicle: Vehicle, drive: Drive, noise_sd: ArrayLike, speed: float) -> Estimate:
    return staged(vehicle, drive, noise_sd, laws("til"), speed=speed)


def _paper(vehicle: Vehicle, drive: Drive, noise_sd: ArrayLike, speed: float) -> Estimate:
    """All laws of the paper at once; they know no noise, and there is none for the CM."""
    observer = Observer(Twin(vehicle), laws("til-paper"))
    observer.reset(speed)
    return observer.run(drive)


def _unscented(vehicle: Vehicle, drive: Drive, noise_sd: ArrayLike, speed: float) -> Estimate:
    return unscented(vehicle, drive, noise_sd, PARAMETERS, speed=speed)


def _least_squares(vehicle: Vehicle, drive: Drive, noise_sd: ArrayLike, speed: float) -> Estimate:
    return offline_fit(vehicle, drive, noise_sd, PARAMETERS, speed=speed)


PEERS: Mapping[str, Peer] = {
    "staged": _staged,
    "til-paper": _paper,
    "unscented": _unscented,
    "least-squares": _least_squares,
}
