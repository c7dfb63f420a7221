"""Wheel loads against statics: moments about the axles and about the centre line."""

import mujoco
import numpy as np
import pytest
from cars import (
    FRONT,
    FY,
    FZ,
    HALF_TRACK,
    MASS,
    MX,
    MY,
    PITCH,
    REAR,
    SPIN,
    TOTAL,
    UNSPRUNG,
    VX,
    WHEEL_INERTIA,
    WHEELBASE,
    G,
    contact_points,
    drag,
    inputs,
    run,
    suv,
)

from twin import PointMass, Twin, Vehicle

LOADS = (
    PointMass(name="passenger", mass=80.0, position=np.array([-0.1, -0.4, 0.1])),
    PointMass(name="boot", mass=150.0, position=np.array([-1.9, 0.3, 0.2])),
)


def loads(twin):
    twin.step(np.zeros(13))
    return twin.tyre_forces()[:, FZ]


def test_axle_loads_at_rest_are_those_of_a_lever_on_two_axles():
    fl, fr, rl, rr = loads(suv())
    front = G * (MASS * -REAR + 2.0 * UNSPRUNG * WHEELBASE) / WHEELBASE
    rear = G * (MASS * FRONT + 2.0 * UNSPRUNG * WHEELBASE) / WHEELBASE
    assert fl + fr == pytest.approx(front, rel=1e-3)
    assert rl + rr == pytest.approx(rear, rel=1e-3)
    assert fl + fr + rl + rr == pytest.approx(TOTAL * G, rel=1e-9)


def test_side_loads_at_rest_differ_by_the_lateral_offset_of_the_centre_of_mass():
    fl, fr, rl, rr = loads(suv())
    assert fl + rl - fr - rr == pytest.approx(MASS * G * -0.00003 / HALF_TRACK, rel=0.02)


def test_loads_of_a_laden_car_balance_about_axles_and_centre_line():
    twin = Twin(Vehicle.load("suv").with_loads(LOADS))
    twin.reset()
    fl, fr, rl, _ = loads(twin)
    total = TOTAL + sum(load.mass for load in LOADS)
    x, y, _ = twin.data.subtree_com[twin.car.chassis]
    points = contact_points(twin)
    rear, wheelbase = points[2:, 0].mean(), points[:2, 0].mean() - points[2:, 0].mean()
    right, track = points[1::2, 1].mean(), points[::2, 1].mean() - points[1::2, 1].mean()
    assert fl + fr == pytest.approx(total * G * (x - rear) / wheelbase, rel=1e-3)
    assert fl + rl == pytest.approx(total * G * (y - right) / track, rel=1e-3)


def test_laden_car_equals_the_empty_one_with_the_parameters_of_the_load():
    from twin import loaded, parameter_deltas

    vehicle = Vehicle.load("suv")
    laden, empty = Twin(vehicle.with_loads(LOADS)), Twin(vehicle)
    nominal = vehicle.chassis()
    empty.set_parameters(parameter_deltas(nominal, loaded(nominal, LOADS)))
    laden.reset()
    empty.reset()
    np.testing.assert_allclose(loads(empty), loads(laden), rtol=1e-9)


@pytest.mark.parametrize("speed", [10.0, 30.0])
def test_coasting_moves_load_to_the_front_by_deceleration_and_drag(speed):
    twin = suv(speed)
    made = run(twin, inputs(3.0))
    states, tyres = made.states[-2:], made.tyres[-2]
    ax = (states[1, VX] - states[0, VX]) / twin.dt
    spin_up = (states[1, SPIN:] - states[0, SPIN:]).sum() / twin.dt
    x, _, height = twin.data.subtree_com[twin.car.chassis]
    points = contact_points(twin)
    rear, wheelbase = points[2:, 0].mean(), points[:2, 0].mean() - points[2:, 0].mean()
    # moments about the rear contact line, y axis
    front = TOTAL * G * (x - rear) - TOTAL * ax * height + tyres[:, MY].sum()
    front -= WHEEL_INERTIA * spin_up
    air, (ahead, _, origin) = drag(states[0, VX]), twin.data.xpos[twin.car.chassis]
    front += air * origin + air * states[0, PITCH] * (ahead - rear)  # along the body, nose down
    assert tyres[:2, FZ].sum() == pytest.approx(front / wheelbase, rel=1e-4)
    at_rest = TOTAL * G * (x - rear) / wheelbase
    assert tyres[:2, FZ].sum() - at_rest == pytest.approx(front / wheelbase - at_rest, rel=5e-3)
    assert tyres[:2, FZ].sum() > at_rest


@pytest.mark.parametrize("speed", [0.0, 30.0])
def test_reset_car_is_settled(speed):
    twin = suv(speed)
    before = loads(twin)
    made = run(twin, inputs(5.0))
    np.testing.assert_allclose(made.tyres[-1, :, FZ], before, rtol=3e-3)
    assert np.ptp(made.states[:, 2]) < 2e-4


def test_loads_on_three_wheels_are_those_of_a_three_legged_table():
    # Diagonal wheels on a warped road, whose mean plane is level: one of them hangs in the air.
    twin = suv()
    height = np.minimum(np.arange(4000) * 0.3e-3 / 3.0, 0.3)
    road = -np.outer(height, [1.0, 0.0, 0.0, 1.0])
    made = run(twin, inputs(10.0, road=np.vstack([road, np.repeat(road[-1:], 6000, 0)])))
    tyres = made.tyres[-1]
    assert tyres[3, FZ] == 0.0
    mujoco.mj_forward(twin.model, twin.data)
    com = twin.data.subtree_com[twin.car.chassis]
    points = contact_points(twin, road[-1])
    # forces, moments about y and about x, of what the three tyres bring and of the weight
    table = np.vstack([np.ones(3), points[:3, :2].T])
    sides = np.array([0.0, 0.0, -(tyres[:, MX] - points[:, 2] * tyres[:, FY]).sum()])
    expected = np.linalg.solve(table, TOTAL * G * np.array([1.0, *com[:2]]) + sides)
    np.testing.assert_allclose(tyres[:3, FZ], expected, rtol=3e-3)
