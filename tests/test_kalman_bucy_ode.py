from dataclasses import replace

import numpy as np
import pytest

from estimators.benchmarks.kalman_bucy import KalmanBucy, KalmanBucySettings, matched
from estimators.benchmarks.kalman_bucy_ode import KalmanBucyOde
from scenarios.experiment.truck import truck_case
from scenarios.experiment.truck_plant import NOISE
from twin import TruckParameters, TwinError
from twin.truck.model import RATES
from twin.truck.twin import TRUCK_PARAMETERS

TRUCK, DT = TruckParameters(), 1e-3


@pytest.fixture(scope="module")
def drive():
    return truck_case("a truck").noisy_drive(0, 10.0)


LITERAL = KalmanBucySettings(parametrisation="p")


def truth(drive, names):
    return np.column_stack([drive.truth[name] for name in names])


def mape(drive, found):
    ratio = (found.nominal + found.parameters) / truth(drive, TRUCK_PARAMETERS)
    return 100 * np.abs(ratio - 1).mean(axis=0)


def test_filter_as_printed_never_moves_its_parameters(drive):
    found = KalmanBucyOde(TRUCK, DT, LITERAL, literal=True).run(drive)
    np.testing.assert_array_equal(
        found.parameters, np.tile(TRUCK.nominal.parameters, (len(drive.time), 1))
    )


def test_filter_as_printed_still_tracks_the_velocities(drive):
    found = KalmanBucyOde(TRUCK, DT, LITERAL, literal=True).run(drive)
    rates = truth(drive, RATES)
    error = np.sqrt(((found.states - rates) ** 2).mean(axis=0))
    assert (error < 0.25 * rates.std(axis=0)).all()


@pytest.mark.parametrize("parametrisation", ["p", "1/p", "log p"])
def test_riccati_equation_agrees_with_the_kalman_step(drive, parametrisation):
    settings = KalmanBucySettings(parametrisation=parametrisation)
    ode = KalmanBucyOde(TRUCK, DT, settings).run(drive)
    steps = KalmanBucy(TRUCK, DT, settings).run(drive)
    np.testing.assert_allclose(mape(drive, ode), mape(drive, steps), atol=0.05)
    np.testing.assert_allclose(ode.sd[1000:], steps.sd[1000:], rtol=0.1)


def test_an_unstable_step_size_is_refused(drive):
    seen = drive.replace(
        time=drive.time[::20],
        inputs=drive.inputs[::20],
        measurements=drive.measurements[::20],
        truth={},
    )
    settings = matched(NOISE["std noise"].sensors, DT)
    sharp = replace(settings, velocity_density=1.0)
    with pytest.raises(TwinError, match="unstable"):
        KalmanBucyOde(TRUCK, 0.02, sharp).run(seen)


def test_literal_filter_knows_no_other_state_than_p():
    with pytest.raises(TwinError, match="must be 'p'"):
        KalmanBucyOde(TRUCK, DT, KalmanBucySettings(), literal=True)
