"""Faults of sensors, injected at a third of the loaded SUV's drive through town."""

import numpy as np
import pytest

from estimators.til.default_observer import default_observer
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import record
from twin import OUTPUTS, STATES, Twin, Vehicle, with_noise

VARIATION = 355.0
FAULT = 20_000  # sample at which it begins
AX, YAW_RATE = OUTPUTS.index("ax"), OUTPUTS.index("yaw_rate")
WHEEL = OUTPUTS.index("wheel_speed_rl")


@pytest.fixture(scope="module")
def drive():
    clean = record(Vehicle.load("suv_loaded"), urban(duration=60.0))
    return with_noise(clean, 10.0, np.random.default_rng(11))


@pytest.fixture(scope="module")
def observed(drive):
    """Observes the drive with a fault; checks what holds under any fault."""

    def observe(fault=lambda y: None):
        y = drive.measurements.copy()
        fault(y)
        observer = default_observer(Vehicle.load("suv"), set(OUTPUTS)).observer
        observer.reset(0.0)
        estimate = observer.run(drive.replace(measurements=y))
        assert np.isfinite(estimate.states).all()
        assert np.isfinite(estimate.parameters).all()
        assert np.abs(estimate["mass"]).max() < 900.0
        assert np.abs(estimate["vx"] - drive.truth["vx"]).max() < 1.0
        assert np.abs(estimate["vy"]).max() < 0.2
        return estimate

    return observe


def recovers(estimate):
    return abs(estimate["mass"][-1] - VARIATION) < 0.1 * VARIATION


def flagged(estimate, first, last):
    """Whether the flag is down from one sample to the other and up again two seconds after."""
    flag = estimate.trustworthy
    return not flag[first:last].any() and flag[last + 2000]


def held(column, seconds, value=None):
    def fault(y):
        part = slice(FAULT, FAULT + round(1e3 * seconds))
        y[part, column] = y[FAULT, column] if value is None else value

    return fault


def test_drive_without_a_fault_is_trustworthy_but_for_its_start(observed):
    estimate = observed()
    assert recovers(estimate)
    assert not estimate.trustworthy[:999].any()
    assert estimate.trustworthy[1001:].all()


@pytest.mark.parametrize("value", [None, 2.5])
def test_frozen_accelerometer_is_bridged(observed, value):
    estimate = observed(held(AX, 5.0, value))
    assert recovers(estimate)
    assert flagged(estimate, FAULT + 1000, FAULT + 5000)
    assert np.ptp(estimate["mass"][FAULT : FAULT + 5000]) < 0.15 * VARIATION


def test_stuck_wheel_speed_is_left_out_for_good(observed):
    estimate = observed(held(WHEEL, 40.0))
    assert recovers(estimate)
    assert not estimate.trustworthy[FAULT + 1000 :].any()


def test_wheel_speed_stuck_at_zero_is_left_out_at_once(observed):
    estimate = observed(held(WHEEL, 5.0, 0.0))
    assert recovers(estimate)
    assert flagged(estimate, FAULT, FAULT + 5000)


def test_spike_of_50_g_leaves_no_trace(observed):
    def spike(y):
        y[FAULT : FAULT + 3, :3] = 50.0 * 9.81

    estimate, without = observed(spike), observed()
    assert flagged(estimate, FAULT, FAULT + 3)
    np.testing.assert_allclose(estimate["mass"], without["mass"], atol=2.0)


@pytest.mark.parametrize("missing", [np.nan, np.inf])
def test_gap_of_two_seconds_is_bridged(observed, missing):
    def gap(y):
        y[FAULT : FAULT + 2000] = missing

    estimate = observed(gap)
    assert recovers(estimate)
    assert flagged(estimate, FAULT, FAULT + 2000)


def test_bursts_of_missing_values_are_bridged(observed):
    def bursts(y):
        rng = np.random.default_rng(3)
        for start in rng.integers(FAULT, FAULT + 10_000, 20):
            y[start : start + rng.integers(10, 300)] = np.nan

    estimate = observed(bursts)
    assert recovers(estimate)
    assert not estimate.trustworthy[FAULT : FAULT + 10_000].all()


@pytest.mark.parametrize("offset", [0.5, -0.5])
def test_offset_that_begins_on_the_way_is_found_and_taken_off(observed, offset):
    def shift(y):
        y[FAULT:, AX] += offset

    estimate = observed(shift)
    assert recovers(estimate)
    assert not estimate.trustworthy[FAULT : FAULT + 1000].all()
    assert estimate.trustworthy[-1]


def test_offset_of_the_yaw_rate_leaves_the_mass_alone(observed):
    def shift(y):
        y[FAULT:, YAW_RATE] += 0.03

    assert recovers(observed(shift))


def test_delay_of_30_ms_is_bridged(observed):
    def delay(y):
        y[FAULT:] = y[FAULT - 30 : -30].copy()

    assert recovers(observed(delay))


def test_twin_that_is_wrong_does_not_lock_its_sensors_out(drive):
    """At 5 m/s too much no wheel speed fits; the gates open, and the twin is brought back."""
    observer = default_observer(Vehicle.load("suv"), set(OUTPUTS)).observer
    observer.reset(5.0)
    part = slice(0, 8000)
    estimate = observer.run(
        drive.replace(
            time=drive.time[part], inputs=drive.inputs[part],
            measurements=drive.measurements[part],
            truth={name: values[part] for name, values in drive.truth.items()},
        )
    )  # fmt: skip
    assert abs(estimate["vx"][-1] - drive.truth["vx"][7999]) < 0.1
    assert estimate.trustworthy[-1]
    assert len(STATES) == estimate.states.shape[1]


def test_default_observer_of_any_car_weighs_the_whole_car():
    for name in ("suv", "sports_car"):
        vehicle = Vehicle.load(name)
        observer = default_observer(vehicle, set(OUTPUTS)).observer
        whole = Twin(vehicle).model.body_subtreemass[0]
        assert observer._laws["scale"][0] == pytest.approx(whole)
