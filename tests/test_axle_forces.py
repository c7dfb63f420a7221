"""Lateral forces on the axles, a parameter of the twin that is no load."""

import numpy as np
import pytest

from twin import FORCES, INPUTS, OUTPUTS, PARAMETERS, Twin, Vehicle

AY, ROLL_RATE, YAW_RATE = (OUTPUTS.index(name) for name in ("ay", "roll_rate", "yaw_rate"))


@pytest.fixture(scope="module")
def car():
    return Twin(Vehicle.load("suv"))


def pushed(car, front, rear):
    """Lateral acceleration and yaw acceleration at the first instant."""
    p = np.zeros(len(PARAMETERS))
    p[[PARAMETERS.index(name) for name in FORCES]] = front, rear
    car.set_parameters(np.zeros(len(PARAMETERS)))
    car.reset(20.0)
    np.testing.assert_array_equal(car.set_parameters(p), p)
    u = np.zeros(len(INPUTS))
    ay = car.step(u)[AY]
    return ay, car.step(u)[YAW_RATE] / car.dt


def test_without_a_force_the_car_goes_straight(car):
    assert pushed(car, 0.0, 0.0) == pytest.approx((0.0, 0.0), abs=1e-4)


def test_equal_moments_about_the_centre_of_mass_do_not_turn_the_car(car):
    """Newton and Euler: F = M a and x F = J r' at the first instant, before the tyres answer."""
    mass = car.model.body_mass.sum()
    front, rear = car.car.axle - car.data.subtree_com[car.car.chassis, 0]
    force = 1000.0
    ay, turn = pushed(car, force, -force * front / rear)
    still, _ = pushed(car, 0.0, 0.0)
    assert abs(turn) < 0.02
    # the roll that the force starts at the road moves the IMU, above the roll axis, against it
    assert ay - still == pytest.approx((force - force * front / rear) / mass, rel=0.25)


def test_force_in_front_turns_the_car_to_its_side(car):
    _, left = pushed(car, 500.0, 0.0)
    _, right = pushed(car, -500.0, 0.0)
    assert left > 0.1
    assert right == pytest.approx(-left, rel=1e-3)
    _, behind = pushed(car, 0.0, 500.0)
    assert behind < -0.1


def test_forces_survive_a_snapshot(car):
    pushed(car, 800.0, 100.0)
    saved = car.snapshot()
    ends = []
    for _ in range(2):
        car.restore(saved)
        for _ in range(20):
            y = car.step(np.zeros(len(INPUTS)))
        ends.append(y)
    np.testing.assert_array_equal(*ends)
