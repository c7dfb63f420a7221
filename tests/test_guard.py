import numpy as np
import pytest

from estimators.til.measurement_validation import FREEZE, new_watch
from estimators.til.measurement_validation import guard as watch_sample
from twin import OUTPUTS

DT = 1e-3
AX, YAW_RATE, WHEEL = (OUTPUTS.index(name) for name in ("ax", "yaw_rate", "wheel_speed_fl"))


def watched(measured, twin):
    """What a guard lets through of (N, 10) measurements, and whether each sample was sound."""
    watch = new_watch(OUTPUTS, set(OUTPUTS))
    y = measured.copy()
    sound = np.array([watch_sample(watch, a, b, DT) for a, b in zip(y, twin, strict=True)])
    return y, sound


@pytest.fixture
def signals():
    """A car and its twin on a winding road: (2, N, 10)."""
    time = np.arange(0.0, 8.0, DT)
    twin = np.zeros((time.size, len(OUTPUTS)))
    twin[:, AX] = np.sin(time)
    twin[:, 1] = 2.0 * np.sin(1.3 * time)
    twin[:, 2] = 9.81 + 0.2 * np.sin(5.0 * time)
    twin[:, 3:6] = 0.1 * np.sin(2.0 * time)[:, None]
    twin[:, 6:] = 40.0 - 3.0 * np.cos(time)[:, None]
    noise = np.random.default_rng(0).normal(size=twin.shape)
    return twin + noise * [0.3, 0.3, 0.3, *(0.01,) * 3, *(0.05,) * 4], twin


def test_sound_measurements_pass_as_they_are(signals):
    measured, twin = signals
    passed, sound = watched(measured, twin)
    np.testing.assert_array_equal(passed, measured)
    assert sound.all()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 490.0])
def test_value_that_no_car_shows_becomes_nan(signals, value):
    measured, twin = signals
    measured[5000, AX] = value
    passed, sound = watched(measured, twin)
    assert np.isnan(passed[5000, AX])
    assert np.flatnonzero(~sound).tolist() == [5000]


@pytest.mark.parametrize("channel", [AX, YAW_RATE, WHEEL])
def test_frozen_channel_is_found_within_a_second_and_ends_with_the_freeze(signals, channel):
    measured, twin = signals
    measured[3000:6000, channel] = measured[3000, channel]
    passed, sound = watched(measured, twin)
    assert sound[: 3000 + round(FREEZE / DT) - 1].all()
    assert not sound[4500:6000].any()
    assert np.isnan(passed[4500:6000, channel]).all()
    np.testing.assert_array_equal(passed[6000:], measured[6000:])


def test_coarse_digits_are_not_frozen(signals):
    _, twin = signals
    digits = np.array([0.05] * 3 + [0.0044] * 3 + [0.1] * 4)
    measured = digits * np.round(twin / digits)
    _, sound = watched(measured, twin)
    assert sound.all()


def test_car_that_stands_has_no_frozen_sensors(signals):
    """Its sensors hold their values; a twin that stops later, or rings, is no reason to doubt."""
    _, twin = signals
    measured = np.zeros_like(twin)
    measured[:, 2] = 9.81
    _, sound = watched(measured, twin * ([1.0] * 6 + [0.0] * 4))
    assert sound.all()


def test_gate_rejects_a_burst_and_opens_for_what_lasts(signals):
    measured, twin = signals
    measured[2000:2050, AX] += 15.0
    measured[4000:, WHEEL] += 12.0
    passed, _ = watched(measured, twin)
    assert np.isnan(passed[2000:2050, AX]).all()
    assert np.isfinite(passed[2060:, AX]).all()
    assert np.isnan(passed[4000:4200, WHEEL]).all()
    assert np.isfinite(passed[7000:, WHEEL]).all()


def test_channel_that_nobody_uses_is_no_reason_to_distrust(signals):
    measured, twin = signals
    measured[:, YAW_RATE] = np.nan
    watch = new_watch(OUTPUTS, {"ax"})
    assert all(watch_sample(watch, a.copy(), b, DT) for a, b in zip(measured, twin, strict=True))


def test_outputs_that_are_none_of_a_cars_are_only_watched_for_infinities():
    watch = new_watch(("heave", "vz"), {"vz"})
    y = np.array([1e9, np.inf])
    assert not watch_sample(watch, y, np.zeros(2), DT)
    assert y[0] == 1e9
    assert np.isnan(y[1])
