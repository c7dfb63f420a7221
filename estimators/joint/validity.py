"""Which estimates of the joint observer may be relied on, and why the others may not."""

import numpy as np
from numpy.typing import NDArray

from estimators.joint.evidence import SEGMENTS
from estimators.joint.model_error import LEAST_SEGMENTS
from estimators.joint.state import Configuration, Log
from twin import PARAMETER, PARAMETERS

REASONS = (
    "",
    "too little driving so far that excites the car",
    "the standard deviation is too large a share of what was known before",
    "more than three standard deviations of the prior away from it",
    "on the bound of what the twin accepts",
)
_EARLY, _UNCERTAIN, _IMPLAUSIBLE, _BOUND = range(1, len(REASONS))
_FAR = 3.0  # standard deviations of the prior
_NEAR = 1e-3  # of a prior's standard deviation: so near to a bound is on it


def judge(
    log: Log, config: Configuration, valid_share: float
) -> tuple[NDArray[np.bool_], NDArray[np.uint8]]:
    """Validity of every estimate at every sample.

    Args:
        log: of N samples.
        config: of the observer.
        valid_share: of its prior standard deviation, below which an estimate's has to be.

    Returns:
        (N, q) whether an estimate is valid, and (N, q) why not, as an index into `REASONS`.
    """
    p, prior = config.parameter.size, config.prior
    values = np.hstack([log.parameters[:, config.parameter], log.sensor_errors])
    reason = np.zeros(log.sd.shape, dtype=np.uint8)
    names = [PARAMETERS[k] for k in config.parameter]
    low = np.array([PARAMETER[name].low for name in names])
    high = np.array([PARAMETER[name].high for name in names])
    near = _NEAR * prior[:p]
    bound = (log.parameters[:, config.parameter] <= low + near) | (
        log.parameters[:, config.parameter] >= high - near
    )
    reason[:, :p][bound] = _BOUND
    reason[np.abs(values) > _FAR * prior] = _IMPLAUSIBLE
    reason[log.sd >= valid_share * prior] = _UNCERTAIN
    reason[log.segments < LEAST_SEGMENTS] = _EARLY
    return reason == 0, reason


assert SEGMENTS // 2 >= LEAST_SEGMENTS  # merging never makes a drive too short again
