"""What surrounds a real car and no twin is told of: road, hills, crossfall, wind; as tables."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.plants.random_car import RealCar
from twin.road import iso8608_road

Array = NDArray[np.float64]
SPACING = 0.05  # of the road's table [m]
BEFORE = 10.0  # how much road lies behind the start [m]
_LONGEST = 45.0  # [m/s], mean speed for which the road is long enough
_PERIOD = 2000.0  # of the rough road [m]
_HILLS = (150.0, 230.0, 370.0, 610.0)  # wavelengths [m]; chosen
_GUST = 4.0  # correlation time of the wind [s]; chosen


class Surroundings(NamedTuple):
    """Road and wind of one drive, as compiled code takes them."""

    heights: Array  # (M, 2) of the left and right track over the distance [m]
    wind: Array  # (N, 2) along and across the axes of the world [m/s]


def surroundings(real: RealCar, n: int, dt: float, track: float) -> Surroundings:
    """Road and wind of a car over n samples; the same every time.

    Args:
        real: the car.
        n: number of samples.
        dt: sample time [s].
        track: of the car [m].
    """
    rng = np.random.default_rng((real.seed, 1))
    distance = np.arange(0.0, _LONGEST * n * dt + 2.0 * BEFORE, SPACING) - BEFORE
    heights = np.zeros((distance.size, 2))
    roughness = real.number("road")
    if roughness > 0.0:
        road = iso8608_road(rng, length=_PERIOD, road_class="A")
        heights += np.sqrt(roughness) * road.heights(distance)
    heights += (real.number("slope") * distance + _hills(real, distance, rng))[:, None]
    heights[:, 0] += 0.5 * track * real.number("crossfall")
    heights[:, 1] -= 0.5 * track * real.number("crossfall")
    return Surroundings(heights=heights, wind=_wind(real, n, dt, rng))


def _hills(real: RealCar, distance: Array, rng: np.random.Generator) -> Array:
    """(M,) heights [m] of a few waves with the slope's rms, level where they start."""
    phases = rng.uniform(0.0, 2.0 * np.pi, len(_HILLS))
    share = real.number("hills") * np.sqrt(2.0 / len(_HILLS))
    total = np.zeros_like(distance)
    for length, phase in zip(_HILLS, phases, strict=True):
        number = 2.0 * np.pi / length
        total += share / number * (np.sin(number * distance + phase) - np.sin(phase))
    return total


def _wind(real: RealCar, n: int, dt: float, rng: np.random.Generator) -> Array:
    """(N, 2) wind [m/s]: its mean and gusts of first order, drawn a tenth of a second apart."""
    coarse = np.arange(int(n * dt / 0.1) + 2) * 0.1
    keep = np.exp(-0.1 / _GUST)
    gusts = rng.standard_normal((coarse.size, 2))
    for k in range(1, coarse.size):
        gusts[k] = keep * gusts[k - 1] + np.sqrt(1.0 - keep**2) * gusts[k]
    time = np.arange(n) * dt
    columns = [
        mean + real.number("gusts") * np.interp(time, coarse, gusts[:, i])
        for i, mean in enumerate(real["wind"])
    ]
    return np.column_stack(columns)
