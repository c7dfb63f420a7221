"""A path on the ground by arc length: where it is, where it heads and how it bends."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP = 0.5  # [m] between points; chosen: a car at 200 km/h passes eleven in a tenth of a second
# Gauss-Legendre nodes and weights on 0 to 1, order 8: a lap closes within a micrometre
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)
NODES, WEIGHTS = 0.5 * NODES + 0.5, 0.5 * WEIGHTS


class Path(NamedTuple):
    """Points at equal distances along a line."""

    step: float  # from point to point, along the line [m]
    x: Array  # (M,) [m]
    y: Array  # (M,) [m]
    heading: Array  # (M,) [rad], not wrapped
    curvature: Array  # (M,) [1/m], positive to the left

    @property
    def distance(self) -> Array:
        """(M,) along the line [m]."""
        return np.arange(self.x.size, dtype=np.float64) * np.float64(self.step)


class Piece(NamedTuple):
    """A stretch whose curvature changes evenly: a straight, an arc or a clothoid."""

    length: float  # [m]
    start: float  # curvature [1/m]
    end: float


def path_of(pieces: Sequence[Piece], step: float = STEP) -> Path:
    """The path through pieces laid end to end, from the origin along x.

    Its last point is the last whole step; see `end_of` for the end.
    """
    ends = np.concatenate([[0.0], np.cumsum([piece.length for piece in pieces])])
    distance = np.float64(step) * np.arange(int(np.floor(ends[-1] / step + 1e-9)) + 1)
    nodes = np.union1d(distance, ends)  # so that no interval holds a corner of the curvature
    x, y = _positions(pieces, ends, nodes)
    at = np.searchsorted(nodes, distance)
    heading, curvature = _bends(pieces, ends, distance)
    return Path(step, x[at], y[at], heading, curvature)


def end_of(pieces: Sequence[Piece]) -> tuple[float, float, float]:
    """x, y [m] and heading [rad] where the pieces end."""
    ends = np.concatenate([[0.0], np.cumsum([piece.length for piece in pieces])])
    nodes = np.union1d(np.arange(0.0, ends[-1], STEP), ends)
    x, y = _positions(pieces, ends, nodes)
    return float(x[-1]), float(y[-1]), float(_bends(pieces, ends, nodes[-1:])[0][0])


def _positions(pieces: Sequence[Piece], ends: Array, nodes: Array) -> tuple[Array, Array]:
    lengths = np.diff(nodes)
    between = nodes[:-1, None] + lengths[:, None] * NODES
    heading = _bends(pieces, ends, between.ravel())[0].reshape(between.shape)
    x, y = (
        np.concatenate([[0.0], np.cumsum(lengths * (direction(heading) @ WEIGHTS))])
        for direction in (np.cos, np.sin)
    )
    return x, y


def _bends(pieces: Sequence[Piece], ends: Array, distance: Array) -> tuple[Array, Array]:
    """Heading [rad] and curvature [1/m] at distances along the pieces."""
    length, start, end = np.transpose(pieces)
    slope = (end - start) / np.maximum(length, 1e-9)
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (start + end) * length)])
    piece = np.clip(np.searchsorted(ends, distance, side="right") - 1, 0, len(pieces) - 1)
    along = distance - ends[piece]
    curvature = start[piece] + slope[piece] * along
    return turned[piece] + 0.5 * (start[piece] + curvature) * along, curvature


def follow_on(paths: Sequence[Path]) -> Path:
    """Paths of one step laid end to end, each turned and moved to where the last one ended.

    A path's last point and the next one's first are the same point.
    """
    x, y, heading = [np.zeros(1)], [np.zeros(1)], [np.zeros(1)]
    curvature = [paths[0].curvature[:1]]
    for path in paths:
        turn = heading[-1][-1] - path.heading[0]
        c, s = np.cos(turn), np.sin(turn)
        dx, dy = path.x[1:] - path.x[0], path.y[1:] - path.y[0]
        x.append(x[-1][-1] + c * dx - s * dy)
        y.append(y[-1][-1] + s * dx + c * dy)
        heading.append(path.heading[1:] + turn)
        curvature.append(path.curvature[1:])
    return Path(paths[0].step, *(np.concatenate(parts) for parts in (x, y, heading, curvature)))
