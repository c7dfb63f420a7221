import numpy as np
import pytest

from estimators.til.linear_schedule import linear_schedule, look_up
from twin import STATES, Twin, Vehicle

DT = 0.01
SPEEDS = (10.0, 20.0, 40.0)
LEVELS = (0.0, 4.0, 8.0)


@pytest.fixture(scope="module")
def twin():
    return Twin(Vehicle.load("ferrari_250lm"))


@pytest.fixture(scope="module")
def schedule(twin):
    return linear_schedule(twin, DT, SPEEDS, LEVELS)


def test_forces_act_by_mass_and_lever(schedule):
    """v_y' = F/m, r' = l F/J_zz; 982 kg, axles 1.33 m before and 1.07 m behind the CM."""
    forced = schedule.transition[1, 0, :2, 2:] / DT
    np.testing.assert_allclose(forced[0], 1.0 / 982.0, rtol=0.15)
    assert forced[1, 0] / -forced[1, 1] == pytest.approx(1.33 / 1.07, rel=0.1)
    assert 1000.0 < 1.33 / forced[1, 0] < 1600.0  # J_zz of the whole car


def test_damping_falls_with_speed_and_with_lateral_acceleration(schedule):
    damping = -np.log(np.linalg.det(schedule.transition[:, :, :2, :2])) / DT
    assert (np.diff(damping[:, 0]) < 0.0).all()
    assert (np.diff(damping[1]) < 0.0).all()
    # of a linear tyre: in proportion to 1/v; relaxation takes a little off at low speeds
    assert damping[1, 0] / damping[2, 0] == pytest.approx(2.0, rel=0.25)


def test_linear_model_foretells_the_twin(schedule, twin):
    """A push to the side at 20 m/s, straight ahead: 0.2 s of the twin against the model."""
    push = np.zeros(len(STATES))
    push[STATES.index("vy")] = 0.2
    twin.reset(20.0)
    twin.correct(push)
    for _ in range(round(0.2 / twin.dt)):
        twin.step(np.zeros(13))
    states = twin.read_states()
    model = np.linalg.matrix_power(schedule.transition[1, 0], 20) @ [0.2, 0.0, 0.0, 0.0]
    assert states[STATES.index("vy")] == pytest.approx(model[0], abs=0.03)
    assert states[STATES.index("yaw_rate")] == pytest.approx(model[1], abs=0.02)


def test_models_are_interpolated_and_held_beyond_the_grid(schedule):
    transition, outputs = np.zeros((4, 4)), np.zeros((3, 4))
    look_up(schedule, 15.0, 0.0, transition, outputs)
    np.testing.assert_allclose(transition, schedule.transition[:2, 0].mean(axis=0))
    look_up(schedule, 99.0, 99.0, transition, outputs)
    np.testing.assert_allclose(outputs, schedule.outputs[2, 2])
