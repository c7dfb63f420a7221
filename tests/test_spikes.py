import numpy as np
import pytest

from twin import Drive
from twin.logs.spikes import without_spikes

TIME = np.arange(1000) / 100.0
STEERING = 0.05 * np.sin(2.0 * np.pi * 0.5 * TIME)


def test_spikes_are_left_out_and_the_rest_stays():
    spoilt = STEERING.copy()
    spoilt[[100, 500, 501]] += 0.2
    found, count = without_spikes(TIME, spoilt)
    assert count == 3
    assert np.isnan(found[[100, 500, 501]]).all()
    rest = np.isfinite(found)
    np.testing.assert_array_equal(found[rest], STEERING[rest])
    assert rest.sum() == TIME.size - 3


@pytest.mark.parametrize(
    "steering",
    [
        STEERING,
        np.zeros_like(TIME),
        np.where(TIME > 5.0, 0.1, 0.0),  # a step of a steering robot
        np.round(STEERING / 0.005) * 0.005,  # coarse digits
        0.05 * np.sin(2.0 * np.pi * 4.0 * TIME),  # faster than any driver
    ],
)
def test_what_a_driver_or_robot_does_stays(steering):
    found, count = without_spikes(TIME, steering)
    assert count == 0
    np.testing.assert_array_equal(found, steering)


def test_slow_log_stays_as_it_is():
    spoilt = STEERING.copy()
    spoilt[100] += 0.2
    assert without_spikes(10.0 * TIME, spoilt)[1] == 0


def test_spikes_of_road_wheels_are_left_out():
    spoilt = STEERING.copy()
    spoilt[500] += 0.2
    wheel = {"name": "delta", "unit": "rad"}
    log_map = {
        "rate": 100,
        "follow_speed": True,
        "time": {"name": "t", "unit": "s"},
        "channels": {"road_wheel_angle": wheel, "vx": {"name": "v", "unit": "m/s"}},
        "constants": {"road_height": 0.0},
        "car": {"steering_ratio": 2.0},
    }
    frame = {"t": TIME, "delta": spoilt, "v": np.full_like(TIME, 20.0)}
    drive = Drive.from_frame(frame, log_map)
    found = drive.channel("steering_wheel_angle")
    np.testing.assert_allclose(found, 2.0 * STEERING, atol=1e-3)
