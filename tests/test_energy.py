"""Energy of a coasting car: it falls by the work of the resistances, and by nothing else."""

import mujoco
import numpy as np
import pytest
from cars import (
    FX,
    FY,
    MX,
    MY,
    MZ,
    PITCH_RATE,
    ROLL_RATE,
    VZ,
    contact_points,
    drag,
    inputs,
    run,
    suv,
    times,
)

from twin import WHEELS

UP = np.array([0.0, 0.0, 1.0])
TYRE_SPRING, TYRE_DAMPER = 260e3, 50.0
DAMPERS = np.array([2900.0, 2900.0, 2700.0, 2700.0])


def wheels(twin):
    """(4, 3) centres of the wheels and their spin axes, in the world."""
    bodies = [twin.data.body(f"wheel_{w}") for w in WHEELS]
    return np.array([b.xpos for b in bodies]), np.array([b.xmat[1::3] for b in bodies])


def stored(twin):
    """Kinetic, potential and elastic energy [J], that of the tyres included, on level ground."""
    mujoco.mj_energyPos(twin.model, twin.data)
    mujoco.mj_energyVel(twin.model, twin.data)
    centres, axes = wheels(twin)
    squeezes = 0.369 * np.sqrt(1.0 - axes[:, 2] ** 2) - centres[:, 2]
    return twin.data.energy.sum() + 0.5 * TYRE_SPRING * (squeezes**2).sum()


def power_of_resistances(twin, velocity):
    """Of drag, dampers and tyres in the step just made from this generalised velocity [W].

    A tyre's forces act on its tread, which slips, its moments on the wheel's turning.
    """
    ahead = velocity[:3] @ twin.data.body("chassis").xmat[::3]
    power = drag(ahead) * ahead - (DAMPERS * velocity[twin.car.travel_dof] ** 2).sum()
    (centres, axes), points = wheels(twin), contact_points(twin)
    for w, out in enumerate(twin.tyre_forces()):
        along, turning = np.empty((3, twin.model.nv)), np.empty((3, twin.model.nv))
        mujoco.mj_jacBody(twin.model, twin.data, along, turning, twin.car.wheel_body[w])
        turn, centre = turning @ velocity, along @ velocity
        tread = centre + np.cross(turn, points[w] - centres[w])
        x = np.cross(axes[w], UP) / np.linalg.norm(np.cross(axes[w], UP))
        frame = np.array([x, np.cross(UP, x), UP])
        damping = -TYRE_DAMPER * centre[2]  # what the load has beyond the spring's
        power += out[[FX, FY]] @ (frame[:2] @ tread) + damping * centre[2]
        power += out[[MX, MY, MZ]] @ (frame @ turn)
    return power


def coast(twin, u, every):
    """Stored energy [J] and power of the resistances [W] before every so many steps."""
    energy, power = [], []
    for block in u.reshape(-1, every, u.shape[1]):
        mujoco.mj_step1(twin.model, twin.data)
        energy.append(stored(twin))
        velocity = twin.data.qvel.copy()
        run(twin, block[:1])
        power.append(power_of_resistances(twin, velocity))
        run(twin, block[1:])
    return np.array(energy), np.array(power)


@pytest.mark.parametrize(
    ("speed", "steer", "kick", "every", "tolerance"),
    [
        (30.0, 0.0, 0.0, 20, 1e-4),
        (30.0, 0.3, 0.0, 10, 1e-3),
        (20.0, 0.3, 0.5, 4, 1e-3),
        (0.0, 0.0, 0.5, 1, 3e-3),
    ],
)
def test_energy_of_a_coasting_car_falls_by_the_work_of_the_resistances(
    speed, steer, kick, every, tolerance
):
    twin = suv(speed)
    thrown = np.zeros(28)
    thrown[[VZ, ROLL_RATE, PITCH_RATE]] = kick, kick, -kick
    twin.correct(thrown)
    seconds = 1.2 if speed else 0.6
    u = inputs(seconds, steering=steer * np.sin(3.0 * times(seconds)))
    energy, power = coast(twin, u, every)
    work = np.sum(0.5 * (power[1:] + power[:-1])) * every * twin.dt
    assert np.all(np.diff(energy) < 0.0)
    assert energy[-1] - energy[0] == pytest.approx(work, rel=tolerance)
