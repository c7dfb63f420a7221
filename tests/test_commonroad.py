"""The recorded drive of CommonRoad's car says one thing only: kinematics, torques, loads."""

import dataclasses

import numpy as np
import pytest

from estimators.til.law import ParameterLaw
from estimators.til.observer import Observer
from scenarios.driving.drivers import driver_of, limits_of
from scenarios.driving.manoeuvres import lane_changes, laps
from scenarios.plants.commonroad import DT, LANE_CHANGE_LATERAL, commonroad_limits, record
from twin import INPUTS, OUTPUTS, PARAMETERS, STATES, TYRE_OUTPUTS, WHEELS, Twin, TwinError, Vehicle
from twin.commonroad.model import GRAVITY, bmw_320i

CAR = bmw_320i()
COURSE = lane_changes(limits=commonroad_limits(), lateral=LANE_CHANGE_LATERAL, duration=30.0)

LAP = laps(limits=commonroad_limits(), duration=30.0)


@pytest.fixture(scope="module")
def drive():
    return record(COURSE)


@pytest.fixture(scope="module")
def lap():
    return record(LAP)


def of(drive, name):
    """(N, 4) truth of the wheels."""
    return np.column_stack([drive.truth[f"{name}_{wheel}"] for wheel in WHEELS])


def inputs(drive, name):
    return np.column_stack([drive.channel(f"{name}_{wheel}") for wheel in WHEELS])


def rate(values):
    """Central differences, of the samples but the first and last."""
    return (values[2:] - values[:-2]) / (2.0 * DT)


def test_channels_and_truth_are_those_of_a_car_of_ours(drive):
    assert (drive.input_names, drive.output_names) == (INPUTS, OUTPUTS)
    names = {*STATES, *OUTPUTS, *PARAMETERS, "sideslip"}
    names |= {f"{name}_{wheel}" for name in TYRE_OUTPUTS for wheel in WHEELS}
    assert set(drive.truth) == names
    unknown = {name for name, values in drive.truth.items() if np.isnan(values).any()}
    assert unknown == {"Jzz", *(f"{m}_{wheel}" for m in ("mx", "my", "mz") for wheel in WHEELS)}


def test_mass_is_that_of_the_twins_chassis(drive):
    twin = Twin(Vehicle.load("bmw_320i"))
    assert drive.truth["mass"][0] == pytest.approx(twin.car.nominal[0], abs=1e-3)
    total = twin.car.nominal[0] + twin.car.other_mass[1]
    assert total == pytest.approx(CAR.m, abs=0.01)


@pytest.mark.parametrize("course", ["drive", "lap"])
def test_courses_turn_and_brake_below_six_tenths_of_g(course, request):
    drive = request.getfixturevalue(course)
    truth = drive.truth
    ax = drive.channel("ax") + GRAVITY * np.sin(truth["pitch"])
    ay = drive.channel("ay") - GRAVITY * np.cos(truth["pitch"]) * np.sin(truth["roll"])
    assert np.abs(ay).max() > 0.3 * GRAVITY
    assert ax.min() < -0.3 * GRAVITY
    assert np.hypot(ax, ay).max() < 0.6 * GRAVITY
    assert truth["vx"].min() > 2.0
    assert of(drive, "fz").min() > 0.0


def test_imu_measures_what_its_motion_and_gravity_amount_to(drive):
    """a = dv/dt + omega x v + g up, all in the axes of the body."""
    truth = drive.truth
    v = np.column_stack([truth[name] for name in ("vx", "vy", "vz")])
    turn = np.column_stack([truth[f"{name}_rate"] for name in ("roll", "pitch", "yaw")])
    roll, pitch = truth["roll"], truth["pitch"]
    up = np.column_stack(
        [-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)]
    )
    expected = rate(v) + (np.cross(turn, v) + GRAVITY * up)[1:-1]
    np.testing.assert_allclose(drive.measurements[1:-1, :3], expected, atol=0.03)


def test_positions_and_angles_are_the_integrals_of_the_rates(drive):
    truth = {name: values[1:-1] for name, values in drive.truth.items()}
    roll, pitch, yaw = truth["roll"], truth["pitch"], truth["yaw"]
    rates = {name: rate(drive.truth[name]) for name in ("x", "y", "z", "roll", "pitch", "yaw")}
    p = rates["roll"] - rates["yaw"] * np.sin(pitch)
    q = rates["pitch"] * np.cos(roll) + rates["yaw"] * np.cos(pitch) * np.sin(roll)
    r = rates["yaw"] * np.cos(pitch) * np.cos(roll) - rates["pitch"] * np.sin(roll)
    for name, expected in (("roll_rate", p), ("pitch_rate", q), ("yaw_rate", r)):
        np.testing.assert_allclose(truth[name], expected, atol=1e-4)
    # the speed over ground and its direction, from the world's axes
    ahead = rates["x"] * np.cos(yaw) + rates["y"] * np.sin(yaw)
    left = rates["y"] * np.cos(yaw) - rates["x"] * np.sin(yaw)
    up = rates["z"]
    upright = ahead * np.sin(pitch) + up * np.cos(pitch)
    vx, vy = ahead * np.cos(pitch) - up * np.sin(pitch), left * np.cos(roll)
    np.testing.assert_allclose(truth["vx"], vx, atol=1e-4)
    np.testing.assert_allclose(truth["vy"], vy + upright * np.sin(roll), atol=1e-4)
    assert np.abs(truth["vy"]).max() > 0.05
    np.testing.assert_allclose(truth["sideslip"], np.arctan2(truth["vy"], truth["vx"]), atol=1e-15)


def test_torques_balance_tyre_forces_and_wheel_accelerations(drive):
    torque = inputs(drive, "drive_torque") - inputs(drive, "brake_torque")
    spin = np.column_stack([rate(drive.truth[f"wheel_speed_{wheel}"]) for wheel in WHEELS])
    expected = CAR.I_y_w * spin + CAR.R_w * of(drive, "fx")[1:-1]
    np.testing.assert_allclose(torque[1:-1], expected, atol=2.0)
    assert (inputs(drive, "drive_torque") * inputs(drive, "brake_torque") == 0.0).all()
    assert np.abs(torque).max() > 300.0


def test_torques_are_those_that_the_driver_asked_for(drive):
    """Drive behind only, and brakes in the fixed shares of the driver: the model adds nothing."""
    driver = driver_of(Vehicle.load("bmw_320i"))
    brake = inputs(drive, "brake_torque")
    share = brake[:, :2].sum(axis=1) / np.maximum(brake.sum(axis=1), 1e-9)
    np.testing.assert_allclose(share[brake.sum(axis=1) > 1.0], driver.brake_front, atol=1e-9)
    np.testing.assert_allclose(inputs(drive, "drive_torque")[:, :2], 0.0, atol=1e-9)
    assert (brake >= 0.0).all()


def test_tyre_forces_add_up_to_the_acceleration_of_the_car(drive):
    """Along the car; across it its axles move by themselves, and their forces come and go."""
    steer = drive.channel("steering_wheel_angle") / 16.0
    fx, fy = of(drive, "fx"), of(drive, "fy")
    front = fx[:, :2].sum(axis=1) * np.cos(steer) - fy[:, :2].sum(axis=1) * np.sin(steer)
    pitch, roll = drive.truth["pitch"], drive.truth["roll"]
    ax, ay, az = drive.measurements[:, :3].T
    level = ax * np.cos(pitch) + (ay * np.sin(roll) + az * np.cos(roll)) * np.sin(pitch)
    np.testing.assert_allclose(level, (front + fx[:, 2:].sum(axis=1)) / CAR.m, atol=1e-9)


def test_wheel_loads_carry_the_car_and_shift_as_it_turns(drive):
    fz = of(drive, "fz")
    assert fz.sum(axis=1).mean() == pytest.approx(CAR.m * GRAVITY, rel=2e-3)
    ay = drive.truth["vx"] * drive.truth["yaw_rate"]
    left_turn = ay > 3.0
    shift = fz[left_turn][:, [1, 3]].sum(axis=1) - fz[left_turn][:, [0, 2]].sum(axis=1)
    assert (shift > 2000.0).all()


def test_suspension_rates_are_those_of_the_travels(drive):
    for wheel in WHEELS:
        travel, speed = (drive.truth[f"suspension_{name}_{wheel}"] for name in ("travel", "rate"))
        assert np.abs(travel).max() > 0.01
        np.testing.assert_allclose(rate(travel), speed[1:-1], atol=0.02)


def test_the_driver_keeps_it_on_the_course(lap):
    path, truth = LAP.course, lap.truth
    nearest = np.hypot(
        truth["x"][::500, None] - path.x[None, :], truth["y"][::500, None] - path.y[None, :]
    ).min(axis=1)
    assert nearest.max() < 1.0


def test_our_twin_finds_its_sideslip_and_its_mass(lap):
    """Models that share nothing but their parameters; the gains are those of a prototype."""
    gains = {("yaw_rate", "yaw_rate"): 50.0, ("pitch_rate", "pitch_rate"): 10.0, ("vy", "ay"): 0.05}
    gains |= {(f"wheel_speed_{wheel}", f"wheel_speed_{wheel}"): 1.0 for wheel in WHEELS}
    law = ParameterLaw(
        parameter="mass", signal="ax", scale=CAR.m, prior_sd=350.0, noise_density=0.02
    )
    observer = Observer(Twin(Vehicle.load("bmw_320i")), [law], gains)
    observer.reset(float(lap.truth["vx"][0]), {"mass": -200.0})
    estimate = observer.run(lap)
    error = np.arctan2(estimate["vy"], estimate["vx"]) - lap.truth["sideslip"]
    assert np.degrees(np.sqrt(np.mean(error**2))) < 0.1
    assert abs(estimate["mass"][-1]) < 0.01 * CAR.m


@pytest.mark.parametrize(
    "changes", [{"dt": 0.002}, {"road": np.full_like(COURSE.road, 0.01)}], ids=["dt", "road"]
)
def test_what_the_model_does_not_know_is_refused(changes):
    with pytest.raises(TwinError, match=r"needs a flat road and samples every 0\.001 s"):
        record(dataclasses.replace(COURSE, **changes))


def test_a_drive_beyond_the_limits_of_the_model_is_refused():
    driver = driver_of(Vehicle.load("bmw_320i"))._replace(proportional=1e5, pedal_rate=1e7)
    fast = lane_changes(limits=limits_of(Vehicle.load("sports_car")), lateral=1.3, duration=20.0)
    with pytest.raises(TwinError, match=r"lane changes: at t = .* has come to rest, locked or lif"):
        record(fast, driver)
