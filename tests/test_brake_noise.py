"""Brake torques below zero are noise if they are small, and a mistake if they are not."""

import numpy as np
import pytest

from twin.logs.brake_noise import without_noise_below_zero


def test_noise_below_zero_is_clipped_and_counted():
    columns = {"brake_torque_fl": np.array([-1e-9, 0.0, 900.0, -20.0, np.nan]), "ax": -np.ones(5)}
    assert without_noise_below_zero(columns) == [
        "brake_torque_fl: 2 samples down to -20 N m count as 0: noise."
    ]
    np.testing.assert_array_equal(columns["brake_torque_fl"], [0.0, 0.0, 900.0, 0.0, np.nan])
    assert columns["ax"].max() == -1.0


@pytest.mark.parametrize("values", [[-900.0, 0.0, 10.0], [-100.0, 900.0, 0.0], [-5.0, -1.0, 0.0]])
def test_brake_that_pushes_stays_for_others_to_refuse(values):
    columns = {"brake_torque_rr": np.array(values)}
    assert without_noise_below_zero(columns) == []
    assert columns["brake_torque_rr"].tolist() == values
