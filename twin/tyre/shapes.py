"""Functions that tyre models are put together from, compiled."""

from typing import Any

from numba import njit

from twin.compiled.elementary import atan, clip, exp
from twin.compiled.simd import inlined, minimum, sqrt

Tyre = Any  # numpy.void, whose fields compiled code reads as attributes

compiled = njit(cache=True, nogil=True, error_model="numpy")

ROLLING_SPEED = 0.1  # [m/s], chosen: below it rolling resistance and trail fade out
LEAST_SHARE = 0.05  # of a factor that the formula could drive to zero or beyond, chosen


@inlined
def bend(x, e):
    """Returns the inner angle of the Magic Formula, its curvature E limited to 1. (4.E14)."""
    return atan(x - minimum(e, 1.0) * (x - atan(x)))


@inlined
def cos_arctan(x):
    """Returns cos(arctan(x))."""
    return 1.0 / sqrt(1.0 + x * x)


@inlined
def sin_2_arctan(x):
    """Returns sin(2 arctan(x))."""
    return 2.0 * x / (1.0 + x * x)


@inlined
def power(x, exponent):
    """Returns x^exponent for x from 0.001 to 1000, its logarithm by Halley's method."""
    logarithm = 2.0 * (x - 1.0) / (x + 1.0)
    for _ in range(6):
        reached = exp(logarithm)
        logarithm += 2.0 * (x - reached) / (x + reached)
    return exp(exponent * logarithm)


@inlined
def direction_of_travel(vx):
    """Returns the direction of travel, from -1 to 1, smooth about standstill."""
    x = clip(vx / ROLLING_SPEED, -1.0, 1.0)
    return 0.5 * x * (3.0 - x * x)
