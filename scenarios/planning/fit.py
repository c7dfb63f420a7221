"""Scales the steering of a motion so that a car stays within the limits: as strong as allowed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenarios.driving.speed_profile import Course
from scenarios.planning.drive import Driven, Motion, driven
from scenarios.planning.limits import PlanLimits, strain
from twin import Vehicle

Array = NDArray[np.float64]

_TRIALS = 6
_MARGIN = 0.97  # of the limit, that a scaling aims at


def fitted(
    vehicle: Vehicle,
    motion: Motion,
    course: Course,
    limits: PlanLimits,
    cars: Sequence[Array | None] = (None,),
) -> tuple[Motion, Driven, dict[str, float]]:
    """The motion with its steering lowered as far as the limits demand.

    Args:
        vehicle: the car.
        motion: what is driven.
        course: the middle of the road.
        limits: to stay within.
        cars: parameters (20,) of cars that all have to, the first of which is given back.

    Returns:
        The motion, how the first car drove it, and the share of each limit that the cars used.
    """

    def attempt(scale: float) -> tuple[Motion, Driven, dict[str, float]]:
        trial = replace(motion, steering=scale * motion.steering)
        runs = [driven(vehicle, trial, course, limits.width, car) for car in cars]
        return trial, runs[0], _most([strain(r.drive, r.left, limits, vehicle) for r in runs])

    scale = 1.0
    found = attempt(scale)
    for _ in range(_TRIALS):
        worst = max(found[2].values())
        if worst <= 1.0:
            break
        scale *= _MARGIN / worst
        found = attempt(scale)
    return found


def _most(used: Sequence[dict[str, float]]) -> dict[str, float]:
    return {name: max(one[name] for one in used) for name in used[0]}
