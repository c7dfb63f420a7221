import numpy as np
import pytest

from estimators.benchmarks import static_map
from estimators.benchmarks.static_map import StaticMap

T = np.arange(4000) * 0.01
MASS, FRONT, REAR, STIFFNESS = 1000.0, 1.2, 1.4, 90e3  # of the rear axle [N/rad]


def steady():
    """Steady corners of a linear single-track car at changing speed."""
    speed = 25.0 + 5.0 * np.sin(0.1 * T)
    yaw_rate = 0.2 * np.sin(0.5 * T)
    ay = speed * yaw_rate
    sideslip = REAR * yaw_rate / speed - MASS * FRONT * ay / ((FRONT + REAR) * STIFFNESS)
    return ay, yaw_rate, speed, sideslip


def test_map_of_a_linear_car_is_its_geometry_and_rear_stiffness():
    found = static_map.fit(*steady())
    assert found.per_curvature == pytest.approx(REAR)
    assert found.per_ay == pytest.approx(-MASS * FRONT / ((FRONT + REAR) * STIFFNESS))
    assert found.offset == pytest.approx(0.0, abs=1e-12)


def test_prediction_repeats_what_was_fitted():
    ay, yaw_rate, speed, sideslip = steady()
    predicted = static_map.predict(
        static_map.fit(ay, yaw_rate, speed, sideslip), ay, yaw_rate, speed
    )
    np.testing.assert_allclose(predicted, sideslip, atol=1e-12)


def test_offset_is_found():
    ay, yaw_rate, speed, sideslip = steady()
    assert static_map.fit(ay, yaw_rate, speed, sideslip + 0.01).offset == pytest.approx(0.01)


def test_map_is_linear_in_its_numbers():
    ay, yaw_rate, speed, _ = steady()
    one = static_map.predict(StaticMap(0.1, 0.2, 0.3), ay, yaw_rate, speed)
    two = static_map.predict(StaticMap(0.2, 0.4, 0.6), ay, yaw_rate, speed)
    np.testing.assert_allclose(two, 2.0 * one)


@pytest.mark.parametrize(("frequency", "gain"), [(0.2, 1.0), (2.0, 0.5), (20.0, 0.0)])
def test_low_pass_halves_its_corner_and_does_not_delay(frequency, gain):
    """Forwards and backwards: the square of 1/sqrt(2), no phase."""
    wave = np.sin(2.0 * np.pi * frequency * T)
    inner = slice(1000, 3000)
    passed = static_map.low_pass(wave, 0.01)[inner]
    np.testing.assert_allclose(passed, gain * wave[inner], atol=0.01)
