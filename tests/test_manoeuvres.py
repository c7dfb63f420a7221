from itertools import pairwise

import numpy as np
import pytest

from scenarios.driving.manoeuvres import random_road, swept_steer, urban
from scenarios.experiment.single import TWIN
from twin import Twin, Vehicle


def upward_crossings(time, values):
    """When the values pass zero from below, between the samples [s]."""
    before = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    share = -values[before] / (values[before + 1] - values[before])
    return time[before] + share * (time[before + 1] - time[before])


def stretches(mask):
    """Starts and ends of the runs of true samples, shape (n, 2)."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(int))
    return np.column_stack([np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)])


def test_sweep_rises_in_proportion_to_time_and_reaches_4_hz_at_its_end():
    steering = swept_steer(duration=20.0).steering
    crossings = upward_crossings(np.arange(steering.size) * 1e-3, steering)
    frequency = 1.0 / np.diff(crossings)
    middle = 0.5 * (crossings[1:] + crossings[:-1])
    np.testing.assert_allclose(frequency, 4.0 * middle / 20.0, rtol=0.01)
    assert 3.9 < frequency[-1] < 4.0
    assert crossings[-1] > 19.5
    assert np.abs(steering).max() == pytest.approx(0.5, rel=1e-3)


def test_sweep_is_driven_twice_at_one_speed_on_a_flat_road():
    drive = swept_steer()
    first, second = np.split(drive.steering, 2)
    np.testing.assert_allclose(second, first, atol=1e-9)
    assert drive.steering.size == 40_000
    assert (drive.speed == 25.0).all()
    assert not drive.road.any()


def test_rear_wheels_meet_the_random_road_a_wheelbase_later():
    road = random_road(duration=5.0).road
    wheelbase = Twin(Vehicle.load(TWIN)).car.wheelbase
    lag = round(wheelbase / 20.0 / 1e-3)
    assert lag == 145
    np.testing.assert_array_equal(road[:, 0], road[:, 1])
    np.testing.assert_array_equal(road[:, 2], road[:, 3])
    np.testing.assert_allclose(road[lag:, 2], road[:-lag, 0], atol=1e-12)
    np.testing.assert_allclose(road[:lag, 2], 0.0, atol=1e-12)


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_random_road_walks_away_with_the_root_of_time_at_any_sample_time(dt):
    seeds = 400
    front = np.stack([random_road(dt, 10.0, seed=s).road[:, 0] for s in range(seeds)])
    for seconds in 1.0, 4.0, 9.0:
        rms = np.sqrt(np.mean(front[:, round(seconds / dt)] ** 2))
        # the rms of so many walks is off by 1/sqrt(2 seeds) = 3.5 % by chance
        assert rms == pytest.approx(0.01 * np.sqrt(seconds), rel=0.12)


def test_random_road_is_the_same_unless_its_seed_differs():
    road = random_road(duration=1.0).road
    np.testing.assert_array_equal(random_road(duration=1.0).road, road)
    assert np.abs(random_road(duration=1.0, seed=1).road - road).max() > 1e-3


def test_town_allows_50_km_h_and_stops_three_times_on_the_way():
    drive = urban()
    assert np.nanmax(drive.speed) == pytest.approx(50.0 / 3.6, rel=1e-6)
    assert np.nanmin(drive.speed) == 0.0
    stands = [(a, b) for a, b in stretches(drive.speed == 0.0) if b - a >= 1000]
    assert stands[0][0] == 0
    assert len(stands) == 4
    assert all((b - a) * drive.dt >= 2.0 for a, b in stands)
    for (_, end), (start, _) in pairwise(stands):
        assert np.nanmax(drive.speed[end:start]) > 30.0 / 3.6


def test_town_takes_two_minutes_straight_on_with_feet_off_the_pedals_at_times():
    drive = urban()
    assert drive.speed.size * drive.dt == pytest.approx(120.0, abs=15.0)
    assert not drive.steering.any()
    coasting = stretches(np.isnan(drive.speed))
    assert len(coasting) >= 3
    assert (np.diff(coasting) * drive.dt >= 4.0).all()


def test_town_is_driven_with_smooth_pedals():
    speed = urban().speed
    acceleration = np.diff(speed) / 1e-3
    jumps = np.abs(np.diff(acceleration))
    assert np.nanmax(np.abs(acceleration)) < 5.0
    assert np.nanmax(jumps) < 0.05  # m/s2 from one millisecond to the next


@pytest.mark.parametrize("manoeuvre", [urban, swept_steer, random_road])
def test_part_of_a_manoeuvre_is_its_beginning(manoeuvre):
    part, longer = manoeuvre(duration=3.0), manoeuvre(duration=6.0)
    for name in "speed", "steering", "road":
        beginning = getattr(longer, name)[:3000]
        np.testing.assert_allclose(getattr(part, name), beginning, atol=1e-12)
