"""Cornering, straight running, lock-up and wheel spin against closed forms."""

import numpy as np
import pytest
from cars import (
    ALPHA,
    CAMBER,
    FRONT,
    FX,
    FY,
    FZ,
    KAPPA,
    MY,
    MZ,
    PLACES,
    REAR,
    ROLL,
    ROLL_RATE,
    SPIN,
    SWAP,
    TOTAL,
    VX,
    VY,
    WHEEL_INERTIA,
    WHEELBASE,
    YAW_RATE,
    G,
    X,
    drag,
    inputs,
    mirrored,
    run,
    suv,
    times,
    variant,
)

import models
from scenarios.driving.manoeuvres import Manoeuvre
from scenarios.driving.record import record
from twin import STATES, TYRE_OUTPUTS, WHEELS, Twin, Vehicle
from twin.tyre.radius import effective_radius
from twin.tyre.tir import read_tyre

TYRE = read_tyre(models.path("tyres/suv.tir"))


def cornering_stiffness(load):
    """MF 5.2 by hand with the numbers of the file, upright [N/rad]."""
    return 18.5 * 6000.0 * np.sin(2.0 * np.arctan(load / (1.9 * 6000.0)))


def camber_thrust(load, camber):
    """Side force [N] of a leaning tyre for small angles, by hand."""
    excess = load / 6000.0 - 1.0
    return -(0.03 * cornering_stiffness(load) + load * (0.30 + 0.10 * excess)) * camber


def longitudinal_force(load, slip):
    """MF 5.2 by hand, without side slip [N]."""
    excess = load / 6000.0 - 1.0
    peak, c, e = (1.05 - 0.08 * excess) * load, 1.60, 0.30 + 0.05 * excess
    bx = (20.0 - 2.0 * excess) * np.exp(0.10 * excess) * load / (c * peak) * slip
    return peak * np.sin(c * np.arctan(bx - e * (bx - np.arctan(bx))))


def road_wheels(hand_wheel):
    """Left and right road-wheel angle [rad]: 80 % of Ackermann's difference."""
    mean = np.tan(hand_wheel / 16.0)
    left = np.arctan(mean / (1.0 - 0.8 * 1.65 / (2.0 * WHEELBASE) * mean))
    right = np.arctan(mean / (1.0 + 0.8 * 1.65 / (2.0 * WHEELBASE) * mean))
    return np.array([left, right, 0.0, 0.0])


def slip_angles(states, hand_wheel):
    """(..., 4) of the wheels from the motion of the chassis [rad]."""
    states = states[..., None, :]
    across = states[..., VY] + PLACES[:, 0] * states[..., YAW_RATE] + 0.644 * states[..., ROLL_RATE]
    along = states[..., VX] - PLACES[:, 1] * states[..., YAW_RATE]
    return np.arctan2(across, along) - road_wheels(hand_wheel)


def circle(speed, hand_wheel, seconds=12.0):
    """Means over the last half second of a steady circle: states, outputs, tyres; its radius."""
    t = times(seconds)
    manoeuvre = Manoeuvre(
        name="circle", dt=0.001, speed=np.full(t.size, speed),
        steering=hand_wheel * np.minimum(t / 2.0, 1.0), road=np.zeros((t.size, 4)),
    )  # fmt: skip
    drive = record(Vehicle.load("suv"), manoeuvre)
    last = slice(-500, None)
    states = np.array([drive.truth[name][last].mean() for name in STATES])
    tyres = [[drive.truth[f"{name}_{w}"][last].mean() for name in TYRE_OUTPUTS] for w in WHEELS]
    x, y = drive.truth["x"][-3000:], drive.truth["y"][-3000:]
    # the circle x^2 + y^2 = 2 a x + 2 b y + c through the track
    (a, b, c), *_ = np.linalg.lstsq(
        np.column_stack([2.0 * x, 2.0 * y, np.ones(x.size)]), x**2 + y**2, rcond=None
    )
    radius = np.sqrt(c + a**2 + b**2)
    return states, drive.measurements[last].mean(axis=0), np.array(tyres), radius


CIRCLES = [(10.0, 0.3), (15.0, 0.2), (20.0, 0.15), (30.0, 0.08), (20.0, -0.15)]


@pytest.mark.parametrize(("speed", "hand_wheel"), CIRCLES)
def test_axle_side_force_is_cornering_stiffness_times_slip_angle(speed, hand_wheel):
    states, _, tyres, _ = circle(speed, hand_wheel)
    slip, load = slip_angles(states, hand_wheel), tyres[:, FZ]
    side = tyres[:, FY] - camber_thrust(load, tyres[:, CAMBER])
    for axle in (slice(0, 2), slice(2, 4)):
        stiffness = -side[axle].sum() / slip[axle].mean()
        assert stiffness == pytest.approx(cornering_stiffness(load[axle]).sum(), rel=0.02)
        assert tyres[axle, ALPHA].mean() == pytest.approx(slip[axle].mean(), rel=5e-3)


@pytest.mark.parametrize(("speed", "hand_wheel"), CIRCLES)
def test_lateral_acceleration_is_speed_squared_over_radius(speed, hand_wheel):
    states, outputs, tyres, radius = circle(speed, hand_wheel)
    expected = np.sign(hand_wheel) * np.hypot(states[VX], states[VY]) ** 2 / radius
    assert states[VX] == pytest.approx(speed, rel=2e-3)
    # what the leaning accelerometer feels: a share of gravity too
    felt = expected * np.cos(states[ROLL]) + G * np.sin(states[ROLL])
    assert outputs[1] == pytest.approx(felt, rel=2e-3)
    across = tyres[:, FY] * np.cos(road_wheels(hand_wheel))
    across += tyres[:, FX] * np.sin(road_wheels(hand_wheel))
    assert across.sum() == pytest.approx(TOTAL * expected, rel=5e-3)


@pytest.mark.parametrize(("speed", "hand_wheel"), CIRCLES)
def test_understeer_is_that_of_axle_loads_stiffnesses_camber_and_trail(speed, hand_wheel):
    _, _, tyres, radius = circle(speed, hand_wheel)
    radius *= np.sign(hand_wheel)
    steer = road_wheels(hand_wheel)[:2].mean()
    gradient = (steer * radius - WHEELBASE) / speed**2  # [rad per m/s2]
    trail = -tyres[:, MZ].sum() / tyres[:, FY].sum()
    masses = TOTAL * np.array([-REAR + trail, FRONT - trail]) / WHEELBASE
    by_axle = (2, 2)
    stiffness = cornering_stiffness(tyres[:, FZ]).reshape(by_axle).sum(axis=1)
    thrust = camber_thrust(tyres[:, FZ], tyres[:, CAMBER]).reshape(by_axle).sum(axis=1)
    slips = (masses - thrust * radius / speed**2) / stiffness
    assert gradient == pytest.approx(slips[0] - slips[1], rel=0.08)
    assert 0.5 < np.degrees(gradient) * G < 1.0  # deg per g, a car that understeers a little
    assert 0.02 < trail < 0.05


def test_reversing_car_turns_the_other_way_round():
    hand_wheel = 1.0
    u = inputs(6.0, steering=hand_wheel, drive=-200.0)
    u[2500:, 1:5] = -30.0
    state = run(suv(), u).states[-1]
    assert -6.0 < state[VX] < -2.0
    steady = state[VX] * np.tan(hand_wheel / 16.0) / WHEELBASE
    assert state[YAW_RATE] == pytest.approx(steady, rel=0.05)


@pytest.mark.parametrize("torque", [0.0, 150.0, 400.0])
def test_acceleration_on_the_straight_is_the_sum_of_forces_over_the_mass(torque):
    twin = suv(15.0)
    made = run(twin, inputs(2.0, drive=torque))
    rates = np.diff(made.states, axis=0) / twin.dt
    k = 1500
    states, tyres = made.states[k], made.tyres[k]
    forces = tyres[:, FX].sum() + drag(states[VX])
    assert rates[k, VX] == pytest.approx(forces / TOTAL, rel=1e-3)
    rolling = [effective_radius(TYRE, load) for load in tyres[:, FZ]]
    # I dw/dt = T - F_x R_e - rolling resistance; without it the tyre would pass on all torque
    resistance = tyres[:, MY] + tyres[:, FX] * (np.array(rolling) - loaded_radii(tyres))
    spun = torque - tyres[:, FX] * rolling + resistance
    np.testing.assert_allclose(WHEEL_INERTIA * rates[k, SPIN:], spun, atol=0.02)
    # closed form: F R + sum of resistances, rotating masses with their share
    mass = TOTAL + 4.0 * WHEEL_INERTIA / np.mean(rolling) ** 2
    hand = (4.0 * torque + resistance.sum()) / np.mean(rolling) + drag(states[VX])
    assert rates[k, VX] == pytest.approx(hand / mass, rel=2e-3)
    share = 0.010 + 0.0005 * states[VX] / 16.7 + 0.0001 * (states[VX] / 16.7) ** 4
    np.testing.assert_allclose(-resistance, share * tyres[:, FZ] * 0.369, rtol=0.01)


def loaded_radii(tyres):
    return 0.369 - tyres[:, FZ] / 260e3


def test_mirrored_car_steered_the_other_way_drives_the_mirror_image(tmp_path):
    # Tyres are mounted mirrored already: that of the right wheel is the left one's image.
    mirror = variant(
        tmp_path,
        (r'inertial pos="0 -0.00003 0"', 'inertial pos="0 0.00003 0"'),
        ("0.14 0.097 3.86", "-0.14 0.097 -3.86"),
    )
    t = times(6.0)
    u = inputs(6.0, steering=0.8 * np.sin(2.0 * t) * (t > 0.5))
    u[:, 1:5] = np.outer(np.sin(t), [100.0, 300.0, 200.0, 50.0])
    u[:, 5:9] = np.outer(t > 4.0, [900.0, 800.0, 500.0, 400.0])
    u[:, 9:13] = 0.01 * np.sin(np.outer(t, [7.0, 8.0, 9.0, 10.0]))
    image = u.copy()
    image[:, 0] *= -1.0
    for block in (1, 5, 9):
        image[:, block : block + 4] = u[:, block : block + 4][:, SWAP]
    one, other = suv(20.0), Twin(mirror)
    other.reset(20.0)
    seen, seen_in_mirror = run(one, u).states, mirrored(run(other, image).states)
    assert np.abs(seen[:, VY]).max() > 0.1
    np.testing.assert_allclose(seen_in_mirror, seen, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("speed", [10.0, 30.0])
def test_side_force_builds_up_over_the_relaxation_length(speed):
    # A step of the hand wheel: the slip the tyre feels follows the slip it has, first order in
    # the distance rolled. Steering turns the wheels at once, and the car does not move yet.
    hand_wheel = 0.2
    made = run(suv(speed), inputs(1.0 / speed, steering=hand_wheel))
    has, felt = slip_angles(made.states, hand_wheel)[1:, :2], made.tyres[:, :2, ALPHA]
    share = (np.diff(felt, axis=0) * (has - felt[:-1])).sum(axis=0) / ((has - felt[:-1]) ** 2).sum(
        0
    )
    measured = -speed * 0.001 / np.log1p(-share)
    load = made.tyres[0, :2, FZ]
    length = 1.60 * 0.369 * np.sin(2.0 * np.arctan(load / (2.0 * 6000.0)))
    np.testing.assert_allclose(measured, length, rtol=0.02)


def test_car_runs_straight_at_80_metres_per_second_and_recovers_from_a_sharp_input():
    t = times(6.0)
    made = run(suv(80.0), inputs(6.0, steering=0.2 * ((t > 0.5) & (t < 0.6))))
    rate = made.states[:, YAW_RATE]
    assert np.abs(rate[t < 0.5]).max() < 1e-4
    assert np.abs(rate).max() > 0.02
    assert np.abs(rate[t > 4.0]).max() < 1e-4


def test_locked_wheels_stop_the_car_within_the_distance_of_sliding_friction():
    speed = 30.0
    made = run(suv(speed), inputs(5.0, brake=6000.0))
    fast = slice(300, np.argmax(made.states[:, VX] < 3.0))
    assert np.abs(made.states[fast, SPIN:]).max() < 5e-3
    loads = made.tyres[fast, :, FZ]
    friction = -longitudinal_force(loads, -1.0)
    np.testing.assert_allclose(made.tyres[fast, :, FX], -friction, rtol=0.02)
    stop = np.argmax(made.states[:, VX] < 0.01)
    mu, air = friction.sum() / loads.sum(), -drag(1.0)
    distance = TOTAL / (2.0 * air) * np.log1p(air * speed**2 / (mu * TOTAL * G))
    assert made.states[stop, X] == pytest.approx(distance, rel=0.02)
    assert distance == pytest.approx(speed**2 / (2.0 * mu * G), rel=0.02)


def test_spinning_wheels_push_with_the_friction_of_the_road():
    t = times(2.0)
    made = run(suv(1.0), inputs(2.0, drive=3500.0))
    spinning = t > 0.5
    slips, loads = made.tyres[spinning, :, KAPPA], made.tyres[spinning, :, FZ]
    assert slips.min() > 5.0
    forces = made.tyres[spinning, :, FX]
    np.testing.assert_allclose(forces, longitudinal_force(loads, slips), rtol=1e-3)
    gained = np.diff(made.states[spinning][[0, -1], VX])[0] / np.ptp(t[spinning])
    expected = (forces.sum(axis=1) + drag(made.states[spinning, VX])).mean() / TOTAL
    assert gained == pytest.approx(expected, rel=0.01)
    assert 0.55 * G < gained < 0.75 * G
