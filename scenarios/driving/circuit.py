"""A closed circuit of 4 km: straights, clothoids and arcs, run anticlockwise."""

import math
from typing import NamedTuple

import numpy as np

from scenarios.driving.path import Path, Piece, end_of, path_of

LENGTH = 4000.0  # [m]; the lap of the paper's car is not known: chosen


class Corner(NamedTuple):
    """A clothoid into an arc, a clothoid out of it, and the straight behind."""

    turn: float  # [deg], positive to the left
    radius: float  # [m]
    clothoid: float  # length of each [m]
    straight: float | None  # [m]; None: as long as it takes to close the circuit


# Chosen: fast bends, S bends, a hairpin and straights, so that a car of 1.4 g meets 65 to 230 km/h
# and brakes hard on straights. The first straight comes before them; the circuit begins on it.
CORNERS = (
    Corner(-45.0, 80.0, 45.0, 30.0),
    Corner(90.0, 70.0, 45.0, 30.0),
    Corner(-45.0, 80.0, 45.0, 330.0),
    Corner(90.0, 55.0, 38.0, 80.0),
    Corner(75.0, 150.0, 60.0, None),
    Corner(-80.0, 55.0, 38.0, 40.0),
    Corner(80.0, 60.0, 40.0, 100.0),
    Corner(60.0, 90.0, 40.0, None),
    Corner(50.0, 70.0, 40.0, 20.0),
    Corner(-95.0, 55.0, 40.0, 20.0),
    Corner(45.0, 80.0, 40.0, 200.0),
    Corner(-45.0, 110.0, 45.0, 50.0),
    Corner(180.0, 40.0, 32.0, 100.0),
)


def circuit() -> Path:
    """One lap from the first straight back to it; the last point is the first."""
    return path_of(pieces())


def pieces() -> list[Piece]:
    """Straights, clothoids and arcs of a lap.

    Three straights, the first one and the two without a length, close it: two equations for the
    place, one for the length of the lap.
    """
    laid, heading = [Piece(0.0, 0.0, 0.0)], 0.0
    free = {0: heading}  # headings of the straights that are looked for
    for corner in CORNERS:
        laid += _bend(corner)
        heading += math.radians(corner.turn)
        if corner.straight is None:
            free[len(laid)] = heading
        laid.append(Piece(corner.straight or 0.0, 0.0, 0.0))
    x, y, _ = end_of(laid)
    missing = [-x, -y, LENGTH - sum(piece.length for piece in laid)]
    headings = np.array([*free.values()])
    directions = np.array([np.cos(headings), np.sin(headings), np.ones(headings.size)])
    for place, length in zip(free, np.linalg.solve(directions, missing), strict=True):
        laid[place] = Piece(float(length), 0.0, 0.0)
    return laid


def _bend(corner: Corner) -> list[Piece]:
    curvature = math.copysign(1.0 / corner.radius, corner.turn)
    arc = math.radians(abs(corner.turn)) * corner.radius - corner.clothoid
    return [
        Piece(corner.clothoid, 0.0, curvature),
        Piece(arc, curvature, curvature),
        Piece(corner.clothoid, curvature, 0.0),
    ]
