"""The sports car and CommonRoad's BMW: statics, ride, symmetry, convergence, steady cornering."""

from dataclasses import dataclass

import numpy as np
import pytest
from cars import (
    FZ,
    SWAP,
    VX,
    YAW_RATE,
    G,
    eigenvalues_of,
    inputs,
    mirrored,
    pairs,
    run,
    times,
)
from scipy.integrate import solve_ivp
from vehiclemodels.init_mb import init_mb
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

import models
from scenarios.driving.manoeuvres import Manoeuvre
from scenarios.driving.record import record
from twin import Twin, Vehicle

BMW = parameters_vehicle2()


@dataclass(frozen=True)
class Figures:
    """Written out, what hand calculations start from; unsprung masses of an axle."""

    mass: float
    front: float
    rear: float
    unsprung: tuple[float, float]
    inertia: tuple[float, float, float]


CARS = {
    "sports_car": Figures(
        1391.29, 1.5714, 2.65 - 1.5714, (80.0, 88.0), (328.281, 1698.21, 1864.95)
    ),
    "bmw_320i": Figures(
        BMW.m_s, BMW.a, BMW.b, (BMW.m_uf, BMW.m_ur), (BMW.I_Phi_s, BMW.I_y_s, 1513.06)
    ),
}


def car(name, speed=0.0):
    twin = Twin(Vehicle.load(name))
    twin.reset(speed)
    return twin


@pytest.mark.parametrize("name", CARS)
def test_axle_loads_at_rest_are_those_of_a_lever_on_two_axles(name):
    figures = CARS[name]
    fl, fr, rl, rr = run(car(name), inputs(2.0, brake=200.0)).tyres[-1, :, FZ]
    wheelbase = figures.front + figures.rear
    front = G * (figures.mass * figures.rear / wheelbase + figures.unsprung[0])
    rear = G * (figures.mass * figures.front / wheelbase + figures.unsprung[1])
    assert (fl, rl) == pytest.approx((0.5 * front, 0.5 * rear), rel=1e-3)
    assert (fr, rr) == pytest.approx((fl, rl), rel=1e-9)


@pytest.mark.parametrize("name", CARS)
def test_chassis_has_the_inertia_of_its_source(name):
    chassis = Vehicle.load(name).chassis()
    np.testing.assert_allclose(chassis.inertia, np.diag(CARS[name].inertia), rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(chassis.cm, 0.0, atol=1e-12)


def test_yaw_inertia_of_the_whole_bmw_is_the_published_one():
    twin = car("bmw_320i")
    inertia = sum(twin.model.body_inertia[1:, 2])
    places = twin.data.xpos[twin.car.wheel_body] - twin.data.xpos[twin.car.chassis]
    inertia += 0.25 * (BMW.m_uf + BMW.m_ur) * (places[:, :2] ** 2).sum()
    assert inertia == pytest.approx(BMW.I_z, rel=1e-4)


@pytest.mark.parametrize("name", CARS)
def test_car_stands_at_the_height_it_is_drawn_at(name):
    twin = car(name)
    drawn = twin.model.body("chassis").pos[2]
    assert twin.read_states()[2] == pytest.approx(drawn, abs=1e-3)
    assert np.abs(twin.read_states()[6:10]).max() < 1e-3


@pytest.mark.parametrize("name", CARS)
def test_braked_car_stops_and_stands(name):
    made = run(car(name, 20.0), inputs(5.0, brake=900.0))
    assert np.abs(made.states[-1, VX:]).max() < 1e-2


def test_ride_frequencies_of_the_sports_car_are_those_of_one():
    (heave, pitch), damping = pairs(eigenvalues_of(car("sports_car")))[:, :2]
    assert 2.3 < heave < 2.6
    # the mass is nearer to the middle than the axles are: J = 0.72 m a b
    assert pitch / heave == pytest.approx(
        1.0 / np.sqrt(1698.21 / (1391.29 * 1.5714 * 1.0786)), rel=0.02
    )
    assert np.all((damping > 0.25) & (damping < 0.45))


@pytest.mark.parametrize("name", CARS)
def test_mirrored_inputs_drive_the_mirror_image(name):
    t = times(3.0)
    u = inputs(3.0, steering=0.5 * np.sin(2.0 * t))
    u[:, 3:5] = np.outer(np.sin(t), [200.0, 50.0])
    u[:, 5:9] = np.outer(t > 2.0, [500.0, 400.0, 300.0, 200.0])
    image = u.copy()
    image[:, 0] *= -1.0
    for block in (1, 5, 9):
        image[:, block : block + 4] = u[:, block : block + 4][:, SWAP]
    seen, other = run(car(name, 25.0), u).states, run(car(name, 25.0), image).states
    np.testing.assert_allclose(mirrored(other), seen, rtol=1e-9, atol=1e-9)
    assert np.abs(seen[:, YAW_RATE]).max() > 0.1


@pytest.mark.parametrize("name", CARS)
def test_half_the_step_makes_half_the_error(tmp_path, name):
    def yaw_rate(dt):
        text = models.path(name).read_text().replace('timestep="0.001"', f'timestep="{dt}"')
        file = tmp_path / f"{dt}.xml"
        file.write_text(text)
        twin = Twin(Vehicle.load(file))
        twin.reset(30.0)
        steering = 0.3 * np.sin(4.0 * times(1.5, dt))
        states = run(twin, inputs(1.5, dt, steering=steering, drive=100.0)).states
        return states[:: round(2e-3 / dt), YAW_RATE]

    finest = yaw_rate(0.00025)
    errors = [np.abs(yaw_rate(dt) - finest).max() for dt in (0.002, 0.001)]
    assert errors[1] < 0.01 * np.abs(finest).max()
    # of first order: (2 - 1/4) over (1 - 1/4)
    assert errors[0] / errors[1] == pytest.approx(7.0 / 3.0, rel=0.15)


def theirs(speed, steer, seconds):
    """Yaw rate, roll and lateral acceleration of CommonRoad's car in a turn, ISO axes."""

    def rates(t, x):
        inputs = [-steer / 0.5 if t < 0.5 else 0.0, 3.0 * (speed - x[3])]
        return vehicle_dynamics_mb([*x], inputs, BMW)

    start = init_mb([0.0, 0.0, 0.0, speed, 0.0, 0.0, 0.0], BMW)
    x = solve_ivp(rates, (0.0, seconds), start, rtol=1e-4, atol=1e-6, max_step=0.02).y[:, -1]
    return -x[5], x[6], -x[5] * x[3]


@pytest.mark.parametrize(("speed", "steer"), [(20.0, 0.028), (15.0, 0.05), (30.0, 0.015)])
def test_bmw_turns_and_rolls_like_commonroads(speed, steer):
    t = times(3.0)
    manoeuvre = Manoeuvre(
        name="turn", dt=0.001, speed=np.full(t.size, speed),
        steering=16.0 * steer * np.minimum(t / 0.5, 1.0), road=np.zeros((t.size, 4)),
    )  # fmt: skip
    truth = record(Vehicle.load("bmw_320i"), manoeuvre).truth
    yaw_rate, roll, acceleration = theirs(speed, steer, 3.0)
    assert 0.35 * G < acceleration < 0.6 * G
    assert truth["yaw_rate"][-1] == pytest.approx(yaw_rate, rel=0.035)
    assert truth["roll"][-1] == pytest.approx(roll, rel=0.06)
