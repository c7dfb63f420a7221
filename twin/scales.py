"""Scales what a model of a car gets wrong besides its load: tyres, drag, springs, torques.

`Vehicle.scaled` makes another car of it ("the real vehicle"); `set_scales` does the same to a twin
while it drives. Springs keep the nominal ride height: a stiffer one is the shorter by as much.
"""

from collections.abc import Mapping

import mujoco
import numpy as np
from numba import types
from numpy.typing import NDArray

from twin.car_record import AXLES, CAR, SCALED_TYRE
from twin.channels import WHEELS
from twin.compiled.boundary import VECTOR, behind
from twin.compiled.simd import pointer
from twin.parameters import LARGEST_SCALE, LEAST_SCALE, SCALE_FACTORS, SCALES, P
from twin.tyre.four_tyres import NAMES

# Coefficients of a .tir file behind each name; those after the first three are no parameters of
# a running twin, but a real vehicle has others than its files say
TYRE_SCALES = {
    "tyre_friction": ("lmux", "lmuy"),
    "cornering_stiffness": ("lky",),
    "relaxation": ("lsgkp", "lsgal"),
    "slip_stiffness": ("lkx",),
    "combined_slip": ("lyka",),  # how soon lateral force is lost to slip
    "load_of_largest_stiffness": ("pky2",),  # large: cornering stiffness in proportion to load
    "lateral_curvature": ("ley",),
}
# Each for all tyres, or for those of an axle, as in rear_tyre_friction
_TYRES = {"": slice(None), "front_": slice(0, 2), "rear_": slice(2, 4)}
VEHICLE_SCALES = (
    *SCALES,
    *(name for name in TYRE_SCALES if name not in SCALES),
    *(f"{axle}{name}" for name in TYRE_SCALES for axle in _TYRES if axle),
    *("front_anti_roll", "rear_anti_roll", "steering_ratio"),
)
# Shares of the torques, `Car.torque_share`
TORQUES = ("drive_torque", "brake_torque")
BARS = tuple(f"anti_roll_{axle}" for axle in AXLES)

_LMUX, _LMUY, _LKY, _LSGKP, _LSGAL = (NAMES.index(name) for name in SCALED_TYRE)


def scale_tyres(tyres: NDArray[np.void], factors: Mapping[str, float]) -> None:
    """Scales four `twin.tyre.record.TYRE_DTYPE` in place, factors by `VEHICLE_SCALES`."""
    for axle, wheels in _TYRES.items():
        for name, keys in TYRE_SCALES.items():
            factor = np.ones(len(WHEELS))
            factor[wheels] = factors.get(axle + name, 1.0)
            for key in keys:
                tyres[key] = np.asarray(tyres[key], dtype=np.float64) * factor


def scale_model(model: mujoco.MjModel, factors: Mapping[str, float]) -> None:
    """Scales a compiled car in place, factors by `VEHICLE_SCALES`."""
    travels = [model.joint(f"travel_{wheel}") for wheel in WHEELS]
    spring = factors.get("spring", 1.0)
    for joint in travels:
        model.jnt_stiffness[joint.id] *= spring
        model.qpos_spring[joint.qposadr] /= spring
        model.dof_damping[joint.dofadr] *= factors.get("damper", 1.0)
    for axle, bar in zip(AXLES, bars(model), strict=True):
        if bar >= 0:
            model.tendon_stiffness[bar] *= spring * factors.get(f"{axle}_anti_roll", 1.0)
    for name, number in (("drag", "drag_area"), ("steering_ratio", "steering_ratio")):
        numeric = model.numeric(number)
        model.numeric_data[model.numeric_adr[numeric.id]] *= factors.get(name, 1.0)


def bars(model: mujoco.MjModel) -> list[int]:
    """Tendons of the anti-roll bars, front and rear; -1 where there is none."""
    return [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TENDON, name) for name in BARS]


@behind(types.void, CAR, VECTOR)
def set_scales(car, p):
    """The part of `twin.kernel.set_parameters` that is no load."""
    now = car.parameters
    changed = False
    for i in range(SCALE_FACTORS.start, SCALE_FACTORS.stop):
        p[i] = min(max(p[i], LEAST_SCALE - 1.0), LARGEST_SCALE - 1.0)
        changed = changed or p[i] != now[i]
        now[i] = p[i]
    if not changed:
        return
    friction, cornering = 1.0 + p[P.tyre_friction], 1.0 + p[P.cornering_stiffness]
    spring, damper = 1.0 + p[P.spring], 1.0 + p[P.damper]
    relaxation = 1.0 + p[P.relaxation]
    car.torque_share[0] = car.nominal_torque_share[0] * (1.0 + p[P.drive_torque])
    car.torque_share[1] = car.nominal_torque_share[1] * (1.0 + p[P.brake_torque])
    car.drag_area = car.nominal_drag_area * (1.0 + p[P.drag])
    stiffness, free = pointer(car.jnt_stiffness), pointer(car.qpos_spring)
    damping, bar = pointer(car.dof_damping), pointer(car.tendon_stiffness)
    for w in range(len(WHEELS)):
        car.tyres[_LMUX, w] = car.nominal_tyre[0, w] * friction
        car.tyres[_LMUY, w] = car.nominal_tyre[1, w] * friction
        car.tyres[_LKY, w] = car.nominal_tyre[2, w] * cornering
        car.tyres[_LSGKP, w] = car.nominal_tyre[3, w] * relaxation
        car.tyres[_LSGAL, w] = car.nominal_tyre[4, w] * relaxation
        stiffness[car.travel_joint[w]] = car.nominal_stiffness[w] * spring
        free[car.travel_qpos[w]] = car.nominal_spring[w] / spring
        damping[car.travel_dof[w]] = car.nominal_damping[w] * damper
    for i in range(len(AXLES)):
        if car.bar[i] >= 0:
            bar[car.bar[i]] = car.nominal_bar[i] * spring
