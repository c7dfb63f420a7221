"""The compiled functions against MuJoCo's own, and their convergence over the step."""

import mujoco
import numpy as np
import pytest
from cars import (
    ANGLE,
    FX,
    FY,
    FZ,
    MX,
    MY,
    MZ,
    PITCH,
    ROLL,
    SPIN,
    VX,
    YAW,
    G,
    X,
    drag,
    inputs,
    run,
    suv,
    times,
    variant,
)

from twin import LOAD, PARAMETERS, STATES, WHEELS, Twin, Vehicle


def lively(seconds, dt=0.001):
    """Inputs that move everything: steering, drive, brakes and a rough road."""
    t = times(seconds, dt)
    u = inputs(seconds, dt, steering=1.2 * np.sin(3.0 * t))
    u[:, 1:5] = np.outer(np.sin(2.0 * t), [200.0, 150.0, 300.0, 250.0])
    u[:, 5:9] = np.outer(np.maximum(np.sin(5.0 * t + 1.0), 0.0), [500.0, 400.0, 300.0, 200.0])
    u[:, 9:13] = 0.01 * np.sin(np.outer(t, [7.0, 9.0, 11.0, 13.0]))
    return u


def test_recorded_forces_replayed_through_mj_step_give_the_same_bits():
    twin, forces, steer = suv(20.0), [], []
    start = twin.snapshot().state
    u = lively(1.0)
    after = []
    for row in u:
        twin.step(row)
        forces.append(twin.data.qfrc_applied.copy())
        steer.append(twin.model.body_quat.copy())
        after.append(np.concatenate([twin.data.qpos, twin.data.qvel]))
    model = Vehicle.load("suv").compile()
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, start, mujoco.mjtState.mjSTATE_INTEGRATION)
    for force, quat, expected in zip(forces, steer, after, strict=True):
        data.qfrc_applied[:] = force
        model.body_quat[:] = quat
        mujoco.mj_step(model, data)
        assert np.array_equal(np.concatenate([data.qpos, data.qvel]), expected)


def test_generalised_forces_are_jacobian_times_wrenches():
    twin = suv(20.0)
    for row in lively(1.5):
        twin.step(row)
        expected = wrenches(twin, row)
        left = twin.data.qfrc_applied - expected
        brakes = left[twin.car.spin_dof]
        left[twin.car.spin_dof] = 0.0
        assert np.abs(left).max() < 1e-9 * np.abs(expected).max()
        assert np.all(np.abs(brakes) <= row[5:9] + 1e-9 * np.abs(expected).max())


def wrenches(twin, u):
    """(14,) J^T F of tyres, drag and drive torques, by MuJoCo's mj_applyFT."""
    model, data = twin.model, twin.data
    chassis = data.body("chassis")
    frame = chassis.xmat.reshape(3, 3)
    total = np.zeros(model.nv)
    ahead = frame[:, 0]

    def push(force, moment, point, body):
        mujoco.mj_applyFT(model, data, force, moment, point, body.id, total)

    speed = np.empty(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, chassis.id, speed, 0)
    push(drag(speed[3:] @ ahead) * ahead, np.zeros(3), chassis.xpos, chassis)
    road = u[9:13]
    rise = (road[:2].mean() - road[2:].mean()) / 2.90
    bank = (road[::2].mean() - road[1::2].mean()) / 1.65
    c, s = ahead[:2] / np.hypot(*ahead[:2])
    normal = np.array([-rise * c + bank * s, -rise * s - bank * c, 0.0])
    normal[2] = np.sqrt(1.0 - normal @ normal)
    for w, out in enumerate(twin.tyre_forces()):
        body = data.body(f"wheel_{WHEELS[w]}")
        axis = body.xmat.reshape(3, 3)[:, 1]
        x = np.cross(axis, normal) / np.linalg.norm(np.cross(axis, normal))
        axes = np.array([x, np.cross(normal, x), normal])
        upright = np.cross(x, axis)
        radius = (body.xpos[2] - road[w]) * normal[2] / (upright @ normal)
        point = body.xpos - radius * upright
        push(out[[FX, FY, FZ]] @ axes, out[[MX, MY, MZ]] @ axes, point, body)
        total[twin.car.spin_dof[w]] += u[1 + w]
    return total


def test_halving_the_step_halves_the_error(tmp_path):
    ends = []
    for dt in (0.001, 0.0005, 0.00025):
        folder = tmp_path / str(dt)
        folder.mkdir()
        twin = Twin(variant(folder, ('timestep="0.001"', f'timestep="{dt}"')))
        twin.reset(25.0)
        t = times(2.0, dt)
        u = inputs(2.0, dt, steering=np.sin(np.pi * t))
        u[:, 5:9] = np.outer(np.clip(t - 0.5, 0.0, 0.5), [1500.0, 1500.0, 800.0, 800.0])
        run(twin, u)
        ends.append(twin.read_states())
    coarse, fine = np.diff(ends, axis=0)
    assert np.abs(coarse).max() > 1e-3  # the manoeuvre moves the car
    for states in (slice(X, ROLL), slice(YAW, ANGLE), slice(VX, SPIN)):
        order = np.log2(np.linalg.norm(coarse[states]) / np.linalg.norm(fine[states]))
        assert order == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("i", range(28), ids=STATES)
def test_correction_changes_the_state_it_names_and_no_other(i):
    twin = suv(15.0)
    run(twin, lively(0.6))
    before, size = twin.read_states(), 1e-6
    twin.correct(size * np.eye(28)[i])
    change = (twin.read_states() - before) / size
    expected = np.eye(28)[i]
    if ROLL <= i < ROLL + 3:
        # a turn about a body axis, told in roll, pitch and yaw: Euler's kinematic equations
        roll, pitch, _ = before[ROLL : ROLL + 3]
        sr, cr, tp, cp = np.sin(roll), np.cos(roll), np.tan(pitch), np.cos(pitch)
        euler = np.array([[1.0, sr * tp, cr * tp], [0.0, cr, -sr], [0.0, sr / cp, cr / cp]])
        expected[ROLL : ROLL + 3] = euler[:, i - ROLL]
    np.testing.assert_allclose(change, expected, atol=2e-6)


def test_large_turn_keeps_the_velocity_in_the_body_frame():
    twin = suv(15.0)
    run(twin, lively(0.6))
    before = twin.read_states()
    turn = np.zeros(28)
    turn[ROLL : ROLL + 3] = 0.2, -0.3, 2.0
    twin.correct(turn)
    after = twin.read_states()
    np.testing.assert_allclose(after[VX:], before[VX:], rtol=1e-12, atol=1e-12)
    assert np.linalg.norm(twin.data.qpos[3:7]) == pytest.approx(1.0, abs=1e-15)


def test_turns_by_opposite_corrections_cancel():
    twin = suv(15.0)
    run(twin, lively(0.6))
    before = twin.read_states()
    turn = np.zeros(28)
    turn[ROLL : ROLL + 3] = 0.2, -0.3, 2.0
    twin.correct(turn)
    twin.correct(-turn)
    np.testing.assert_allclose(twin.read_states(), before, rtol=1e-12, atol=1e-12)


REST = [0.0] * (len(PARAMETERS) - len(LOAD))
DELTAS = np.array([355.0, -0.3, 0.05, 0.06, 90.0, 700.0, 690.0, 12.0, -40.0, 8.0, *REST])


def test_parameters_set_at_run_time_equal_a_model_made_with_them():
    twin, other = suv(), suv()
    twin.set_parameters(DELTAS)
    nominal = twin.car.nominal
    values = nominal + DELTAS
    spec = Vehicle.load("suv").spec()
    body = spec.body("chassis")
    body.mass, body.ipos = values[0], values[1:4]
    body.fullinertia = values[4:10]
    body.iquat = 1.0, 0.0, 0.0, 0.0
    made = spec.compile()
    body = made.body("chassis").id
    for name in ("body_mass", "body_ipos", "body_inertia", "body_subtreemass"):
        np.testing.assert_allclose(
            getattr(twin.model, name), getattr(made, name), rtol=1e-12, atol=1e-12
        )
    # a step of plain MuJoCo on both from the same moving state
    run(other, lively(0.5))
    state = other.snapshot().state
    results = []
    for model in (twin.model, made):
        data = mujoco.MjData(model)
        mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_step(model, data)
        results.append(np.concatenate([data.qacc, data.sensordata]))
    np.testing.assert_allclose(results[0], results[1], rtol=1e-10, atol=1e-10)
    # and mj_setConst finds nothing to mend in what a step uses
    before = [getattr(twin.model, n).copy() for n in ("body_subtreemass", "body_mass")]
    mujoco.mj_setConst(twin.model, mujoco.MjData(twin.model))
    after = [getattr(twin.model, n) for n in ("body_subtreemass", "body_mass")]
    for one, two in zip(before, after, strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-14)


ABSURD = [
    np.array([-1e5, 0, 0, 0, *[0.0] * 6, *REST]),
    np.array([0.0, 0, 0, 0, -1e6, 0, 0, 0, 0, 0, *REST]),
    np.array([0.0, 0, 0, 0, 0, 0, 1e6, 0, 0, 0, *REST]),
    np.array([0.0, 0, 0, 0, 0, 0, 0, 5e4, -3e4, 2e4, *REST]),
    np.array([-1e9, 0, 0, 0, -1e9, -1e9, -1e9, 1e9, 1e9, 1e9, *REST]),
    np.array([1e4, 0, 0, 0, 1e5, 1e2, -1e5, 1e3, 1e4, -1e5, *REST]),
]


@pytest.mark.parametrize("deltas", ABSURD)
def test_absurd_parameters_come_back_as_a_rigid_body(deltas):
    twin = suv()
    put = twin.set_parameters(deltas)
    values = twin.car.nominal + put
    assert values[0] >= 0.3 * twin.car.nominal[0] * (1 - 1e-12)
    xx, yy, zz, xy, xz, yz = values[4:10]
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments = np.linalg.eigvalsh(tensor)
    assert moments[0] > 0.0
    assert moments[2] <= moments[0] + moments[1]
    np.testing.assert_allclose(np.sort(twin.model.body_inertia[1]), moments, rtol=1e-6)
    again = twin.set_parameters(put)
    np.testing.assert_allclose(again, put, rtol=1e-9, atol=1e-6)
    twin.reset()
    run(twin, lively(0.1))


def test_zero_parameters_after_others_restore_the_nominal_car_to_the_bit():
    twin = suv()
    names = ("body_mass", "body_subtreemass", "body_ipos", "body_inertia", "body_iquat")
    nominal = [getattr(twin.model, name).copy() for name in names]
    for scale in (1.0, 0.1, -0.37):
        twin.set_parameters(scale * DELTAS)
        twin.set_parameters(np.zeros(len(PARAMETERS)))
        for name, value in zip(names, nominal, strict=True):
            np.testing.assert_array_equal(getattr(twin.model, name), value, err_msg=name)


def test_zero_parameters_after_others_restore_the_nominal_car_to_rounding():
    twin, fresh = suv(), suv()
    for scale in (1.0, 0.1, -0.37):
        twin.set_parameters(scale * DELTAS)
        twin.set_parameters(np.zeros(len(PARAMETERS)))
    np.testing.assert_allclose(inertia(twin), inertia(fresh), rtol=1e-12, atol=1e-9)
    assert twin.model.body_mass[1] == pytest.approx(fresh.model.body_mass[1], rel=1e-14)
    np.testing.assert_array_equal(twin.model.body_ipos, fresh.model.body_ipos)


def inertia(twin):
    """(3, 3) of the chassis about its CM in its own axes, from what MuJoCo holds."""
    axes = np.empty(9)
    mujoco.mju_quat2Mat(axes, twin.model.body_iquat[1])
    axes = axes.reshape(3, 3)
    return axes @ np.diag(twin.model.body_inertia[1]) @ axes.T


def test_products_of_inertia_set_are_entries_of_the_tensor():
    twin = suv()
    twin.set_parameters(DELTAS)
    xx, yy, zz, xy, xz, yz = (twin.car.nominal + DELTAS)[4:10]
    expected = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    np.testing.assert_allclose(inertia(twin), expected, rtol=1e-12, atol=1e-9)


def test_accelerometer_at_rest_reads_gravity_upwards():
    made = run(suv(), inputs(0.5))
    roll, pitch = made.states[-1, [ROLL, PITCH]]
    expected = G * np.array([-np.sin(pitch), np.sin(roll), 1.0])
    np.testing.assert_allclose(made.outputs[-1, :3], expected, atol=1e-4 * G)
    np.testing.assert_allclose(made.outputs[-1, 3:], 0.0, atol=1e-4)
