import numpy as np
import pytest

from twin import TruckParameters, TruckTwin, TwinError
from twin.road import iso8608_road
from twin.truck.model import LoadStage, Truck
from twin.truck.parameters import SprungMass

NOMINAL = SprungMass().parameters


def heights(samples=600):
    road = iso8608_road(np.random.default_rng(3), length=100.0)
    return road.wheel_heights(15e-3 * np.arange(samples), TruckParameters().wheelbase)


def outputs(twin, road):
    return np.array([twin.step(u) for u in road])


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_twin_repeats_the_truck_through_a_load_step_to_the_bit(gravity):
    road = heights()
    stage = LoadStage(0.3, SprungMass().scaled(1.5))
    truth = Truck(gravity=gravity).record(road, [stage])
    twin = TruckTwin(gravity=gravity)
    before = outputs(twin, road[:300])
    twin.set_parameters(0.5 * NOMINAL)
    after = outputs(twin, road[300:])
    np.testing.assert_array_equal(np.vstack([before, after]), truth.rates)


def test_states_are_those_that_the_truck_records():
    road = heights(50)
    truth = Truck().record(road)
    twin = TruckTwin()
    for k, u in enumerate(road):
        states = np.concatenate([truth.positions[k], truth.velocities[k]])
        np.testing.assert_array_equal(twin.read_states(), states)
        twin.step(u)


def test_correction_adds_to_the_states():
    twin = TruckTwin()
    change = np.arange(1.0, 15.0)
    twin.correct(change)
    twin.correct(change)
    np.testing.assert_array_equal(twin.read_states(), 2.0 * change)
    assert twin.outputs == twin.states[7:10] == ("vz", "roll_rate", "pitch_rate")


def test_reset_is_at_rest_and_keeps_the_load():
    road = heights(100)
    twin = TruckTwin()
    twin.set_parameters(0.5 * NOMINAL)
    first = outputs(twin, road)
    twin.reset()
    assert not twin.read_states().any()
    np.testing.assert_array_equal(outputs(twin, road), first)


def test_twins_do_not_share_their_load():
    heavy, light = TruckTwin(), TruckTwin()
    heavy.set_parameters(NOMINAL)
    road = heights(100)
    np.testing.assert_array_equal(outputs(light, road), outputs(TruckTwin(), road))
    assert not np.array_equal(outputs(heavy, road), outputs(TruckTwin(), road))


def test_parameters_stay_those_of_a_rigid_body():
    twin = TruckTwin()
    asked = np.array([100.0, -200.0, 300.0])
    np.testing.assert_array_equal(twin.set_parameters(asked), asked)
    np.testing.assert_allclose(twin.set_parameters(-2.0 * NOMINAL), -0.9 * NOMINAL)
    for deltas in ([0.0, 2e4, -1e4], [0.0, -4e3, 2e4], [0.0, 0.0, 0.0]):
        twin.set_parameters(deltas)
        x, y, z = twin._model.body_inertia[twin._chassis]
        assert abs(x - y) < z < x + y


@pytest.mark.parametrize(
    ("method", "values"),
    [
        ("step", [0.0, 0.0, 0.0]),
        ("step", [0.0, 0.0, np.nan, 0.0]),
        ("correct", np.zeros(28)),
        ("set_parameters", [np.inf, 0.0, 0.0]),
    ],
)
def test_bad_arrays_are_refused(method, values):
    with pytest.raises(TwinError, match=rf"truck {method}: .*must be \d+ finite numbers"):
        getattr(TruckTwin(), method)(values)


@pytest.mark.parametrize("speed", [2e6, 1e9])
def test_a_simulation_that_blows_up_is_one_clear_error(speed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log
    twin = TruckTwin()
    twin.correct(np.r_[np.zeros(7), np.full(7, speed)])
    with pytest.raises(TwinError, match=r"blew up at t = 0\.001 s"):
        twin.step(np.zeros(4))
