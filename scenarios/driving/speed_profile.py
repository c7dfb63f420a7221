"""How fast a car can go along a path: grip, engine, brakes and air, forwards and backwards."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from scenarios.driving.path import Path
from twin.stepping import AIR_DENSITY

Array = NDArray[np.float64]

GRAVITY = 9.81  # [m/s2]
# The pedals move over so many metres: the profile is smoothed over them, never upwards; chosen.
SMOOTHING = 15.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a driver asks of a car at most, on a level road.

    Attributes:
        lateral, accelerating, braking: of the tyres, the half axes of the ellipse of friction,
            without downforce [g].
        speed: [m/s].
        power: of the engine at the wheels [W].
        mass: of the whole car [kg].
        drag_area: c_D A [m2].
        downforce_area: -c_L A of both axles [m2]; downforce widens the ellipse.
    """

    lateral: float
    accelerating: float
    braking: float
    speed: float
    power: float
    mass: float
    drag_area: float
    downforce_area: float = 0.0


class Course(NamedTuple):
    """A path and how fast it is driven, as compiled code takes it; see `driving.path.Path`."""

    step: float
    x: Array
    y: Array
    heading: Array
    curvature: Array
    speed: Array  # (M,) wanted [m/s]
    acceleration: Array  # (M,) along the path, wanted [m/s2]


def course_of(path: Path, limits: Limits, *, start: float, ceiling: ArrayLike = np.inf) -> Course:
    """The fastest way along a path that keeps to the limits, in smooth pedals.

    Args:
        path: to follow.
        limits: of the car.
        start: speed at the first point [m/s], lowered to what the path allows.
        ceiling: (M,) or one speed that is not exceeded [m/s].
    """
    ceilings = np.broadcast_to(np.minimum(ceiling, limits.speed), path.x.shape)
    energy = _fastest(_constants(limits), path.step, path.curvature, ceilings, start)
    energy = _smoothed(energy, round(SMOOTHING / path.step))
    return Course(*path, np.sqrt(2.0 * energy), np.gradient(energy, path.step))


def times(course: Course) -> Array:
    """(M,) when a car that keeps to the course is at its points [s]."""
    pace = 1.0 / course.speed
    return np.concatenate([[0.0], np.cumsum(0.5 * course.step * (pace[1:] + pace[:-1]))])


class _Constants(NamedTuple):
    """Limits over the mass, air forces as accelerations over squared speed."""

    lateral: float
    accelerating: float
    braking: float
    power: float
    drag: float
    downforce: float  # over g: the share by which grip grows


def _constants(limits: Limits) -> _Constants:
    air = 0.5 * AIR_DENSITY / limits.mass
    return _Constants(
        GRAVITY * limits.lateral,
        GRAVITY * limits.accelerating,
        GRAVITY * limits.braking,
        limits.power / limits.mass,
        air * limits.drag_area,
        air * limits.downforce_area / GRAVITY,
    )


def _smoothed(energy: Array, points: int) -> Array:
    """Lowest over a window, then the mean over it twice: smooth, and nowhere higher."""
    from scipy.ndimage import minimum_filter1d, uniform_filter1d

    size = 2 * (points // 2) + 1
    lowest = minimum_filter1d(energy, 2 * size - 1, mode="nearest")
    mean = uniform_filter1d(lowest, size, mode="nearest")
    return uniform_filter1d(mean, size, mode="nearest")


@njit(cache=True)
def _fastest(limits, step, curvature, ceiling, start):
    """Kinetic energy per mass at each point [m2/s2]: corners, then braking, then the engine."""
    n = curvature.size
    energy = np.empty(n)
    for i in range(n):
        bend = abs(curvature[i]) - limits.lateral * limits.downforce
        fastest = math.sqrt(limits.lateral / bend) if bend > 0.0 else math.inf
        energy[i] = 0.5 * min(fastest, ceiling[i]) ** 2
    energy[0] = min(energy[0], 0.5 * start**2)
    for i in range(n - 2, -1, -1):
        e = energy[i + 1]
        deceleration = limits.braking * _grip_left(limits, curvature[i + 1], e)
        energy[i] = min(energy[i], e + step * (deceleration + 2.0 * limits.drag * e))
    for i in range(n - 1):
        e = energy[i]
        acceleration = limits.accelerating * _grip_left(limits, curvature[i], e)
        acceleration = min(acceleration, limits.power / math.sqrt(2.0 * e + 1.0))
        energy[i + 1] = min(energy[i + 1], e + step * (acceleration - 2.0 * limits.drag * e))
    return energy


@njit(cache=True)
def _grip_left(limits, curvature, energy):
    """Grip for the longitudinal force over that of a standing car: the ellipse of friction."""
    grip = 1.0 + 2.0 * limits.downforce * energy
    used = 2.0 * energy * curvature / (limits.lateral * grip)
    return grip * math.sqrt(max(1.0 - used * used, 0.0))
