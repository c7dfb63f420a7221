"""A parameter of the twin does what the same change of the car's files does."""

import numpy as np
import pytest

from scenarios.plants.random_car import real_car
from scenarios.plants.real_vehicle import real_vehicle
from twin import PARAMETER, PARAMETERS, PARTS, Twin, Vehicle
from twin.stepping import SMOOTHING

N = 600


def inputs():
    """(N, 13) of a drive that steers, accelerates and brakes."""
    u = np.zeros((N, 13))
    time = np.arange(N) * 1e-3
    u[:, 0] = 0.5 * np.sin(12.0 * time)
    u[:, 1:5] = 200.0 * (time < 0.3)[:, None]
    u[:, 5:9] = 300.0 * (time > 0.4)[:, None]
    u[:, 9:] = 0.01 * np.sin(30.0 * time)[:, None] * np.array([1.0, 0.5, 0.8, 0.3])
    return u


def outputs(twin, u=None):
    """(N, 10) from 15 m/s on."""
    twin.reset(15.0)
    return np.array([twin.step(row) for row in (inputs() if u is None else u)])


def with_parameters(vehicle, **deltas):
    twin = Twin(vehicle)
    p = np.zeros(len(PARAMETERS))
    for name, value in deltas.items():
        p[PARAMETERS.index(name)] = value
    twin.set_parameters(p)
    return twin


@pytest.fixture(scope="module")
def suv():
    return Vehicle.load("suv")


@pytest.mark.parametrize(
    ("deltas", "properties"),
    [
        ({"tyre_stiffness": 0.1}, {"tyre_pressure": 1.1}),
        ({"front_cornering_stiffness": 0.1}, {"cornering_stiffness": (1.1, 1.0)}),
        ({"rolling_radius": -0.01}, {"rolling_radius": 0.99}),
        ({"front_anti_roll": 0.2, "rear_anti_roll": -0.3}, {"anti_roll_bars": (1.2, 0.7)}),
        ({"front_spring": 0.1}, {"springs": (1.1, 1.0)}),
        ({"front_damper": -0.2}, {"dampers": (0.8, 1.0)}),
        ({"steering_ratio": 0.03}, {"steering_ratio": 1.03}),
        ({"lift": 0.2}, {"lift": (0.1, 0.1)}),
        ({"roll_centre": 0.5}, {"roll_centres": (0.5 * 0.0727 * 0.825, 0.5 * 0.1333 * 0.825)}),
    ],
)
def test_parameter_is_the_change_of_the_files(suv, deltas, properties):
    other = Twin(real_vehicle(suv, real_car(**properties)))
    before = outputs(Twin(suv))
    after, expected = outputs(with_parameters(suv, **deltas)), outputs(other)
    assert np.abs(expected - before).max() > 1e-5
    np.testing.assert_allclose(after, expected, atol=1e-6)


def test_unsprung_mass_is_that_of_hubs_and_wheels(suv):
    other = Twin(real_vehicle(suv, real_car(unsprung_mass=(1.2, 1.2))))
    twin = with_parameters(suv, unsprung_mass=0.2)
    # the hub's own inertia, which turns with the chassis, is left as it is: 0.3 kg m2
    np.testing.assert_allclose(outputs(twin), outputs(other), atol=2e-3)
    assert twin.model.body_subtreemass[0] == pytest.approx(other.model.body_subtreemass[0])
    twin.set_parameters(np.zeros(len(PARAMETERS)))
    assert twin.model.body_subtreemass[0] == pytest.approx(Twin(suv).model.body_subtreemass[0])
    np.testing.assert_array_equal(outputs(twin), outputs(Twin(suv)))


@pytest.mark.parametrize("name", PARTS)
def test_part_changes_the_drive_and_goes_back(suv, name):
    twin = with_parameters(suv, **{name: PARAMETER[name].step})
    changed = outputs(twin)
    twin.set_parameters(np.zeros(len(PARAMETERS)))
    nominal = outputs(Twin(suv))
    assert np.abs(changed - nominal).max() > 1e-7
    np.testing.assert_array_equal(outputs(twin), nominal)


def test_delayed_hand_wheel_is_that_of_the_delay_ago(suv):
    delay, u = 0.01, np.zeros((N, 13))
    u[:, 0] = 0.2 * np.sin(6.0 * np.arange(N) * 1e-3)
    late = u.copy()
    late[:, 0] = 0.2 * np.sin(6.0 * (np.arange(N) * 1e-3 - delay))
    before, expected = outputs(Twin(suv), u), outputs(Twin(suv), late)
    after = outputs(with_parameters(suv, steering_delay=delay), u)
    yaw_rate = 5
    error = np.abs(after - expected)[100:, yaw_rate].max()
    assert error < 0.15 * np.abs(before - expected)[100:, yaw_rate].max()
    assert delay < SMOOTHING


def test_brake_torque_that_comes_early_never_drives(suv):
    u = np.zeros((200, 13))
    u[:100, 5:9] = 100.0
    twin = with_parameters(suv, torque_delay=-0.02)
    assert np.isfinite(outputs(twin, u)).all()
    assert (twin.car.inputs[5:9] >= 0.0).all()


def test_front_brakes_are_the_front_ones(suv):
    u = np.zeros((100, 13))
    u[:, 5:9] = 200.0
    forces = []
    for share in (0.0, 0.2):
        twin = with_parameters(suv, front_brake_torque=share)
        outputs(twin, u)
        forces.append(twin.tyre_forces()[:, 0])
    assert forces[1][0] < forces[0][0] < 0.0
    assert forces[1][2] == pytest.approx(forces[0][2], rel=0.01)


def test_dampers_of_a_scaled_twin_differ_in_bump_and_rebound(suv):
    one = with_parameters(suv, damper_asymmetry=0.3)
    outputs(one)
    p = np.zeros(len(PARAMETERS))
    p[PARAMETERS.index("damper_asymmetry")], p[PARAMETERS.index("damper")] = 0.3, 0.1
    one.set_parameters(p)
    fresh = with_parameters(suv, damper_asymmetry=0.3, damper=0.1)
    np.testing.assert_array_equal(outputs(one), outputs(fresh))


def test_compliance_steer_turns_the_front_wheels_out_of_the_bend(suv):
    u = np.zeros((800, 13))
    u[:, 0] = 0.4
    yaw_rates = [
        outputs(with_parameters(suv, compliance_steer=value), u)[-1, 5] for value in (0.0, 1e-6)
    ]
    assert 0.0 < yaw_rates[1] < yaw_rates[0]


def test_snapshot_keeps_the_delay(suv):
    u = inputs()
    twin = with_parameters(suv, steering_delay=0.01, torque_delay=0.02)
    twin.reset(15.0)
    for row in u[:200]:
        twin.step(row)
    kept = twin.snapshot()
    one = [twin.step(row) for row in u[200:300]]
    twin.restore(kept)
    np.testing.assert_array_equal([twin.step(row) for row in u[200:300]], one)
