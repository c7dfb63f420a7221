from dataclasses import replace

import numpy as np
import pytest

from estimators.benchmarks.kalman_bucy import KalmanBucy, KalmanBucySettings, matched
from estimators.benchmarks.kalman_bucy_ode import run_literal, run_riccati
from scenarios.papers.truck_drive import NOISE, TruckCase, make_drive
from scenarios.papers.truck_estimators import channels
from twin import TruckParameters, TwinError
from twin.truck.model import DEFLECTIONS, RATES
from twin.truck.twin import TRUCK_PARAMETERS

TRUCK, DT = TruckParameters(), 1e-3


@pytest.fixture(scope="module")
def drive():
    return make_drive(TruckCase(duration=10.0), 0)


def signals(drive):
    return drive.time, channels(drive, DEFLECTIONS), channels(drive, RATES)


def truth(drive, names):
    return np.column_stack([drive.truth[name] for name in names])


def mape(drive, found):
    return 100 * np.abs(found.parameters / truth(drive, TRUCK_PARAMETERS) - 1).mean(axis=0)


def test_filter_as_printed_never_moves_its_parameters(drive):
    found = run_literal(TRUCK, DT, KalmanBucySettings(parametrisation="p"), *signals(drive))
    np.testing.assert_array_equal(
        found.parameters, np.tile(2 * TRUCK.nominal.parameters, (len(drive.time), 1))
    )


def test_filter_as_printed_still_tracks_the_velocities(drive):
    found = run_literal(TRUCK, DT, KalmanBucySettings(parametrisation="p"), *signals(drive))
    rates = truth(drive, RATES)
    error = np.sqrt(((found.velocity - rates) ** 2).mean(axis=0))
    assert (error < 0.25 * rates.std(axis=0)).all()


@pytest.mark.parametrize("parametrisation", ["p", "1/p", "log p"])
def test_riccati_equation_agrees_with_the_kalman_step(drive, parametrisation):
    settings = KalmanBucySettings(parametrisation=parametrisation)
    ode = run_riccati(TRUCK, DT, settings, *signals(drive))
    steps = KalmanBucy(TRUCK, DT, settings).run(*signals(drive))
    np.testing.assert_allclose(mape(drive, ode), mape(drive, steps), atol=0.05)
    np.testing.assert_allclose(ode.parameters_sd[1000:], steps.parameters_sd[1000:], rtol=0.1)


def test_an_unstable_step_size_is_refused(drive):
    every = slice(None, None, 20)
    settings = matched(NOISE["std noise"].sensors, DT)
    sharp = replace(settings, velocity_density=1.0)
    with pytest.raises(TwinError, match="unstable"):
        run_riccati(TRUCK, 0.02, sharp, *(signal[every] for signal in signals(drive)))


def test_literal_filter_knows_no_other_state_than_p(drive):
    with pytest.raises(TwinError, match="must be 'p'"):
        run_literal(TRUCK, DT, KalmanBucySettings(), *signals(drive))
