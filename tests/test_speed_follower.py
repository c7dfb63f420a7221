import numpy as np
import pytest

from estimators.speed_follower import TORQUES, SpeedFollower, follow
from estimators.til.observer import Observer
from twin import INPUTS, OUTPUTS, STATES, Drive, Twin, TwinError, Vehicle

FOLLOWER = SpeedFollower(
    mass=1000.0, drag_area=0.5, radius_front=0.3, radius_rear=0.4, brake_front=0.6
)
SUV = Vehicle.load("suv")


def torques(speed, acceleration, follower=FOLLOWER, **states):
    x, u = np.zeros(len(STATES)), np.ones(len(INPUTS))
    radii = [follower.radius_front] * 2 + [follower.radius_rear] * 2
    x[-4:] = states.get("vx", 0.0) / np.array(radii)  # the wheels roll
    for name, value in states.items():
        x[STATES.index(name)] = value
    follow(follower, speed, acceleration, x, u)
    np.testing.assert_array_equal(u[[0, 9, 10, 11, 12]], 1.0)  # no torques: left alone
    return u[1:5], u[5:9]


def test_rear_wheels_drive_with_the_force_that_is_needed():
    drive, brake = torques(20.0, 2.0, vx=20.0)
    force = 1000.0 * 2.0 + 0.5 * 1.2 * 0.5 * 20.0**2
    np.testing.assert_allclose(drive, [0.0, 0.0, 0.2 * force, 0.2 * force])
    np.testing.assert_array_equal(brake, 0.0)


@pytest.mark.parametrize(("slip", "share"), [(0.1, 1.0), (0.225, 0.5), (0.5, 0.0)])
def test_wheel_that_slips_gets_less_torque(slip, share):
    gripping, _ = torques(20.0, 2.0, vx=20.0)
    slipping, _ = torques(20.0, 2.0, vx=20.0, wheel_speed_rl=(1.0 + slip) * 20.0 / 0.4)
    assert slipping[3] == gripping[3]
    assert slipping[2] == pytest.approx(share * gripping[2])


def test_all_wheels_brake_and_drag_helps():
    drive, brake = torques(20.0, -5.0, vx=20.0)
    force = 1000.0 * 5.0 - 0.5 * 1.2 * 0.5 * 20.0**2
    np.testing.assert_array_equal(drive, 0.0)
    front, rear = 0.5 * 0.3 * 0.6 * force, 0.5 * 0.4 * 0.4 * force
    np.testing.assert_allclose(brake, [front, front, rear, rear])


def test_missing_acceleration_is_left_to_the_gain():
    slow, _ = torques(20.5, np.nan, vx=20.0)
    even, _ = torques(20.0, 5.0, vx=20.0)  # gain 10/s: half a metre per second is worth 5 m/s2
    np.testing.assert_allclose(slow, even)


def test_locking_takes_torque_from_the_faster_wheel():
    locked = FOLLOWER._replace(locking=50.0)
    (_, _, left, right), _ = torques(
        20.0, 2.0, locked, vx=20.0, wheel_speed_rl=52.0, wheel_speed_rr=50.0
    )
    (_, _, free, _), _ = torques(20.0, 2.0, vx=20.0)
    assert left == pytest.approx(free - 100.0)
    assert right == pytest.approx(free + 100.0)


def torqueless(speed, **channels):
    """A drive straight on; a speed of None is no channel."""
    names = tuple(name for name in INPUTS if name not in TORQUES)
    n = 3000
    measurements = np.full((n, len(OUTPUTS)), np.nan)
    for name, values in channels.items():
        measurements[:, OUTPUTS.index(name)] = values
    known = () if speed is None else ("vx",)
    return Drive(
        time=np.arange(n) * 0.001,
        inputs=np.zeros((n, len(names))),
        input_names=names,
        measurements=np.column_stack([measurements, *([] if speed is None else [speed])]),
        output_names=(*OUTPUTS, *known),
    )


def observer(follower=None, gains=None):
    made = Observer(Twin(SUV), (), gains, follower=follower)
    made.reset(20.0)
    return made


def test_twin_accelerates_and_brakes_with_the_vehicle():
    time = np.arange(3000) * 0.001
    speed = 20.0 + 2.0 * np.sin(2.0 * time)
    follower = SpeedFollower(mass=2337.8, drag_area=0.9, radius_front=0.36, radius_rear=0.36)
    for ax, tolerance in ((4.0 * np.cos(2.0 * time), 0.1), (np.nan, 0.5)):
        estimate = observer(follower).run(torqueless(speed, ax=ax))
        np.testing.assert_allclose(estimate["vx"], speed, atol=tolerance)


@pytest.mark.parametrize(
    ("speed", "follower", "message"),
    [
        (np.full(3000, 20.0), None, "has no torques; allowed: with a measured vx"),
        (None, FOLLOWER, "has no torques; allowed: with a measured vx"),
        (np.r_[np.full(7, 20.0), np.full(2993, np.nan)], FOLLOWER, "vx is nan in sample 7"),
    ],
)
def test_speed_that_cannot_be_followed_is_refused(speed, follower, message):
    with pytest.raises(TwinError, match=message):
        observer(follower).run(torqueless(speed))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": -1.0}, "mass is -1.0; allowed: 1 to inf"),
        ({"brake_front": 1.5}, "brake_front is 1.5; allowed: 0 to 1"),
        ({"gain": np.nan}, "gain is nan"),
    ],
)
def test_follower_that_makes_no_sense_is_refused(changes, message):
    with pytest.raises(TwinError, match=message):
        observer(FOLLOWER._replace(**changes))
