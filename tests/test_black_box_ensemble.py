"""Estimators of several twins, or of several runs of one, over black boxes that are no `Twin`."""

import numpy as np
import pytest
import test_commonroad_twin
import test_fmu_twin

from estimators.ensemble.twins import Twins
from estimators.entry import Given
from estimators.joint.observer import JointObserver, JointSettings
from estimators.registry import make
from estimators.til.law import ParameterLaw
from scenarios.experiment.laws import ALL_LAWS
from twin import OUTPUTS, CommonRoadTwin, Drive, FmuTwin, TwinError

fmu = test_fmu_twin.fmu
Cart = test_fmu_twin.Cart
NAMES = ("joint", "staged", "unscented", "least-squares")
PARAMETERS = ("mass", "Jzz")
LOAD = {"mass": 200.0, "Jzz": 150.0}
SD = dict.fromkeys(OUTPUTS, 0.02)


def settings(name, **changes):
    """Those of the joint observer, for drives of seconds; others have their own."""
    return (
        JointSettings(segment=0.2, hold_off=0.3, settle=100.0, **changes)
        if name == "joint"
        else None
    )


@pytest.fixture(scope="module")
def loaded_commonroad():
    """Two seconds of a car that carries a load, starting at 22 m/s."""
    twin, u = CommonRoadTwin(), test_commonroad_twin.inputs(2.0)
    twin.set_parameters([LOAD["mass"], 0.0, 0.0, LOAD["Jzz"]])
    twin.reset(22.0)
    clean = test_commonroad_twin.stepped(twin, u)
    noise = 0.02 * np.random.default_rng(1).standard_normal(clean.shape)
    return Drive(
        time=np.arange(len(u)) * twin.dt, inputs=u, input_names=twin.inputs,
        measurements=clean + noise, output_names=OUTPUTS,
    )  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_estimator_runs_on_commonroads_car(name, loaded_commonroad):
    given = Given(
        black_box=CommonRoadTwin, noise_sd=SD, parameters=PARAMETERS, laws=ALL_LAWS,
        settings=settings(name, parameters=PARAMETERS),
    )  # fmt: skip
    estimator = make(name, given)
    estimator.reset(22.0)
    found = estimator.run(loaded_commonroad)
    assert found.parameter_names == ("mass", "Jxx", "Jyy", "Jzz")
    assert found.extended_names == ()
    assert set(found.state_names) == set(CommonRoadTwin.states)
    assert found.absolute("mass")[0] == pytest.approx(965.7 + found["mass"][0], abs=0.1)
    assert found.sd is not None
    assert np.isfinite(found.states).all()
    assert found["mass"][-1] == pytest.approx(LOAD["mass"], abs=100.0)
    assert np.isfinite(found.sideslip).all()


def pushed(mass):
    """A cart of that mass and its noisy log: 20 s of pushing it to and fro."""
    box = Cart()
    box.set_parameters([mass - 10.0])
    box.reset(5.0)
    time = 0.01 * np.arange(2000)
    force = 20.0 + 60.0 * np.sin(3.0 * time)[:, None]
    y = np.array([box.step(u) for u in force])
    y[:, 0] += 0.02 * np.random.default_rng(2).standard_normal(len(y))
    return Drive(
        time=time, inputs=force, input_names=box.inputs, measurements=y, output_names=box.outputs
    )


@pytest.mark.parametrize("name", NAMES)
def test_estimator_runs_on_an_fmu_and_finds_its_mass(name, fmu):
    law = ParameterLaw(parameter="mass", signal="ax", scale=10.0, prior_sd=3.0, noise_density=1e-3)
    given = Given(
        black_box=lambda: FmuTwin(fmu, test_fmu_twin.NAMES),
        noise_sd={"ax": 0.02},
        prior_sd={"mass": 3.0},
        laws=[law],
        parameters=("mass",),
        settings=settings(name, parameters=("mass",), speed_gain=0.0),
    )
    estimator = make(name, given)
    estimator.reset(5.0)
    found = estimator.run(pushed(12.0))
    assert found.parameter_names == ("mass",)
    assert found.nominal.tolist() == [10.0]
    assert found.output_names == (("ax", "vx") if name == "least-squares" else ("ax",))
    assert found["mass"][-1] == pytest.approx(2.0, abs=0.3)
    assert 0.0 < found.sd_of("mass")[-1] < 3.0


class Failing(Cart):
    """A cart that breaks after a second."""

    steps = 0

    def step(self, u):
        self.steps += 1
        if self.steps > 100:
            raise self.error("cart: an axle is broken")
        return super().step(u)


@pytest.mark.parametrize("error", [TwinError, ZeroDivisionError])
def test_error_of_a_black_box_ends_the_run_as_itself(error, monkeypatch):
    monkeypatch.setattr(Failing, "error", error, raising=False)
    noise = np.where(np.isin(OUTPUTS, "ax"), 0.02, np.nan)
    observer = JointObserver(Failing, noise, JointSettings(parameters=("mass",)))
    observer.reset(5.0)
    with pytest.raises(error, match="an axle is broken"):
        observer.run(pushed(12.0))


def test_parameters_and_drives_that_do_not_fit_are_refused():
    with pytest.raises(
        TwinError, match="joint: parameters are Jxx; allowed: each at most once of mass"
    ):
        JointObserver(Cart, np.ones(len(OUTPUTS)), JointSettings(parameters=("Jxx",)))
    twins = Twins(Cart, 2)
    drive = pushed(12.0)
    with pytest.raises(TwinError, match="has inputs push; allowed: those of the twin, force"):
        twins.given_by(drive.replace(input_names=("push",)))
    with pytest.raises(TwinError, match=r"has samples every 0\.02 s, the twin steps 0\.01 s"):
        twins.given_by(drive.replace(time=2.0 * drive.time))
    with pytest.raises(TwinError, match="snapshot: this black box has none"):
        twins.snapshot()
