"""Stopping, standing and starting: on the flat, on a slope, with one wheel off the ground."""

import numpy as np
import pytest
from cars import (
    FL,
    FR,
    FX,
    FY,
    FZ,
    HALF_TRACK,
    PITCH,
    PLACES,
    RL,
    RR,
    SPIN,
    TOTAL,
    VX,
    WHEEL_INERTIA,
    WHEELBASE,
    G,
    X,
    Y,
    Z,
    drag,
    inputs,
    run,
    suv,
    times,
)

from scenarios.driving.manoeuvres import Manoeuvre
from scenarios.driving.record import record
from twin import Vehicle

GRADE = 0.15
BRAKE = 2000.0  # [N m] per wheel


def test_town_car_stands_still_three_seconds_after_it_stopped():
    t = times(24.0)
    fastest = 50.0 / 3.6
    speed = np.interp(t, [1.0, 9.0, 11.0, 18.0], [0.0, fastest, fastest, 0.0])
    manoeuvre = Manoeuvre(
        name="stop", dt=0.001, speed=speed, steering=0.0 * t, road=np.zeros((t.size, 4))
    )
    truth = record(Vehicle.load("suv"), manoeuvre).truth
    assert truth["vx"].max() == pytest.approx(fastest, rel=0.05)
    stop = np.argmax((t > 15.0) & (truth["vx"] < 0.05))
    still = slice(stop + 3000, None)
    assert t[stop] < 20.0
    for axis in ("vx", "vy", "vz"):
        assert np.abs(truth[axis][still]).max() < 1e-3 / np.sqrt(3.0)
    assert np.ptp(truth["x"][still]) < 1e-4


def on_slope(grade, bank=0.0):
    """The car standing on its brakes after the level road has tilted, and the road's heights."""
    rise, across = np.sin(np.arctan([grade, bank]))
    road = PLACES[:, 0] * rise + PLACES[:, 1] * across
    twin = suv()
    run(twin, inputs(7.0, brake=BRAKE, road=np.outer(np.minimum(times(7.0) / 2.0, 1.0), road)))
    return twin, road


@pytest.mark.parametrize(("grade", "bank"), [(0.0, 0.0), (GRADE, 0.0), (-GRADE, 0.0), (0.0, 0.1)])
def test_brakes_hold_a_standing_car_without_creep(grade, bank):
    twin, road = on_slope(grade, bank)
    made = run(twin, inputs(30.0, brake=BRAKE, road=road))
    crept = np.ptp(made.states[:, [X, Y, Z]], axis=0)
    assert crept.max() < 5e-5
    tyres, (rise, across) = made.tyres[-1], np.sin(np.arctan([grade, bank]))
    weight = TOTAL * G
    assert tyres[:, FX].sum() == pytest.approx(weight * rise, rel=1e-3, abs=2.0)
    assert tyres[:, FY].sum() == pytest.approx(weight * across, rel=1e-3, abs=2.0)
    upright = np.sqrt(1.0 - rise**2 - across**2)
    assert tyres[:, FZ].sum() == pytest.approx(weight * upright, rel=1e-4)


def test_brakes_too_weak_for_the_slope_do_not_hold():
    twin, road = on_slope(GRADE)
    weak = 0.9 * TOTAL * G * np.sin(np.arctan(GRADE)) * 0.36 / 4.0
    made = run(twin, inputs(2.0, brake=weak, road=road))
    assert made.states[-1, VX] < -0.1


@pytest.mark.parametrize("grade", [GRADE, -GRADE])
def test_free_car_on_a_slope_rolls_with_gravity_less_rolling_resistance(grade):
    twin, road = on_slope(grade)
    slope, start = np.arctan(grade), twin.data.qpos[0]
    u, speed, load = inputs(0.001, road=road), [], []
    for _ in range(2000):
        u[0, 9:] = road + (twin.data.qpos[0] - start) * np.tan(slope)
        made = run(twin, u)
        speed.append(made.states[0, VX])
        load.append(made.tyres[0, :, FZ].sum())
    radius = 0.36
    resistance = (0.010 + 0.0005 * 0.1) * TOTAL * G * np.cos(slope) * 0.369 / radius
    force = TOTAL * G * np.sin(slope) - np.sign(grade) * resistance
    mass = TOTAL + 4.0 * WHEEL_INERTIA / radius**2
    acceleration = (speed[-1] - speed[999]) / 1.0
    air = drag(np.mean(np.abs(speed[1000:]))) * np.sign(grade)
    assert acceleration == pytest.approx((-force - air) / mass, rel=2e-3)
    assert np.mean(load[1000:]) == pytest.approx(TOTAL * G * np.cos(slope), rel=2e-3)


@pytest.mark.parametrize(("hole", "lifted"), [(FL, RR), (FR, RL), (RL, FR), (RR, FL)])
def test_car_over_a_deep_hole_stands_on_three_wheels(hole, lifted):
    # The road's mean plane leans towards the hole, so that the car tips into it; the wheel across
    # leaves the ground.
    t, drop = times(14.0), 0.5
    road = np.zeros((t.size, 4))
    road[:, hole] = -drop * np.minimum(t, 1.0)
    made = run(suv(), inputs(14.0, brake=3000.0, road=road))
    load = made.tyres[-1, :, FZ]
    assert load[lifted] == 0.0
    assert np.all(np.delete(load, lifted) > 0.0)
    # The tyres bear on that plane's normal.
    upright = np.sqrt(1.0 - (drop / 2.0 / WHEELBASE) ** 2 - (drop / 4.0 / HALF_TRACK) ** 2)
    assert load.sum() == pytest.approx(TOTAL * G * upright, rel=0.01)


@pytest.mark.parametrize("speed", [20.0, -20.0])
def test_tyres_that_follow_a_grade_bear_the_load_of_their_springs(speed):
    twin, road = on_slope(GRADE)
    slope, start = np.arctan(GRADE), twin.data.qpos[0]
    sent = np.zeros(28)
    sent[VX], sent[SPIN:] = speed, speed / 0.36
    twin.correct(sent)
    for _ in range(3):
        heights = road + (twin.data.qpos[0] - start) * np.tan(slope)
        made = run(twin, inputs(0.001, road=heights))
    gaps = (twin.data.xpos[twin.car.wheel_body, 2] - heights) * np.cos(slope)
    np.testing.assert_allclose(made.tyres[0, :, FZ], 260e3 * (0.369 - gaps), atol=5.0)


@pytest.mark.parametrize("speed", [0.0, 20.0])
@pytest.mark.parametrize("grade", [0.03, 0.05, 0.15])
def test_reset_settles_the_car_on_a_slope(grade, speed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where MuJoCo may write its log
    slope = np.arctan(grade)
    road = PLACES[:, 0] * np.sin(slope)
    twin = suv(speed, road=road)
    made = run(twin, inputs(0.001, road=road))
    assert made.states[0, PITCH] == pytest.approx(-slope, abs=0.01)
    assert made.tyres[0, :, FZ].sum() == pytest.approx(TOTAL * G * np.cos(slope), rel=2e-4)
