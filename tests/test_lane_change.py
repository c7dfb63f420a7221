import numpy as np
import pytest

from scenarios.driving.double_lane_change import lane_change, lanes, length, speeds_through, stretch

WIDTH = 1.8


def test_lanes_are_those_of_iso_3888_1():
    # begin, end, right edge: 15 m, 30 m across, 25 m, 25 m back, 15 m + 15 m; 3.5 m to the left
    entry, other, leaving = lanes(WIDTH)
    assert entry[:2] == pytest.approx([0.0, 15.0])
    assert other[:2] == pytest.approx([45.0, 70.0])
    assert leaving[:2] == pytest.approx([95.0, 125.0])
    assert np.ptp([entry[2], leaving[2]]) == 0.0
    assert other[2] - entry[2] == pytest.approx(3.5)
    widths = [lane[3] - lane[2] for lane in (entry, other, leaving)]
    assert widths == pytest.approx([1.1 * 1.8 + 0.25, 1.2 * 1.8 + 0.25, 1.3 * 1.8 + 0.25])


@pytest.mark.parametrize("stretched", [1.0, 1.8])
def test_line_runs_through_the_lanes_with_room_for_the_car(stretched):
    path = lane_change(stretched)
    for begin, end, right, left in lanes(WIDTH, stretched):
        y = path.y[(path.x >= begin) & (path.x <= end)]
        assert y.size > 20
        assert y.min() - 0.5 * WIDTH > right + 0.2
        assert y.max() + 0.5 * WIDTH < left - 0.2


def test_line_is_given_at_equal_steps_with_its_heading_and_curvature():
    path = lane_change()
    assert np.hypot(np.diff(path.x), np.diff(path.y)) == pytest.approx(path.step, rel=1e-4)
    middle = 0.5 * (path.heading[1:] + path.heading[:-1])
    np.testing.assert_allclose(np.arctan2(np.diff(path.y), np.diff(path.x)), middle, atol=3e-4)
    turned = np.diff(path.heading) / path.step
    bend = 0.5 * (path.curvature[1:] + path.curvature[:-1])
    np.testing.assert_allclose(turned, bend, atol=2e-4)
    assert path.distance[-1] == pytest.approx(length(), rel=0.01)


@pytest.mark.parametrize("speed", [20.0, 35.0])
def test_stretched_to_its_speed_a_lane_change_takes_the_same_acceleration_both_ways(speed):
    path = lane_change(stretch(speed, 9.81))
    acceleration = path.curvature * speeds_through(speed, path) ** 2
    back = path.x > 0.5 * path.x[-1]
    assert np.abs(acceleration[~back]).max() == pytest.approx(9.81, rel=0.03)
    assert np.abs(acceleration[back]).max() == pytest.approx(9.81, rel=0.03)
