import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimators.ensemble.rigid_body import LEAST_SLACK, project, tensor

NOMINAL = np.array([2000.0, 0, 0, 0, 800.0, 3600.0, 3900.0, 0, 0, 0])
INDEX = np.arange(10)
SD = np.array([300.0, 0.1, 0.1, 0.1, 150.0, 900.0, 900.0, 30.0, 80.0, 30.0])


def projected(z, covariance):
    z, theta = np.array(z, dtype=float), np.zeros(10)
    project(z, covariance, INDEX, NOMINAL, theta)
    return z


def test_possible_body_stays_as_it_is():
    z = np.array([355.0, -0.1, 0, 0, 70.0, 280.0, 312.0, 10.0, 50.0, 5.0])
    np.testing.assert_array_equal(projected(z, np.diag(SD**2)), z)


@settings(deadline=None, max_examples=50)
@given(st.lists(st.floats(-3.0, 3.0), min_size=10, max_size=10))
def test_any_estimate_becomes_possible(steps):
    z = projected(np.array(steps) * SD, np.diag(SD**2))
    moments = np.linalg.eigvalsh(tensor(NOMINAL, z))
    assert NOMINAL[0] + z[0] > 0.0
    assert moments[0] > 0.0
    assert moments[2] <= moments[0] + moments[1]


def test_what_is_known_well_moves_least():
    z = np.zeros(10)
    z[4:7] = -700.0, 0.0, 700.0  # no body: 4600 > 100 + 3600
    sure = SD.copy()
    sure[6] = 1.0
    moved = projected(z, np.diag(sure**2)) - z
    assert abs(moved[6]) < 1.0 < abs(moved[5])


def test_correlated_estimates_move_along():
    z = np.zeros(10)
    z[6] = 1000.0
    covariance = np.diag(SD**2)
    covariance[0, 6] = covariance[6, 0] = 0.9 * SD[0] * SD[6]
    moved = projected(z, covariance) - z
    assert moved[6] < 0.0
    assert moved[0] == pytest.approx(0.9 * SD[0] / SD[6] * moved[6], rel=0.1)
    moments = np.linalg.eigvalsh(tensor(NOMINAL, z + moved))
    assert moments[0] + moments[1] - moments[2] >= 0.5 * LEAST_SLACK * moments[2]
