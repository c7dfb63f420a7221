"""Heave, pitch, roll and wheel hop against the linear equations of seven degrees of freedom."""

import numpy as np
import pytest
from cars import (
    FRONT,
    HUB_Z,
    MASS,
    PLACES,
    REAR,
    UNSPRUNG,
    WHEEL_INERTIA,
    WHEELBASE,
    G,
    eigenvalues_of,
    pairs,
    suv,
    variant,
    vertical_slides,
)

from twin import Twin

SPRING, DAMPER = np.array([36e3, 36e3, 38e3, 38e3]), np.array([2900.0, 2900.0, 2700.0, 2700.0])
ANTI_ROLL_FRONT, ANTI_ROLL_REAR = 20e3, 10e3
TYRE_SPRING, TYRE_DAMPER = 260e3, 50.0
CM = np.array([0.0, -0.00003, 0.0])
INERTIA = np.array([[834.23, 0.14, 0.097], [0.14, 3640.182, 3.86], [0.097, 3.86, 3932.77]])
VERTICAL = np.tile([0.0, 0.0, 1.0], (4, 1))
LEANING = np.array(
    [[0.05, 0.0727, 1.0], [0.05, -0.0727, 1.0], [-0.05, 0.1333, 1.0], [-0.05, -0.1333, 1.0]]
)
# Tyres on ice: no side force holds the chassis, which then turns about its own centre of mass.
ICE = {"PKX1": 0.001, "PKY1": -0.001, "LMUX": 0.01, "LMUY": 0.01, "LMX": 0.0, "LMY": 0.0}
ICE |= {"LSGKP": 100.0, "LSGAL": 100.0}


def skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def mass_matrix(axes):
    """Kinetic energy in x, y, z, turns about the chassis frame, four travels, four spins."""
    m = np.zeros((14, 14))

    def add(mass, inertia, velocity, rate):
        m[:] += mass * velocity.T @ velocity + rate.T @ inertia @ rate

    def at(place):
        velocity, rate = np.zeros((3, 14)), np.zeros((3, 14))
        velocity[:, :3], velocity[:, 3:6], rate[:, 3:6] = np.eye(3), -skew(place), np.eye(3)
        return velocity, rate

    add(MASS, INERTIA, *at(CM))
    for w, place in enumerate(PLACES):
        velocity, rate = at(place)
        velocity[:, 6 + w] = axes[w]
        add(25.0, 0.3 * np.eye(3), velocity, rate)
        rate[1, 10 + w] = 1.0
        add(28.0, np.diag([1.0, WHEEL_INERTIA, 1.0]), velocity, rate)
    return m


def eigenvalues_by_hand(axes):
    """The fourteen of M q'' + C q' + K q = 0, q = heave, roll, pitch, four travels.

    Args:
        axes: (4, 3) directions in which the wheels travel.
    """
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    m, moving = mass_matrix(axes), [2, 3, 4, 6, 7, 8, 9]
    free = [0, 1, 5, 10, 11, 12, 13]  # nothing pushes them: they follow
    m = m[np.ix_(moving, moving)] - m[np.ix_(moving, free)] @ np.linalg.solve(
        m[np.ix_(free, free)], m[np.ix_(free, moving)]
    )
    compression = -np.hstack([np.ones((4, 1)), PLACES[:, 1:2], -PLACES[:, :1], np.diag(axes[:, 2])])
    k, c = TYRE_SPRING * compression.T @ compression, TYRE_DAMPER * compression.T @ compression
    k[3:, 3:] += np.diag(SPRING)
    c[3:, 3:] += np.diag(DAMPER)
    for left, right, bar in ((3, 4, ANTI_ROLL_FRONT), (5, 6, ANTI_ROLL_REAR)):
        k[np.ix_((left, right), (left, right))] += bar * np.array([[1.0, -1.0], [-1.0, 1.0]])
    # Weight tips the car over: about the ground in roll, and, as wheels turn freely, about their
    # centres in pitch.
    hub_height = 0.644 + HUB_Z
    k[1, 1] -= G * (MASS * 0.644 + 4.0 * UNSPRUNG * hub_height)
    k[2, 2] -= G * MASS * -HUB_Z
    # A wheel that leaves sideways takes the lever of its load with it, and a turn the load's share.
    load = MASS * G * np.array([-REAR, -REAR, FRONT, FRONT]) / (2.0 * WHEELBASE)
    for turn, leaning in ((1, -load * axes[:, 1]), (2, load * axes[:, 0])):
        k[turn, 3:] += leaning
        k[3:, turn] += leaning
    zero, one = np.zeros((7, 7)), np.eye(7)
    system = np.block([[zero, one], [-np.linalg.solve(m, k), -np.linalg.solve(m, c)]])
    return np.linalg.eigvals(system)


@pytest.mark.parametrize(("axes", "edits"), [(VERTICAL, vertical_slides()), (LEANING, ())])
def test_frequencies_and_damping_are_those_of_the_linear_equations(tmp_path, axes, edits):
    measured = pairs(eigenvalues_of(Twin(variant(tmp_path, *edits, tyre=ICE))))
    expected = pairs(eigenvalues_by_hand(axes))
    assert expected.shape == (2, 7)
    np.testing.assert_allclose(measured, expected, rtol=5e-3)


def test_body_moves_at_the_ride_frequencies_the_model_states():
    (heave, pitch, roll), damping = pairs(eigenvalues_by_hand(LEANING))[:, :3]
    assert heave == pytest.approx(1.2, rel=0.05)
    assert pitch == pytest.approx(1.4, rel=0.1)
    assert roll == pytest.approx(2.0, rel=0.1)
    assert np.all((damping > 0.2) & (damping < 0.4))


def test_wheels_that_lean_raise_the_ride_frequencies_by_two_percent():
    ratio = pairs(eigenvalues_by_hand(LEANING))[0] / pairs(eigenvalues_by_hand(VERTICAL))[0]
    assert np.all((ratio[:3] > 1.0) & (ratio[:3] < 1.025))
    assert np.all((ratio[3:] > 0.985) & (ratio[3:] < 1.0))  # wheel hop


def test_tyres_that_grip_slow_the_roll_of_a_standing_car():
    # It turns about the ground, no longer about its own centre of mass.
    free, standing = pairs(eigenvalues_by_hand(LEANING))[0], pairs(eigenvalues_of(suv()))[0]
    np.testing.assert_allclose(standing[[0, 1]], free[[0, 1]], rtol=0.01)
    assert 0.7 * free[2] < standing[2] < 0.9 * free[2]
