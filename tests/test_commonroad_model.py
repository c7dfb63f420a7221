"""What stands around CommonRoad's multi-body car: compilation, torques, tyres, rest, axes."""

import copy

import numpy as np
import pytest
from vehiclemodels.init_mb import init_mb
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

from twin import TYRE_OUTPUTS
from twin.commonroad.axes import COMMONROAD_STATES, measurements, move, our_states, suspensions
from twin.commonroad.model import (
    FRONT,
    GRAVITY,
    REAR,
    STATES,
    WHEEL,
    advance,
    bmw_320i,
    derivative,
    is_sound,
    rolling,
)
from twin.commonroad.tyres import tyre_outputs

CAR = bmw_320i()
THEIRS = parameters_vehicle2()
FX, FY, FZ, SLIP = (TYRE_OUTPUTS.index(name) for name in ("fx", "fy", "fz", "slip_ratio"))


def some_state(seed):
    """States about a car that corners at 25 m/s."""
    rng = np.random.default_rng(seed)
    x = rolling(CAR, 25.0)
    x[:3] = rng.uniform(-1.0, 1.0, 3) * [100.0, 100.0, 0.05]
    x[4:6] = rng.uniform(-0.5, 0.5, 2)
    x[6:13] += rng.uniform(-1.0, 1.0, 7) * [0.05, 0.2, 0.02, 0.1, 0.5, 0.02, 0.1]
    for axle in (FRONT, REAR):
        x[axle : axle + 5] += rng.uniform(-1.0, 1.0, 5) * [0.003, 0.05, 0.5, 0.003, 0.05]
    x[WHEEL:] *= rng.uniform(0.97, 1.03, 6)
    x[27:] = rng.uniform(-2e-3, 2e-3, 2)
    return x


def wheel_forces(x):
    return tyre_outputs(CAR, x)


@pytest.mark.parametrize("seed", range(5))
def test_compiled_equations_are_theirs_to_rounding(seed):
    x = some_state(seed)
    expected = vehicle_dynamics_mb(x.tolist(), [0.0, 0.0], THEIRS)
    np.testing.assert_allclose(derivative(CAR, x, np.zeros(4)), expected, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("demand", [3.0, -5.0])
def test_wheel_torques_do_what_their_demanded_acceleration_does(demand):
    """Of which a wheel's share is fixed: T_sb of the brakes in front, T_se of the engine."""
    x = some_state(1)
    front = THEIRS.T_se if demand > 0.0 else THEIRS.T_sb
    torque = 0.5 * THEIRS.m * THEIRS.R_w * demand * np.array([front, front, 1 - front, 1 - front])
    expected = vehicle_dynamics_mb(x.tolist(), [0.0, demand], THEIRS)
    np.testing.assert_allclose(derivative(CAR, x, torque), expected, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_tyre_forces_move_the_car_as_in_their_equations(seed):
    """Along, about z (the roll equation does not reach it: I_xz = 0) and in each wheel."""
    x, forces = some_state(seed), wheel_forces(some_state(seed))
    rates = derivative(CAR, x, np.zeros(4))
    ahead, right = forces[:, FX], -forces[:, FY]
    c, s = np.cos(x[2]), np.sin(x[2])
    ahead[:2], right[:2] = c * ahead[:2] - s * right[:2], c * right[:2] + s * ahead[:2]
    place = np.array([CAR.a, CAR.a, -CAR.b, -CAR.b])
    half = 0.5 * np.array([-CAR.T_f, CAR.T_f, -CAR.T_r, CAR.T_r])
    assert rates[3] == pytest.approx(ahead.sum() / CAR.m + x[5] * x[10], rel=1e-12)
    assert rates[5] == pytest.approx((place @ right - half @ ahead) / CAR.I_z, rel=1e-11)
    np.testing.assert_allclose(
        rates[WHEEL : WHEEL + 4], -CAR.R_w * wheel_forces(x)[:, FX] / CAR.I_y_w, rtol=1e-11
    )


@pytest.mark.parametrize("speed", [3.0, 20.0, 45.0])
def test_a_rolling_car_is_in_equilibrium(speed):
    x = rolling(CAR, speed)
    rates = derivative(CAR, x, np.zeros(4))
    assert rates[0] == speed
    # Tyres with a small shift pull sideways, by 3 N in all at most
    np.testing.assert_allclose(rates[1:], 0.0, atol=0.02)
    np.testing.assert_allclose(rates[[3, 12, 17, 22]], 0.0, atol=1e-9)
    forces = wheel_forces(x)
    assert np.abs(forces[:, FX]).max() < 1e-6
    assert abs(forces[:, FY].sum()) < 3.0
    np.testing.assert_allclose(suspensions(CAR, x)[0], 0.0, atol=1e-15)


def test_wheel_loads_match_statics_and_their_initial_state():
    x = rolling(CAR, 20.0)
    front = CAR.m_s * CAR.b / (CAR.a + CAR.b) + CAR.m_uf
    rear = CAR.m_s * CAR.a / (CAR.a + CAR.b) + CAR.m_ur
    loads = wheel_forces(x)[:, FZ]
    np.testing.assert_allclose(loads, 0.5 * GRAVITY * np.repeat([front, rear], 2), rtol=1e-12)
    assert loads.sum() == pytest.approx(CAR.m * GRAVITY)
    theirs = init_mb([0.0, 0.0, 0.0, 20.0, 0.0, 0.0, 0.0], THEIRS)
    np.testing.assert_allclose(x[[FRONT + 3, REAR + 3]], [theirs[16], theirs[21]], rtol=1e-12)


def test_slip_ratio_is_that_of_the_wheel_speed():
    x = rolling(CAR, 20.0)
    x[WHEEL + 2] = 1.03 * 20.0 / CAR.R_w
    assert wheel_forces(x)[2, SLIP] == pytest.approx(0.03)
    assert wheel_forces(x)[2, FX] > 1000.0


def mirrored(car):
    """The same car with tyres that are mirrored: coefficients odd in side slip change sign."""
    other = copy.copy(car)
    for name in ("r_hx1", "r_by3", "r_vy1"):
        other["tire"][name] = -car["tire"][name]
    return other


def test_mirrored_steering_mirrors_everything():
    n = 1500
    inputs = np.zeros((n, 13))
    inputs[:, 0] = 0.6 * np.sin(np.arange(n) * 5e-3)
    inputs[:, [3, 4]] = 300.0
    inputs[800:, 1:5], inputs[800:, 5:9] = 0.0, [400.0, 350.0, 200.0, 100.0]
    other_inputs = inputs[:, [0, 2, 1, 4, 3, 6, 5, 8, 7, 9, 10, 11, 12]].copy()
    other_inputs[:, 0] *= -1.0
    ends = []
    for car, u in ((CAR, inputs), (mirrored(CAR), other_inputs)):
        x, torque = rolling(car, 25.0), np.empty(4)
        for k in range(n):
            before = x.copy()
            rates = advance(car, x, u[k], 16.0, 1e-3, torque)
        ends.append((our_states(car, before), measurements(before, rates)))
    states = np.array([-1.0 if name in ODD else 1.0 for name in COMMONROAD_STATES[:12]])
    outputs = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    (x, y), (x_mirrored, y_mirrored) = ends
    assert abs(x[1]) > 1.0
    assert abs(y[1]) > 1.0
    swapped = [1, 0, 3, 2]
    np.testing.assert_allclose(x_mirrored[:12], states * x[:12], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(y_mirrored[:6], outputs * y[:6], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(y_mirrored[6:], y[6:][swapped], rtol=1e-9)


ODD = ("y", "roll", "yaw", "vy", "roll_rate", "yaw_rate")


@pytest.mark.parametrize("seed", range(3))
def test_a_correction_moves_our_states_by_what_it_says(seed):
    rng = np.random.default_rng(seed)
    x = some_state(seed)
    before = our_states(CAR, x)
    change = rng.uniform(-0.02, 0.02, len(COMMONROAD_STATES))
    move(CAR, x, change)
    np.testing.assert_allclose(our_states(CAR, x), before + change, rtol=1e-12, atol=1e-13)


def test_axles_go_along_with_the_body_sideways():
    x = some_state(0)
    moved = x.copy()
    change = np.zeros(len(COMMONROAD_STATES))
    change[COMMONROAD_STATES.index("yaw_rate")] = 0.1
    move(CAR, moved, change)
    yawing = moved[5] - x[5]
    assert yawing == pytest.approx(-0.1, rel=0.01)
    swing = moved[[FRONT + 2, REAR + 2]] - x[[FRONT + 2, REAR + 2]] - (moved[10] - x[10])
    np.testing.assert_allclose(swing, yawing * np.array([CAR.a, -CAR.b]), atol=1e-12)


@pytest.mark.parametrize(
    ("state", "value"), [(3, 1.9), (3, np.nan), (WHEEL, 0.0), (WHEEL + 3, -1.0), (12, np.inf)]
)
def test_states_where_the_model_is_none_are_not_sound(state, value):
    x = rolling(CAR, 20.0)
    assert is_sound(x)
    x[state] = value
    assert not is_sound(x)


def test_there_are_as_many_states_as_rates():
    assert len(vehicle_dynamics_mb(rolling(CAR, 20.0).tolist(), [0.0, 0.0], THEIRS)) == STATES
