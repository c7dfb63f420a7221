import numpy as np
import pytest

from estimators.score import rms_pct, settling_time

DT = 0.001


def test_rms_counts_only_the_last_second():
    estimate = np.concatenate([np.full(5000, 1e6), np.full(1000, 357.0)])
    assert rms_pct(estimate, 355.0, DT) == pytest.approx(100 * 2 / 355)


def test_rms_of_an_oscillation_is_its_amplitude_over_root_two():
    estimate = -50.0 + 5.0 * np.sin(2 * np.pi * 10 * np.arange(3000) * DT)
    assert rms_pct(estimate, -50.0, DT) == pytest.approx(100 * 0.1 / np.sqrt(2))


def test_settling_time_is_when_the_error_stays_small():
    estimate = np.full(4000, 100.0)
    estimate[:1500] = 0.0
    estimate[2500] = 111.0
    assert settling_time(estimate, 100.0, DT) == pytest.approx(2.501)


def test_estimate_that_ends_outside_never_settles():
    assert settling_time(np.array([100.0, 100.0, 89.0]), 100.0, DT) == float("inf")
    assert settling_time(np.full(3, 100.0), 100.0, DT) == 0.0
