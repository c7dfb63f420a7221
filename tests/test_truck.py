import linear_truck
import mujoco
import numpy as np
import pytest

import models
from twin.errors import TwinError
from twin.road import iso8608_road
from twin.truck.model import DEFLECTIONS, RATES, LoadStage, Truck
from twin.truck.parameters import SprungMass, TruckParameters

PAPER_ORDER = [0, 1, 2, 3, 5, 4, 6]  # MuJoCo's joints as (Z, roll, pitch, Z_u f r, roll_u f r)


def class_c(seconds=8.0, seed=0, truck=None):
    distance = 15.0 * np.arange(round(seconds * 1000)) * 1e-3
    wheelbase = (truck or TruckParameters()).wheelbase
    return iso8608_road(np.random.default_rng(seed), length=200).wheel_heights(distance, wheelbase)


def states(record):
    return np.hstack([record.positions[:, PAPER_ORDER], record.velocities[:, PAPER_ORDER]])


def relative_rms(heights, parameters=None):
    parameters = parameters or TruckParameters()
    linear = linear_truck.simulate(linear_truck.state_space(parameters), heights, 1e-3)
    error = states(Truck(parameters).record(heights)) - linear
    return np.sqrt((error**2).mean(0) / (linear**2).mean(0))[[0, 1, 2, 7, 8, 9]]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_mujoco_agrees_with_the_linear_model_on_a_class_c_road(seed):
    assert relative_rms(class_c(seed=seed)).max() < 5e-4


def test_difference_to_the_linear_model_grows_as_the_square_of_the_amplitude():
    heights = class_c()
    growth = relative_rms(2 * heights)[[1, 2, 4, 5]] / relative_rms(heights)[[1, 2, 4, 5]]
    np.testing.assert_allclose(growth, 4, rtol=0.1)


def test_other_parameters_than_the_papers_reach_every_part_of_the_model():
    other = TruckParameters(
        nominal=SprungMass(mass=7000, roll_inertia=6000, pitch_inertia=25000),
        axle_mass=(300, 500),
        axle_roll_inertia=(220, 260),
        spring_stiffness=(150e3, 220e3),
        damping=(9000, 8000),
        tyre_stiffness=(600e3, 800e3),
        axle_distance=(2.0, 2.2),
        half_track=(0.9, 0.8),
    )
    assert relative_rms(class_c(4, truck=other), other).max() < 5e-4


def test_the_file_holds_the_papers_parameters():
    model = mujoco.MjModel.from_xml_path(str(models.path("truck")))
    mine = Truck().model
    for name in (
        "body_mass",
        "body_inertia",
        "tendon_stiffness",
        "tendon_damping",
        "wrap_prm",
        "tendon_lengthspring",
        "actuator_gainprm",
        "actuator_biasprm",
        "dof_M0",
    ):
        np.testing.assert_allclose(
            getattr(model, name), getattr(mine, name), rtol=1e-12, err_msg=name
        )


def test_model_runs_rk4_at_one_millisecond_without_contacts():
    model = Truck().model
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    assert model.opt.timestep == 1e-3
    assert not model.geom_contype.any()
    assert [model.sensor(i).name for i in range(model.nsensor)] == [*RATES, *DEFLECTIONS]


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_nominal_load_rests_at_zero_with_and_without_gravity(gravity):
    record = Truck(gravity=gravity).record(np.zeros((2000, 4)))
    assert np.abs(record.positions).max() < 1e-12


def test_gravity_changes_no_motion_about_the_rest():
    heights = class_c(3)
    np.testing.assert_allclose(
        Truck(gravity=9.81).record(heights).rates, Truck().record(heights).rates, atol=1e-12
    )


def test_half_a_load_more_sags_springs_and_tyres_by_its_weight():
    truck, g = Truck(gravity=9.81), 9.81
    p = truck.parameters
    load = SprungMass(mass=1.5 * 5394)
    record = truck.record(np.zeros((12000, 4)), [LoadStage(1.0, load)])
    front, rear = p.axle_distance
    extra = 0.5 * 5394 * g * np.array([rear, front]) / (2 * p.wheelbase)
    spring = -extra / np.array(p.spring_stiffness)
    np.testing.assert_allclose(record.deflections[-1, [0, 2]], spring, rtol=1e-6)
    tyre = -extra / np.array(p.tyre_stiffness)
    np.testing.assert_allclose(record.positions[-1, [3, 5]], tyre, rtol=1e-6)


def test_without_gravity_a_new_load_moves_nothing():
    record = Truck().record(np.zeros((1000, 4)), [LoadStage(0.5, SprungMass().scaled(1.5))])
    assert not record.positions.any()
    assert record.parameters[499, 0] == 5394
    assert record.parameters[500, 0] == 1.5 * 5394


def test_acceleration_obeys_the_mass_of_the_moment():
    heights = class_c(2)
    record = Truck().record(heights, [LoadStage(1.0, SprungMass().scaled(1.5))])
    force = record.deflections @ TruckParameters().excitation().T
    measured = np.diff(record.rates, axis=0) / 1e-3
    expected = ((force[1:] + force[:-1]) / 2) / record.parameters[:-1]
    scale = expected.std(axis=0)
    assert (np.abs(measured - expected).max(axis=0) / scale).max() < 0.02


def test_centre_of_mass_ahead_couples_heave_and_pitch_by_its_moment():
    truck = Truck()
    truck.set_load(SprungMass(cm_x=0.2))
    data = mujoco.MjData(truck.model)
    mujoco.mj_forward(truck.model, data)
    mass = np.zeros((7, 7))
    mujoco.mj_fullM(truck.model, data, mass)
    assert mass[0, 2] == pytest.approx(-5394 * 0.2)
    assert mass[2, 2] == pytest.approx(19632 + 5394 * 0.2**2)


def test_process_noise_is_an_acceleration_on_each_joint():
    noise = np.arange(1.0, 8.0) * np.ones((2, 1))
    record = Truck().record(np.zeros((2, 4)), acceleration_noise=noise)
    np.testing.assert_allclose(record.velocities[1], 1e-3 * noise[0], rtol=0.1)


def test_loads_of_earlier_runs_are_forgotten():
    truck, heights = Truck(), class_c(1)
    first = truck.record(heights, [LoadStage(0.5, SprungMass().scaled(0.5))])
    again = truck.record(heights, [LoadStage(0.5, SprungMass().scaled(0.5))])
    np.testing.assert_array_equal(first.rates, again.rates)


@pytest.mark.parametrize("heights", [np.zeros((10, 3)), np.full((10, 4), np.nan)])
def test_bad_road_is_refused(heights):
    with pytest.raises(TwinError, match="road_heights"):
        Truck().record(heights)


def test_stages_out_of_order_are_refused():
    stages = [LoadStage(0.5, SprungMass()), LoadStage(0.2, SprungMass())]
    with pytest.raises(TwinError, match="stages"):
        Truck().record(np.zeros((1000, 4)), stages)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_simulation_that_diverges_is_refused():
    with pytest.raises(TwinError, match="diverged"):
        Truck().record(np.full((2000, 4), 1e200))
