import numpy as np
import pytest

from scenarios.driving.circuit import circuit
from scenarios.driving.drivers import LIMITS, limits_of
from scenarios.driving.path import Piece, follow_on, path_of
from scenarios.driving.speed_profile import GRAVITY, Limits, course_of, times
from twin import Vehicle

PLAIN = Limits(
    lateral=1.0, accelerating=0.5, braking=0.8, speed=60.0, power=1e9, mass=1000.0, drag_area=0.0
)
ARC = [Piece(400.0, 0.0, 0.0), Piece(20.0, 0.0, 0.02), Piece(60.0, 0.02, 0.02)]


@pytest.mark.parametrize("car", LIMITS)
def test_speed_on_the_circuit_respects_the_ellipse_of_friction(car):
    limits = limits_of(Vehicle.load(car))
    course = course_of(follow_on([circuit()] * 2), limits, start=20.0)
    air = 0.5 * 1.2 * course.speed**2 / limits.mass
    grip = 1.0 + air * limits.downforce_area / GRAVITY
    across = course.speed**2 * course.curvature / (GRAVITY * limits.lateral)
    tyres = course.acceleration + air * limits.drag_area
    along = np.where(tyres > 0.0, limits.accelerating, limits.braking)
    used = np.hypot(across, tyres / (GRAVITY * along)) / grip
    assert used.max() < 1.02
    assert used.max() > 0.95
    assert (tyres * course.speed).max() < 1.01 * limits.power / limits.mass
    assert course.speed.max() <= limits.speed


@pytest.mark.parametrize("car", LIMITS)
def test_speed_and_acceleration_of_a_course_belong_together(car):
    course = course_of(circuit(), limits_of(Vehicle.load(car)), start=20.0)
    energy = 0.5 * course.speed**2
    gained = np.cumsum(0.5 * course.step * (course.acceleration[1:] + course.acceleration[:-1]))
    np.testing.assert_allclose(energy[1:] - energy[0], gained, atol=0.01 * energy.max())
    jumps = np.abs(np.diff(course.acceleration))
    assert jumps.max() < 0.1 * GRAVITY


def test_arc_is_driven_at_the_root_of_grip_times_radius():
    course = course_of(path_of(ARC), PLAIN, start=10.0)
    assert course.speed[-40:] == pytest.approx(np.sqrt(GRAVITY / 0.02), rel=1e-6)


def test_downforce_makes_corners_faster():
    from dataclasses import replace

    area, radius = 2.0, 50.0
    course = course_of(path_of(ARC), replace(PLAIN, downforce_area=area), start=10.0)
    # m v^2 / R = mu (m g + rho/2 C A v^2), mu = 1
    expected = np.sqrt(GRAVITY / (1.0 / radius - 0.6 * area / 1000.0))
    assert course.speed[-1] == pytest.approx(expected, rel=1e-6)


def test_time_along_a_course_is_distance_over_speed():
    course = course_of(path_of([Piece(100.0, 0.0, 0.0)]), PLAIN, start=20.0, ceiling=20.0)
    assert times(course)[-1] == pytest.approx(5.0)
    assert course.acceleration == pytest.approx(0.0, abs=1e-9)


def test_a_ceiling_is_not_exceeded():
    path = path_of([Piece(300.0, 0.0, 0.0)])
    ceiling = np.where(path.distance > 200.0, 15.0, 40.0)
    course = course_of(path, PLAIN, start=25.0, ceiling=ceiling)
    assert (course.speed <= ceiling + 1e-9).all()
    assert course.speed.max() > 35.0
