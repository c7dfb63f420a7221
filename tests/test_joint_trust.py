"""The joint observer trusts its sensitivities nearby only; its twins follow smoothly."""

import numpy as np
import pytest

from estimators.joint.linearisation_error import doubt_linearity, wait_after_impact
from estimators.joint.observer import JointObserver, JointSettings
from estimators.joint.parameter_tracking import follow
from estimators.joint.state import ABSENT, WAIT
from scenarios.experiment.joint import clean_drive
from scenarios.experiment.study import variation
from twin import OUTPUTS, PARAMETERS, Vehicle

SD = np.array([0.5] * 3 + [0.02] * 3 + [0.05] * 4)
MASS, WHEEL = PARAMETERS.index("mass"), OUTPUTS.index("wheel_speed_fl")


@pytest.fixture
def observer():
    made = JointObserver(Vehicle.load("suv"), SD, JointSettings(parameters=("mass", "Jzz")))
    made.reset(15.0)
    return made


def doubted(observer, h, before=1.0):
    """The noise (ny,) after the doubt, of sensitivities (ny, q) that have long been these."""
    memory, variance = observer._memory, np.full(len(OUTPUTS), before)
    memory.usual[:] = h[:, : memory.usual.shape[1]] ** 2
    memory.total[:] = 10.0 * 40.0  # rad/s, of a block
    doubt_linearity(observer._setup, memory, h, variance)
    return variance


def test_certain_estimates_where_the_twins_stand_raise_no_doubt(observer):
    observer._memory.covariance[:] = 0.0
    h = np.ones((len(OUTPUTS), observer._memory.z.size))
    np.testing.assert_array_equal(doubted(observer, h), 1.0)


def test_doubt_is_of_second_order(observer):
    """Twice as uncertain, sixteen times the variance."""
    memory = observer._memory
    h = np.zeros((len(OUTPUTS), memory.z.size))
    h[:WHEEL, 0] = 1e-3
    first = doubted(observer, h)[:WHEEL] - 1.0
    memory.covariance[:] *= 4.0
    np.testing.assert_allclose(doubted(observer, h)[:WHEEL] - 1.0, 16.0 * first)


def test_estimates_ahead_of_their_twins_are_doubted_like_uncertain_ones(observer):
    memory = observer._memory
    h = np.zeros((len(OUTPUTS), memory.z.size))
    h[0, 0] = 1e-3
    variance = memory.covariance[0, 0]
    memory.covariance[:] = 0.0
    memory.covariance[0, 0] = variance
    uncertain = doubted(observer, h)[0]
    memory.covariance[:] = 0.0
    memory.z[0] = np.sqrt(variance)
    assert doubted(observer, h)[0] == pytest.approx(uncertain)


def test_wheel_whose_slip_may_be_anything_is_not_trusted_but_the_others_are(observer):
    memory = observer._memory
    h = np.zeros((len(OUTPUTS), memory.z.size))
    h[WHEEL:, 0] = 1e-4
    calm = doubted(observer, h)
    h[WHEEL, 0] = 0.02  # 6 rad/s for the prior of the mass
    locking = doubted(observer, h)
    assert locking[WHEEL] > 1e6 * calm[WHEEL]
    np.testing.assert_array_equal(locking[:WHEEL], calm[:WHEEL])


def test_missing_channel_stays_missing(observer):
    h = np.ones((len(OUTPUTS), observer._memory.z.size))
    np.testing.assert_array_equal(doubted(observer, h, before=ABSENT), ABSENT)


def test_jump_of_the_sensitivities_makes_the_observer_wait(observer):
    setup, memory = observer._setup, observer._memory
    variance = np.ones(len(OUTPUTS))
    memory.blocks[:] = 0
    memory.blocks[1] = 100  # of driving
    h = np.zeros((len(OUTPUTS), memory.z.size))
    h[2, 0] = 0.01  # 3 noises for the prior
    memory.before[:] = h
    memory.usual[:] = h[:, :2] ** 2
    wait_after_impact(setup, memory, 1.5 * h, variance)
    assert memory.blocks[WAIT] == 0
    wait_after_impact(setup, memory, 4.0 * h, variance)
    assert memory.blocks[WAIT] == 20  # 0.2 s


def test_twins_follow_like_a_critically_damped_oscillator(observer):
    setup, memory = observer._setup, observer._memory
    memory.z[0] = 100.0
    masses = []
    for _ in range(400):
        follow(observer.fleet.cars, setup, memory)
        masses.append(memory.theta[MASS])
    time = 0.01 * np.arange(1, 401) / setup.follow_time
    expected = 100.0 * (1.0 - (1.0 + time) * np.exp(-time))
    np.testing.assert_allclose(masses, expected, atol=1.5)
    assert max(masses) <= 100.0
    twins = [twin.car.parameters[MASS] for twin in observer.fleet.twins]
    assert twins == pytest.approx([masses[-1], masses[-1] + 10.0, masses[-1]])


def test_speed_of_the_twins_that_is_off_is_not_taken_for_mass():
    drive = clean_drive("mixed", "same", 8.0)
    errors = {}
    for name, faults in (("with", ("speed",)), ("without", ())):
        settings = JointSettings(parameters=("mass",), faults=faults, hold_off=0.1)
        made = JointObserver(Vehicle.load("suv"), SD, settings)
        made.reset(float(drive.truth["vx"][0]) + 0.15, variation(), road=drive.inputs[0, 9:13])
        run = made.run(drive)
        errors[name] = np.abs(run["mass"][:3000] - variation()["mass"]).max()
    assert errors["with"] < 0.3 * errors["without"]
