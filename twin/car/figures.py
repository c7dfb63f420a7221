"""What a car tells of itself: sizes, masses and air, from its compiled model and its tyres."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.channels import WHEELS
from twin.tyre.interface import forces, stiffness
from twin.tyre.radius import effective_radius

GRAVITY = 9.81  # [m/s2], of the models
# Numbers of <custom> that a car may leave out, with what stands for them, least and largest
OPTIONAL = {
    "drive_front": (0.0, 0.0, 1.0),  # share of the front axle in the drive torque; rear drive
    "brake_front": (0.65, 0.0, 1.0),  # ... in the brake torque
    "power": (0.0, 0.0, 1e7),  # of the engine at the wheels [W]; 0: as usual for the mass
    # standard deviation of the scale of the torques that a log has
    "torque_accuracy": (0.03, 0.0, 0.5),
}
USUAL_POWER = 80.0  # [W/kg]; chosen: a car of 110 horsepower a tonne
_SPEED = 20.0  # [m/s] at which grip is looked for
_SLIPS = np.linspace(0.0, 0.4, 81)

Pair = tuple[float, float]


class Figures(NamedTuple):
    """A car as it stands on a level road, with what is on board; pairs are front and rear."""

    mass: float  # of the whole car [kg]
    cm_height: float  # above the road [m]
    wheelbase: float  # [m]
    track: Pair  # [m]
    axle_x: Pair  # of the hubs, from the IMU [m]
    axle_load: Pair  # [N]
    wheel_radius: Pair  # effective rolling radius [m]
    wheel_inertia: Pair  # of a wheel about its axis [kg m2]
    steering_ratio: float  # hand wheel over road wheels
    drag_area: float  # c_D A [m2]
    lift_area: Pair  # -c_L A [m2], positive pushes down
    drive_front: float  # share of the front axle in the drive torque
    brake_front: float  # ... in the brake torque
    power: float  # of the engine at the wheels [W]
    torque_accuracy: float  # standard deviation of the scale of a log's torques


class Grip(NamedTuple):
    """What the tyres of a car can do under its static loads; pairs are front and rear."""

    cornering_stiffness: Pair  # of an axle [N/rad]
    friction: Pair  # largest lateral force over load


def figures_of(model: mujoco.MjModel, tyres: NDArray[np.void]) -> Figures:
    """The figures of a car.

    Args:
        model: compiled, see `twin.Vehicle.compile`.
        tyres: (4,) records, see `twin.Vehicle.tyres`.
    """
    wheels = [model.body(f"wheel_{wheel}").id for wheel in WHEELS]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    cm, imu = data.subtree_com[0], data.xpos[model.body("chassis").id]
    hubs = model.body_pos[model.body_parentid[wheels]]
    x = hubs[:, 0].reshape(2, 2).mean(axis=1)
    mass = float(model.body_mass.sum())
    wheelbase = x[0] - x[1]
    behind = x[0] - (cm[0] - imu[0])
    load = mass * GRAVITY * np.array([wheelbase - behind, behind]) / wheelbase
    return Figures(
        mass=mass,
        cm_height=float(cm[2]),
        wheelbase=float(wheelbase),
        track=_pair(hubs[::2, 1] - hubs[1::2, 1]),
        axle_x=_pair(x),
        axle_load=_pair(load),
        wheel_radius=_pair(effective_radius(tyres[2 * i], 0.5 * load[i]) for i in (0, 1)),
        wheel_inertia=_pair(model.body_inertia[wheels[::2], 1]),
        steering_ratio=number(model, "steering_ratio"),
        drag_area=number(model, "drag_area"),
        lift_area=(number(model, "lift_area_front"), number(model, "lift_area_rear")),
        drive_front=number(model, "drive_front"),
        brake_front=number(model, "brake_front"),
        power=number(model, "power") or USUAL_POWER * mass,
        torque_accuracy=number(model, "torque_accuracy"),
    )


def grip_of(figures: Figures, tyres: NDArray[np.void]) -> Grip:
    """What the tyres can do.

    Args:
        figures: of the car.
        tyres: (4,) records, see `twin.Vehicle.tyres`.
    """
    loads = 0.5 * np.array(figures.axle_load)
    pairs = list(zip(tyres[::2], loads, strict=True))
    lateral = [
        max(abs(forces(tyre, load, 0.0, slip, 0.0, _SPEED, 1.0)[1]) for slip in _SLIPS)
        for tyre, load in pairs
    ]
    return Grip(
        cornering_stiffness=_pair(2.0 * stiffness(tyre, load, 0.0)[1] for tyre, load in pairs),
        friction=_pair(np.array(lateral) / loads),
    )


def number(model: mujoco.MjModel, name: str) -> float:
    """A number of <custom>; where a car leaves out an optional one, what stands for it.

    Args:
        model: compiled.
        name: of the number.
    """
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
    return float(model.numeric(name).data[0]) if found >= 0 else OPTIONAL[name][0]


def _pair(values) -> Pair:
    front, rear = values
    return float(front), float(rear)
