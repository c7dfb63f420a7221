"""The double lane change of ISO 3888-1, as it stands or stretched to the speed."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from scenarios.driving.path import STEP, Path

Array = NDArray[np.float64]

# ISO 3888-1:2018: lengths of the entry lane, the way across, the other lane, the way back and the
# exit lane with the section behind it [m]; the other lane lies 3.5 m to the left.
ENTRY, ACROSS, OTHER, BACK, EXIT = 15.0, 30.0, 25.0, 25.0, 30.0
OFFSET = 3.5
# Width of entry, other and exit lane over that of the vehicle, to which comes 0.25 m
WIDTHS = (1.1, 1.2, 1.3)
MARGIN = 0.25
# The bend of the way across is at most so many times offset over length squared
SHARPEST = 84.0 / (5.0 * np.sqrt(5.0))


def stretch(speed: float, lateral: float) -> float:
    """By what the lengths of the standard are multiplied for a lateral acceleration at a speed.

    Args:
        speed: where the way across begins [m/s].
        lateral: greatest on the way across [m/s2].
    """
    return float(speed * np.sqrt(SHARPEST * OFFSET / lateral) / ACROSS)


def length(stretched: float = 1.0) -> float:
    """Of the whole lane change, along the lanes [m]."""
    return stretched * (ENTRY + ACROSS + OTHER + BACK + EXIT)


def speeds_through(speed: float, path: Path) -> Array:
    """(M,) at most along a lane change, for a driver who brakes on the way [m/s].

    He enters with the given speed, brakes in the other lane so that the shorter way back takes no
    more lateral acceleration than the way across, and brakes to half the speed behind it.

    Args:
        speed: on entering [m/s].
        path: from `lane_change`.
    """
    sections = np.cumsum([0.0, ENTRY + ACROSS, OTHER, BACK, EXIT]) / length()
    shares = np.array([1.0, 1.0, BACK / ACROSS, BACK / ACROSS, 0.5])
    along = path.distance / path.distance[-1]
    return speed * np.sqrt(np.interp(along, sections, shares**2))


def lanes(width: float, stretched: float = 1.0) -> Array:
    """(3, 4) entry, other and exit lane: begin, end, right and left edge [m].

    The lanes' right edges are in line, as the standard has them, but for the other lane, which
    is 3.5 m to the left; y = 0 is the middle of the entry lane.

    Args:
        width: of the vehicle, without mirrors [m].
        stretched: see `stretch`; 1 for the standard itself.
    """
    first, second, third = (share * width + MARGIN for share in WIDTHS)
    right = -0.5 * first
    back = ENTRY + ACROSS + OTHER + BACK
    edges = [
        [0.0, ENTRY, right, right + first],
        [ENTRY + ACROSS, back - BACK, right + OFFSET, right + OFFSET + second],
        [back, back + EXIT, right, right + third],
    ]
    return np.array(edges) * [stretched, stretched, 1.0, 1.0]


def lane_change(stretched: float = 1.0, step: float = STEP) -> Path:
    """The line of a driver through the lanes: straight in them, a polynomial of degree 7 between.

    Args:
        stretched: see `stretch`.
        step: of the path [m].
    """
    x = np.arange(0.0, length(stretched) + 0.05, 0.05)
    starts = np.array([ENTRY, ENTRY + ACROSS + OTHER]) * stretched
    spans = np.array([ACROSS, BACK]) * stretched
    y, slope, bend = np.zeros((3, x.size))
    for sign, start, span in zip((1.0, -1.0), starts, spans, strict=True):
        u = np.clip((x - start) / span, 0.0, 1.0)
        y += sign * OFFSET * u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3)
        slope += sign * OFFSET / span * 140.0 * (u * (1.0 - u)) ** 3
        bend += sign * OFFSET / span**2 * 420.0 * (u * (1.0 - u)) ** 2 * (1.0 - 2.0 * u)
    return _by_distance(x, y, slope, bend, step)


def _by_distance(x: Array, y: Array, slope: Array, bend: Array, step: float) -> Path:
    """The curve y(x) at equal steps along it, given with its first two derivatives."""
    rate = np.sqrt(1.0 + slope**2)
    distance = CubicSpline(x, rate).antiderivative()(x)
    at = step * np.arange(int(distance[-1] / step) + 1)
    columns = np.column_stack([x, y, np.arctan(slope), bend / rate**3])
    return Path(step, *(np.ascontiguousarray(c) for c in CubicSpline(distance, columns)(at).T))
