"""Brake torques a little below zero: noise or a sensor's offset, no brake that pushes."""

import numpy as np
from numpy.typing import NDArray

from twin.channels import CHANNEL

Array = NDArray[np.float64]

LARGEST_SHARE = 0.05  # of the channel's largest value, that noise may be below zero; chosen


def without_noise_below_zero(columns: dict[str, Array]) -> list[str]:
    """Clips inputs that cannot be negative, in place, where noise makes them so; sentences.

    More than noise stays as it is, and is refused by whoever uses it: a wrong sign or offset.

    Args:
        columns: (N,) by the name of the channel.
    """
    sentences = []
    for name, values in columns.items():
        if not name.startswith("brake_torque") or CHANNEL[name].low != 0.0:
            continue
        below = values < 0.0
        if not below.any() or -np.nanmin(values) > LARGEST_SHARE * np.nanmax(values):
            continue
        sentences.append(
            f"{name}: {below.sum()} samples down to {np.nanmin(values):.3g} N m count as 0: noise."
        )
        columns[name] = np.where(below, 0.0, values)
    return sentences
