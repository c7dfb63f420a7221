"""A black box other than `Twin` behind the same observer."""

import dataclasses

import numpy as np
import pytest

from estimators.black_box import BlackBox
from estimators.til.law import ParameterLaw
from estimators.til.observer import Observer
from scenarios import mass
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import record
from twin import Drive, TruckTwin, Twin, TwinError, Vehicle

LAW = ParameterLaw(parameter="mass", signal="ax", scale=10.0, prior_sd=10.0, noise_density=1e-3)


class Borrowed:
    """A twin seen through the boundary only, as a simulator of others would be."""

    def __init__(self, twin):
        self._twin = twin
        self.inputs, self.outputs = twin.inputs, twin.outputs
        self.states, self.parameters, self.dt = twin.states, twin.parameters, twin.dt

    def reset(self, speed=0.0):
        self._twin.reset(speed)

    def step(self, u):
        return self._twin.step(u)

    def correct(self, dx):
        self._twin.correct(dx)

    def set_parameters(self, p):
        return self._twin.set_parameters(p)

    def read_states(self):
        return self._twin.read_states()


class Cart:
    """A mass of 10 kg pushed along a line; its measurement is its acceleration."""

    inputs, outputs, states, parameters = ("force",), ("ax",), ("x", "vx"), ("mass",)
    dt = 0.01

    def __init__(self):
        self.mass = 10.0
        self.reset()

    def reset(self, speed=0.0):
        self.x = np.array([0.0, speed])

    def step(self, u):
        a = u[0] / self.mass
        self.x += self.dt * np.array([self.x[1], a])
        return np.array([a])

    def correct(self, dx):
        self.x += dx

    def set_parameters(self, p):
        self.mass = max(10.0 + p[0], 1.0)
        return np.array([self.mass - 10.0])

    def read_states(self):
        return self.x.copy()


def cart_drive(mass=14.0, **changes):
    force = 20.0 * np.sin(np.arange(500) * 0.05)
    content = {
        "time": 0.01 * np.arange(500),
        "inputs": force[:, None],
        "input_names": ("force",),
        "measurements": force[:, None] / mass,
        "output_names": ("ax",),
    }
    return Drive(**(content | changes))


@pytest.mark.parametrize("box", [Cart, TruckTwin, lambda: Twin(Vehicle.load("suv"))])
def test_simulators_of_this_project_are_black_boxes(box):
    assert isinstance(box(), BlackBox)


def test_a_twin_behind_the_python_path_gives_the_compiled_estimate_to_the_bit():
    drive = record(Vehicle.load("suv_loaded"), urban(duration=6.0))
    gains = {("vx", "ax"): 0.1, ("yaw_rate", "yaw_rate"): 5.0}
    twins = [Twin(Vehicle.load("suv")) for _ in range(2)]
    found = []
    for box in (twins[0], Borrowed(twins[1])):
        observer = Observer(box, mass.EXPERIMENT.estimators["til"].laws, gains)
        observer.reset(0.0, {"cm_x": -0.02})
        found.append(observer.run(drive))
    compiled, through_python = found
    assert np.ptp(compiled["mass"]) > 100.0
    for name in ("states", "parameters", "outputs"):
        np.testing.assert_array_equal(getattr(through_python, name), getattr(compiled, name))


def test_observer_finds_the_mass_of_a_simulator_it_has_never_seen():
    observer = Observer(Cart(), [LAW])
    estimate = observer.run(cart_drive())
    assert estimate["mass"][-1] == pytest.approx(4.0, abs=0.05)
    assert estimate["ax"].shape == estimate["vx"].shape == (500,)
    assert np.isnan(estimate.nominal).all()


def test_sample_by_sample_equals_the_whole_drive():
    drive = cart_drive()
    whole, single = (Observer(Cart(), [LAW], {("vx", "ax"): 0.5}) for _ in range(2))
    estimate = whole.run(drive)
    for k in range(len(drive)):
        p = single.update(drive.inputs[k], drive.measurements[k])
        np.testing.assert_array_equal(p, estimate.parameters[k])


def test_reset_sets_state_and_parameters():
    box = Cart()
    Observer(box, []).reset(3.0, {"mass": -4.0})
    assert (box.mass, box.x.tolist()) == (6.0, [0.0, 3.0])


def test_parameters_are_what_the_black_box_takes():
    drive = cart_drive(mass=0.1)
    assert Observer(Cart(), [LAW]).run(drive)["mass"].min() == -9.0


def test_estimate_of_another_box_names_what_it_has():
    estimate = Observer(Cart(), []).run(cart_drive())
    with pytest.raises(TwinError, match="has no 'Jzz'; has mass, x, vx, ax"):
        estimate["Jzz"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"parameter": "Jxx"}, "parameter is 'Jxx'; this black box allows: mass"),
        ({"signal": "ay"}, "signal is 'ay'; this black box allows: ax"),
        ({"signal": "heave_acceleration"}, "signal is 'heave_acceleration'"),
        ({"least_wheel_speed": 1.0}, "without wheel speeds, allows: 0"),
    ],
)
def test_law_that_needs_what_the_box_lacks_is_refused(changes, message):
    with pytest.raises(TwinError, match=message):
        Observer(Cart(), [dataclasses.replace(LAW, **changes)])


def test_gain_between_names_that_the_box_lacks_is_refused():
    with pytest.raises(TwinError, match="state 'vz' is unknown; allowed: x, vx"):
        Observer(Cart(), [], {("vz", "ax"): 1.0})


def test_drive_of_other_channels_or_values_is_refused():
    observer = Observer(Cart(), [])
    with pytest.raises(TwinError, match="the twin needs"):
        observer.run(cart_drive(output_names=("ay",)))
    bad = cart_drive().measurements.copy()
    bad[7] = np.inf
    with pytest.raises(TwinError, match="drive: ax is inf in sample 7"):
        observer.run(cart_drive(measurements=bad))
    with pytest.raises(TwinError, match="update: ax is inf"):
        observer.update([1.0], [np.inf])
