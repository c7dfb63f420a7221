"""CommonRoad's multi-body car as a twin behind the observer."""

import sys

import numpy as np
import pytest

from estimators.black_box import BlackBox
from estimators.til.law import ParameterLaw
from estimators.til.observer import Observer
from twin import INPUTS, OUTPUTS, CommonRoadTwin, Drive, TwinError
from twin.commonroad.twin import COMMONROAD_PARAMETERS, COMMONROAD_STATES

LOAD = 200.0  # [kg]


def stepped(twin, inputs):
    return np.array([twin.step(u) for u in inputs])


def inputs(seconds):
    """Throttle on and off, and steering to and fro."""
    time = np.arange(round(seconds * 1000)) * 1e-3
    u = np.zeros((time.size, len(INPUTS)))
    u[:, 0] = 0.3 * np.sin(4.0 * time)
    force = 450.0 * np.sin(3.0 * time)
    u[:, 3:5] = np.maximum(force, 0.0)[:, None]
    u[:, 5:9] = 0.5 * np.maximum(-force, 0.0)[:, None]
    return u


@pytest.fixture(scope="module")
def loaded_drive():
    """Of a car that carries a load, starting at 22 m/s."""
    twin, u = CommonRoadTwin(), inputs(1.5)
    twin.set_parameters([LOAD, 30.0, 100.0, 150.0])
    twin.reset(22.0)
    return Drive(
        time=np.arange(len(u)) * twin.dt,
        inputs=u,
        input_names=INPUTS,
        measurements=stepped(twin, u),
        output_names=OUTPUTS,
    )


def test_it_is_a_black_box_with_our_channels():
    twin = CommonRoadTwin()
    assert isinstance(twin, BlackBox)
    assert (twin.inputs, twin.outputs) == (INPUTS, OUTPUTS)
    np.testing.assert_allclose(twin.nominal, [965.7, 207.3, 1565.8, 1791.6], atol=0.1)


def test_observer_over_it_finds_the_mass_of_a_loaded_one(loaded_drive):
    law = ParameterLaw(
        parameter="mass", signal="ax", scale=1093.3, prior_sd=300.0, noise_density=1e-4
    )
    observer = Observer(CommonRoadTwin(), [law])
    observer.reset(22.0)
    estimate = observer.run(loaded_drive)
    assert estimate["mass"][-1] == pytest.approx(LOAD, abs=0.05 * LOAD)


def test_observer_over_it_corrects_the_yaw_rate(loaded_drive):
    errors = []
    for gain in (0.0, 100.0):
        observer = Observer(CommonRoadTwin(), [], {("yaw_rate", "yaw_rate"): gain})
        observer.reset(22.0)
        found = observer.run(loaded_drive)["yaw_rate"]
        errors.append(np.abs(found - loaded_drive.channel("yaw_rate")).max())
    without, with_it = errors
    assert with_it < 0.3 * without


def test_its_own_drive_leaves_nothing_to_correct(loaded_drive):
    gains = {("yaw_rate", "yaw_rate"): 5.0, ("vy", "ay"): 0.1, ("roll", "roll_rate"): 1.0}
    observer = Observer(CommonRoadTwin(), [], gains)
    observer.reset(22.0, {"mass": LOAD, "Jxx": 30.0, "Jyy": 100.0, "Jzz": 150.0})
    estimate = observer.run(loaded_drive)
    np.testing.assert_allclose(estimate.outputs, loaded_drive.measurements, atol=1e-9)


def test_imu_shows_gravity_through_roll():
    """In a steady turn the body leans outwards: to the lateral acceleration comes g sin(roll)."""
    twin = CommonRoadTwin()
    u = np.zeros(len(INPUTS))
    for hand_wheel in np.linspace(0.0, 0.5, 1500):
        u[0] = hand_wheel
        twin.step(u)
    for _ in range(3000):
        twin.step(u)
    x = dict(zip(COMMONROAD_STATES, twin.read_states(), strict=True))
    y = dict(zip(OUTPUTS, twin.step(u), strict=True))
    turning = x["vx"] * y["yaw_rate"]
    assert turning > 2.0
    assert x["roll"] > 0.03
    assert y["ay"] == pytest.approx(
        turning * np.cos(x["roll"]) + 9.81 * np.sin(x["roll"]), abs=0.02
    )


def test_reset_keeps_the_load_and_repeats_to_the_bit():
    twin, u = CommonRoadTwin(), inputs(0.2)
    twin.set_parameters([100.0, 0.0, 0.0, 0.0])
    twin.reset(22.0)
    first = stepped(twin, u)
    twin.reset(22.0)
    np.testing.assert_array_equal(stepped(twin, u), first)
    twin.set_parameters(np.zeros(4))
    twin.reset(22.0)
    assert not np.array_equal(stepped(twin, u), first)


def test_twins_do_not_share_their_load():
    heavy, light = CommonRoadTwin(), CommonRoadTwin()
    heavy.set_parameters([500.0, 0.0, 0.0, 0.0])
    u = inputs(0.1)
    np.testing.assert_array_equal(stepped(light, u), stepped(CommonRoadTwin(), u))


def test_parameters_keep_a_tenth_of_their_nominal_values():
    twin = CommonRoadTwin()
    found = twin.set_parameters(np.full(len(COMMONROAD_PARAMETERS), -1e4))
    np.testing.assert_allclose(found, -0.9 * twin.nominal)


@pytest.mark.parametrize("speed", [0.0, 1.9, 51.0, np.nan])
def test_speeds_at_which_the_model_does_not_work_are_refused(speed):
    with pytest.raises(TwinError, match=r"commonroad reset: speed is .*; allowed: 2\.0 to 50\.0"):
        CommonRoadTwin().reset(speed)


def test_a_road_that_is_not_flat_is_refused():
    u = np.zeros(len(INPUTS))
    u[10] = 0.01
    with pytest.raises(TwinError, match=r"road heights are .*; allowed: zeros"):
        CommonRoadTwin().step(u)


def test_a_locked_wheel_is_one_clear_error():
    twin, u = CommonRoadTwin(), np.zeros(len(INPUTS))
    u[5:9] = 5000.0
    with pytest.raises(TwinError, match=r"at t = 0\.\d+ s the car has come to rest, locked a whee"):
        stepped(twin, np.tile(u, (100, 1)))


@pytest.mark.parametrize(
    ("method", "values"),
    [("step", np.zeros(12)), ("correct", np.full(16, np.nan)), ("set_parameters", [np.inf] * 4)],
)
def test_bad_arrays_are_refused(method, values):
    with pytest.raises(TwinError, match=rf"commonroad {method}: .*must be \d+ finite numbers"):
        getattr(CommonRoadTwin(), method)(values)


def test_a_missing_package_is_one_clear_error(monkeypatch):
    for name in [name for name in sys.modules if name.startswith(("vehiclemodels", "twin.common"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "vehiclemodels", None)
    with pytest.raises(TwinError, match=r"pip install 'twin-in-the-loop\[commonroad\]'"):
        from twin.commonroad.model import bmw_320i  # noqa: F401
