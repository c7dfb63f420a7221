"""What the Twin promises in Python: snapshots, refusals, names."""

import copy
import pickle

import numpy as np
import pytest
from cars import SPIN, VX, inputs, run, suv, times

from twin import INPUTS, OUTPUTS, PARAMETERS, STATES, TYRE_OUTPUTS, Twin, TwinError, Vehicle

DELTAS = np.array(
    [
        *(300.0, -0.2, 0.03, 0.05, 50.0, 400.0, 390.0, 5.0, -20.0, 4.0),
        *(-0.1, 0.2, 0.3, 0.1, -0.2, 0.2, -0.1, 0.1),
        *(0.1, -0.05, -0.01, 0.2, -0.1, 0.3, 0.05, -0.1, 0.2),
        *(0.1, 0.03, 0.2, 0.1, 0.01, 1e-6, 0.01, -0.01, 300.0, -200.0),
    ]
)


@pytest.fixture(autouse=True)
def _log_elsewhere(tmp_path, monkeypatch):
    """MuJoCo writes MUJOCO_LOG.TXT where it stands once a simulation blows up."""
    monkeypatch.chdir(tmp_path)


def manoeuvre(seconds=0.5):
    t = times(seconds)
    u = inputs(seconds, steering=0.8 * np.sin(4.0 * t), drive=100.0)
    u[:, 9:13] = 0.01 * np.sin(np.outer(t, [7.0, 9.0, 11.0, 13.0]))
    return u


def test_names_fit_the_arrays():
    twin = suv()
    assert (twin.inputs, twin.outputs) == (INPUTS, OUTPUTS)
    assert (twin.states, twin.parameters) == (STATES, PARAMETERS)
    assert (len(INPUTS), len(OUTPUTS), len(STATES), len(PARAMETERS)) == (13, 10, 28, 37)
    assert twin.step(np.zeros(13)).shape == (10,)
    assert twin.read_states().shape == (28,)
    assert twin.tyre_forces().shape == (4, len(TYRE_OUTPUTS))


def test_python_step_is_the_compiled_one_to_the_bit():
    one, other = suv(20.0), suv(20.0)
    u = manoeuvre()
    made = run(one, u)
    seen = np.array([other.step(row) for row in u])
    np.testing.assert_array_equal(seen, made.outputs)
    np.testing.assert_array_equal(other.read_states(), one.read_states())


def test_replay_from_a_snapshot_is_bit_exact():
    twin = suv(20.0)
    twin.set_parameters(DELTAS)
    run(twin, manoeuvre())
    start = twin.snapshot()
    first = run(twin, manoeuvre())
    twin.restore(start)
    second = run(twin, manoeuvre())
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)


def test_replay_on_another_twin_of_the_same_vehicle_is_bit_exact():
    twin, other = suv(20.0), suv()
    run(twin, manoeuvre())
    other.restore(twin.snapshot())
    for one, same in zip(run(twin, manoeuvre()), run(other, manoeuvre()), strict=True):
        np.testing.assert_array_equal(one, same)


def test_restore_puts_the_parameters_back():
    twin = suv(20.0)
    twin.set_parameters(DELTAS)
    start = twin.snapshot()
    mass, place = twin.model.body_mass[1], twin.model.body_ipos[1].copy()
    twin.set_parameters(np.zeros(len(PARAMETERS)))
    assert twin.model.body_mass[1] == mass - 300.0
    twin.restore(start)
    assert twin.model.body_mass[1] == pytest.approx(mass, rel=1e-15)
    np.testing.assert_array_equal(twin.model.body_ipos[1], place)
    np.testing.assert_array_equal(twin.snapshot().parameters, DELTAS)


def test_replay_is_bit_exact_after_the_parameters_wandered():
    twin = suv(20.0)
    for mass in np.linspace(-399.7, 803.3, 20):
        twin.set_parameters([mass, *[0.0] * (len(PARAMETERS) - 1)])
        start = twin.snapshot()
        first = run(twin, manoeuvre(0.02)).states
        twin.set_parameters([0.3 * mass + 1.0, *[0.0] * (len(PARAMETERS) - 1)])
        twin.restore(start)
        np.testing.assert_array_equal(run(twin, manoeuvre(0.02)).states, first)


def test_snapshot_does_not_change_with_the_twin():
    twin = suv(20.0)
    start = twin.snapshot()
    kept = copy.deepcopy(start)
    run(twin, manoeuvre())
    twin.set_parameters(DELTAS)
    for one, other in zip(start, kept, strict=True):
        np.testing.assert_array_equal(one, other)


def test_reset_keeps_the_parameters_and_forgets_the_drive():
    twin, fresh = suv(20.0), suv()
    for one in (twin, fresh):
        one.set_parameters(DELTAS)
    run(twin, manoeuvre())
    twin.reset(15.0)
    fresh.reset(15.0)
    np.testing.assert_allclose(twin.read_states(), fresh.read_states(), rtol=1e-9, atol=1e-9)
    assert twin.data.time == 0.0


@pytest.mark.parametrize("send", [pickle.dumps, copy.copy, copy.deepcopy])
def test_twin_is_not_pickled_nor_copied(send):
    with pytest.raises(TwinError, match="cannot be pickled; send its Vehicle"):
        send(suv())


def test_vehicle_is_pickled_instead():
    vehicle = pickle.loads(pickle.dumps(Vehicle.load("suv")))
    assert Twin(vehicle).dt == 0.001


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("steering_wheel_angle", np.nan, "steering_wheel_angle is nan in sample 0; allowed: -"),
        ("drive_torque_rl", np.inf, "drive_torque_rl is inf"),
        ("drive_torque_fl", 1e9, "drive_torque_fl is 1000000000.0 .*allowed: -100000 to 100000"),
        ("brake_torque_fr", 1e9, "brake_torque_fr is 1000000000.0"),
        ("brake_torque_fr", -1.0, "brake_torque_fr is -1.0 .*allowed: 0 to 100000"),
        ("road_height_rr", -np.inf, "road_height_rr is -inf"),
        ("road_height_rr", 1e5, "road_height_rr is 100000.0"),
    ],
)
def test_impossible_input_is_refused_before_the_step(name, value, message):
    twin, u = suv(20.0), np.zeros(13)
    u[INPUTS.index(name)] = value
    before = twin.snapshot()
    with pytest.raises(TwinError, match=message) as caught:
        twin.step(u)
    assert "\n" not in str(caught.value)
    np.testing.assert_array_equal(twin.snapshot().state, before.state)


def test_hand_wheel_beyond_what_turns_the_road_wheels_is_refused():
    u = np.zeros(13)
    u[0] = 26.0
    with pytest.raises(TwinError, match="steering_wheel_angle"):
        suv().step(u)


@pytest.mark.parametrize("shape", [(12,), (14,), (1, 13), ()])
def test_input_of_another_shape_is_refused(shape):
    with pytest.raises(TwinError, match="inputs have shape"):
        suv().step(np.zeros(shape))


@pytest.mark.parametrize(
    ("method", "size"),
    [
        ("correct", 28),
        ("set_parameters", 37),
    ],
)
def test_corrections_and_parameters_are_finite_numbers_of_the_right_shape(method, size):
    twin = suv()
    for bad in (np.zeros(size - 1), np.full(size, np.nan), np.r_[np.inf, np.zeros(size - 1)]):
        with pytest.raises(TwinError, match=f"{method}: needs {size} finite numbers") as caught:
            getattr(twin, method)(bad)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("speed", [-1.0, 151.0, np.nan])
def test_reset_to_an_impossible_speed_is_refused(speed):
    with pytest.raises(TwinError, match=r"reset: speed is .* m/s; allowed: 0 to 150"):
        suv().reset(speed)


@pytest.mark.parametrize(("state", "size"), [(SPIN, 1e12), (VX, 1e8), (20, 1e9)])
def test_correction_that_blows_the_car_up_names_the_time(state, size):
    twin = suv(20.0)
    run(twin, manoeuvre())
    dx = np.zeros(28)
    dx[state] = size
    twin.correct(dx)
    with pytest.raises(TwinError, match=r"blew up at t = 0\.50\d s; look for inputs") as caught:
        run_python(twin)
    assert "\n" not in str(caught.value)


def run_python(twin):
    for _ in range(5):
        twin.step(np.zeros(13))


def test_car_too_heavy_for_its_springs_does_not_settle():
    twin = suv()
    twin.set_parameters([1e6, *[0.0] * (len(PARAMETERS) - 1)])
    with pytest.raises(TwinError, match=r"does not settle on its wheels at 0\.0 m/s"):
        twin.reset()
