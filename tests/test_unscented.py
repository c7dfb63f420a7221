import numpy as np
import pytest
from cars import drive_of_other_car

from estimators.ensemble.unscented import UnscentedObserver
from estimators.joint.observer import JointObserver, JointSettings
from twin import TwinError, Vehicle

LOAD = {"mass": 200.0, "cm_x": -0.05, "Jzz": 300.0}


def observe(observer, drive, speed):
    observer.reset(speed, road=drive.inputs[0, 9:13])
    return observer.run(drive)


@pytest.fixture(scope="module")
def rich():
    return drive_of_other_car(LOAD, seconds=6.0, snr=10.0)


@pytest.fixture(scope="module")
def found(rich):
    drive, sd, speed = rich
    return observe(UnscentedObserver(Vehicle.load("suv"), sd, tuple(LOAD)), drive, speed)


def errors(estimate):
    return np.array([estimate[name][-1] - value for name, value in LOAD.items()])


def test_unscented_filter_finds_the_load_within_what_it_claims(found):
    assert (np.abs(errors(found)) < 4.0 * found.sd[-1]).all()
    assert (np.abs(errors(found)) < [2.0, 0.002, 60.0]).all()


def test_unscented_filter_becomes_more_certain(found):
    assert found.estimated == tuple(LOAD)
    assert (found.sd[-1] < 0.2 * found.sd[0]).all()


def test_unscented_filter_agrees_with_the_joint_observer(rich, found):
    drive, sd, speed = rich
    joint = JointObserver(Vehicle.load("suv"), sd, JointSettings(parameters=tuple(LOAD)))
    joint.reset(speed)
    other = joint.run(drive)
    difference = [found[name][-1] - other[name][-1] for name in LOAD]
    assert (np.abs(difference) < found.sd[-1] + other.sd[-1][: len(LOAD)]).all()


def test_car_at_rest_teaches_nothing():
    drive, sd, _ = drive_of_other_car({}, seconds=2.0, snr=10.0)
    still = drive.inputs * 0.0
    still[:, 5:9] = 500.0
    observer = UnscentedObserver(Vehicle.load("suv"), sd, ("mass",))
    estimate = observe(observer, drive.replace(inputs=still), 0.0)
    assert (estimate["mass"] == 0.0).all()


def test_unknown_parameter_is_refused(rich):
    _, sd, _ = rich
    with pytest.raises(TwinError, match="unscented: parameters are weight; allowed: each at most"):
        UnscentedObserver(Vehicle.load("suv"), sd, ("weight",))
