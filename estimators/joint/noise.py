"""The white noise of a record's channels, from the record itself."""

import numpy as np
from numpy.typing import NDArray

from twin import CHANNEL, OUTPUTS

Array = NDArray[np.float64]


def noise_of_record(measurements: Array) -> Array:
    """Standard deviation of each channel's white noise, of a sample.

    Second differences leave white noise with six times its variance and little of the motion; their
    median resists the rest. Not less than what no sensor is better than (`twin.CHANNEL`).

    Args:
        measurements: (N, k) of the first k of `twin.OUTPUTS`; NaN where there is none.

    Returns:
        (k,) standard deviations.
    """
    bends = np.abs(np.diff(measurements[:, : len(OUTPUTS)], n=2, axis=0))
    bends = np.where(np.isfinite(bends), bends, 0.0)
    least = [CHANNEL[name].noise_floor for name in OUTPUTS[: bends.shape[1]]]
    return np.maximum(1.4826 * np.median(bends, axis=0) / np.sqrt(6.0), least)
