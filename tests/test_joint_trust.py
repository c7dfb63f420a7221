"""The joint observer accounts for its linearisation error; its twins follow smoothly."""

import numpy as np
import pytest

from estimators.joint.linearisation_error import add_linearisation_error, wait_after_impact
from estimators.joint.observer import JointObserver, JointSettings
from estimators.joint.parameter_tracking import track_parameters
from estimators.joint.state import ABSENT, WAIT
from scenarios import mixed
from twin import OUTPUTS, PARAMETERS, Vehicle

SD = np.array([0.5] * 3 + [0.02] * 3 + [0.05] * 4)
MASS, WHEEL = PARAMETERS.index("mass"), OUTPUTS.index("wheel_speed_fl")


@pytest.fixture
def observer():
    made = JointObserver(Vehicle.load("suv"), SD, JointSettings(parameters=("mass", "Jzz")))
    made.reset(15.0)
    return made


def inflated(observer, h, before=1.0):
    """The noise (ny,) with the linearisation error of sensitivities (ny, q), long the same."""
    state, variance = observer._state, np.full(len(OUTPUTS), before)
    state.usual[:] = h[:, : state.usual.shape[1]] ** 2
    state.total[:] = 10.0 * 40.0  # rad/s, of a block
    add_linearisation_error(observer._config, state, h, variance)
    return variance


def test_certain_estimates_where_the_twins_stand_have_no_linearisation_error(observer):
    observer._state.covariance[:] = 0.0
    h = np.ones((len(OUTPUTS), observer._state.z.size))
    np.testing.assert_array_equal(inflated(observer, h), 1.0)


def test_linearisation_error_is_of_second_order(observer):
    """Twice as uncertain, sixteen times the variance."""
    state = observer._state
    h = np.zeros((len(OUTPUTS), state.z.size))
    h[:WHEEL, 0] = 1e-3
    first = inflated(observer, h)[:WHEEL] - 1.0
    state.covariance[:] *= 4.0
    np.testing.assert_allclose(inflated(observer, h)[:WHEEL] - 1.0, 16.0 * first)


def test_estimates_ahead_of_their_twins_have_the_linearisation_error_of_uncertain_ones(observer):
    state = observer._state
    h = np.zeros((len(OUTPUTS), state.z.size))
    h[0, 0] = 1e-3
    variance = state.covariance[0, 0]
    state.covariance[:] = 0.0
    state.covariance[0, 0] = variance
    uncertain = inflated(observer, h)[0]
    state.covariance[:] = 0.0
    state.z[0] = np.sqrt(variance)
    assert inflated(observer, h)[0] == pytest.approx(uncertain)


def test_wheel_whose_slip_may_be_anything_is_not_trusted_but_the_others_are(observer):
    state = observer._state
    h = np.zeros((len(OUTPUTS), state.z.size))
    h[WHEEL:, 0] = 1e-4
    calm = inflated(observer, h)
    h[WHEEL, 0] = 0.02  # 6 rad/s for the prior of the mass
    locking = inflated(observer, h)
    assert locking[WHEEL] > 1e6 * calm[WHEEL]
    np.testing.assert_array_equal(locking[:WHEEL], calm[:WHEEL])


def test_missing_channel_stays_missing(observer):
    h = np.ones((len(OUTPUTS), observer._state.z.size))
    np.testing.assert_array_equal(inflated(observer, h, before=ABSENT), ABSENT)


def test_jump_of_the_sensitivities_makes_the_observer_wait(observer):
    config, state = observer._config, observer._state
    variance = np.ones(len(OUTPUTS))
    state.blocks[:] = 0
    state.blocks[1] = 100  # of driving
    h = np.zeros((len(OUTPUTS), state.z.size))
    h[2, 0] = 0.01  # 3 noises for the prior
    state.last_h[:] = h
    state.usual[:] = h[:, :2] ** 2
    wait_after_impact(config, state, 1.5 * h, variance)
    assert state.blocks[WAIT] == 0
    wait_after_impact(config, state, 4.0 * h, variance)
    assert state.blocks[WAIT] == 20  # 0.2 s


def test_twins_follow_like_a_critically_damped_oscillator(observer):
    config, state = observer._config, observer._state
    state.z[0] = 100.0
    masses = []
    for _ in range(400):
        track_parameters(observer.ensemble.cars, config, state)
        masses.append(state.theta[MASS])
    time = 0.01 * np.arange(1, 401) / config.tracking_time
    expected = 100.0 * (1.0 - (1.0 + time) * np.exp(-time))
    np.testing.assert_allclose(masses, expected, atol=1.5)
    assert max(masses) <= 100.0
    twins = [twin.car.parameters[MASS] for twin in observer.ensemble.twins]
    assert twins == pytest.approx([masses[-1], masses[-1] + 10.0, masses[-1]])


def test_speed_of_the_twins_that_is_off_is_not_taken_for_mass():
    case = mixed.EXPERIMENT.cases[0]
    drive, load = case.plant.clean(8.0), case.load()
    errors = {}
    for name, errors_of in (("with", ("speed",)), ("without", ())):
        settings = JointSettings(parameters=("mass",), sensor_errors=errors_of, hold_off=0.1)
        made = JointObserver(Vehicle.load("suv"), SD, settings)
        made.reset(
            float(drive.truth["vx"][0]) + 0.15,
            mixed.EXPERIMENT.cases[0].load(),
            road=drive.inputs[0, 9:13],
        )
        run = made.run(drive)
        errors[name] = np.abs(run["mass"][:3000] - load["mass"]).max()
    assert errors["with"] < 0.3 * errors["without"]
