import numpy as np
import pytest

from scenarios.driving.circuit import LENGTH, circuit, pieces
from scenarios.driving.path import Piece, end_of, follow_on, path_of


def test_circuit_closes_in_place_and_heading():
    x, y, heading = end_of(pieces())
    assert np.hypot(x, y) < 1e-6
    assert heading == pytest.approx(2.0 * np.pi, abs=1e-12)


def test_circuit_is_four_kilometres_long():
    assert LENGTH == 4000.0
    lap = circuit()
    assert lap.distance[-1] == pytest.approx(LENGTH, abs=1e-6)
    assert np.hypot(np.diff(lap.x), np.diff(lap.y)).sum() == pytest.approx(LENGTH, rel=1e-5)
    assert np.hypot(lap.x[-1] - lap.x[0], lap.y[-1] - lap.y[0]) < 1e-6


def test_every_piece_of_the_circuit_has_a_length():
    assert all(piece.length > 0.0 for piece in pieces())


def test_curvature_of_the_circuit_does_not_jump_nor_does_it_from_lap_to_lap():
    curvature = follow_on([circuit()] * 2).curvature
    assert np.abs(curvature).max() == pytest.approx(1.0 / 40.0, rel=1e-9)
    # the steepest clothoid: from straight to 1 / 40 m within 32 m
    assert np.abs(np.diff(curvature)).max() <= 0.5 / 40.0 / 32.0 + 1e-12


def test_circuit_does_not_come_near_itself():
    lap = circuit()
    points = np.column_stack([lap.x, lap.y])[:-1:20]
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    along = np.abs(np.subtract.outer(*[np.arange(len(points))] * 2))
    along = np.minimum(along, len(points) - along) * 20 * lap.step
    assert apart[along > 150.0].min() > 50.0


def test_an_arc_ends_where_the_circle_does():
    x, y, heading = end_of([Piece(0.5 * np.pi * 40.0, 1.0 / 40.0, 1.0 / 40.0)])
    assert (x, y) == pytest.approx((40.0, 40.0), abs=1e-9)
    assert heading == pytest.approx(0.5 * np.pi)


def test_a_clothoid_is_the_integral_of_fresnel():
    from scipy.special import fresnel

    length, scale = 60.0, np.sqrt(np.pi * 60.0 * 50.0)  # from straight to a radius of 50 m
    x, y, heading = end_of([Piece(length, 0.0, 1.0 / 50.0)])
    sine, cosine = fresnel(length / scale)
    assert (x, y) == pytest.approx((scale * cosine, scale * sine), abs=1e-9)
    assert heading == pytest.approx(0.5 * length / 50.0)


def test_paths_laid_end_to_end_are_the_path_of_all_their_pieces():
    first = [Piece(20.0, 0.0, 0.02), Piece(10.0, 0.02, 0.0)]
    second = [Piece(15.0, 0.0, -0.03), Piece(25.0, -0.03, 0.0)]
    joined, whole = follow_on([path_of(first), path_of(second)]), path_of(first + second)
    for one, other in zip(joined, whole, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
