"""Cramer-Rao bounds at the load of a case's real vehicle, for what an estimator uses of a drive."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimators.identifiability.cramer_rao import cramer_rao, sensitivities
from estimators.til.law import ParameterLaw
from scenarios.experiment.experiment import Case
from twin import LOAD, OUTPUTS, Drive, Twin, Vehicle

Array = NDArray[np.float64]

WHEEL_SPEEDS = OUTPUTS[6:]


def sensitivities_at(case: Case, drive: Drive, parameters: Sequence[str]) -> Array:
    """(p, N, 10) what parameters change in the outputs, around the real vehicle's load."""
    load = case.load()
    at = {name: load[name] for name in LOAD}
    speed = float(drive.truth["vx"][0])
    return sensitivities(Twin(Vehicle.load(case.twin)), drive, parameters, at, speed=speed)


def using(sd: Array, channels: Sequence[str]) -> Array:
    """The (10,) standard deviations, with NaN for all other channels."""
    return np.where(np.isin(OUTPUTS, channels), sd, np.nan)


def is_moving(drive: Drive, least: float) -> NDArray[np.bool_]:
    """(N,) whether the mean wheel speed is at least this [rad/s]; zero: always."""
    if least == 0.0:
        return np.ones(len(drive), dtype=np.bool_)
    return np.mean([drive.channel(name) for name in WHEEL_SPEEDS], axis=0) >= least


def law_limit(law: ParameterLaw, sensitivity: Array, drive: Drive, sd: Array) -> float:
    """The bound on one parameter from what its law uses of a drive.

    That is one signal, of a car that moves, with an offset if the law fits one along.

    Args:
        law: of the parameter.
        sensitivity: (1, N, 10) to it.
        drive: without noise.
        sd: (10,) of the noise.
    """
    bound = cramer_rao(
        [law.parameter],
        sensitivity[:, is_moving(drive, law.least_wheel_speed)],
        using(sd, [law.output]),
        free_offsets=law.offset_sd > 0.0,
    )
    return float(bound.single[0])


def percent(sd: float, variation: float) -> float:
    """A standard deviation in % of what is to be found; NaN where nothing is."""
    return 100.0 * sd / abs(variation) if variation else float("nan")
