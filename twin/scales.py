"""Scales what a model of a car gets wrong besides its load: tyres, drag, springs, dampers.

`Vehicle.scaled` makes another car of it ("the real vehicle"); `set_scales` does the same to a twin
while it drives. Springs keep the nominal ride height: a stiffer one is the shorter by as much.
"""

from collections.abc import Mapping

import mujoco
import numpy as np
from numba import types
from numpy.typing import NDArray

from twin.boundary import VECTOR, behind
from twin.car import AXLES, CAR, SCALED_TYRE
from twin.channels import LOAD, SCALES, WHEELS
from twin.four_tyres import NAMES
from twin.lanes import pointer

# Beyond these factors it is no longer the same car
LEAST_SCALE, LARGEST_SCALE = 0.3, 3.0
# Scaling coefficients of a .tir file behind each name; relaxation lengths are no parameter of a
# twin, but a real vehicle may have others
TYRE_SCALES = {
    "tyre_friction": ("lmux", "lmuy"),
    "cornering_stiffness": ("lky",),
    "relaxation": ("lsgkp", "lsgal"),
}
VEHICLE_SCALES = (*SCALES, "relaxation")
BARS = tuple(f"anti_roll_{axle}" for axle in AXLES)

_FRICTION, _CORNERING, _DRAG, _SPRING, _DAMPER = range(len(LOAD), len(LOAD) + len(SCALES))
_LMUX, _LMUY, _LKY = (NAMES.index(name) for name in SCALED_TYRE)


def scale_tyres(tyres: NDArray[np.void], factors: Mapping[str, float]) -> None:
    """Scales records of `twin.tir.TYRE_DTYPE` in place, factors by `VEHICLE_SCALES`."""
    for name, keys in TYRE_SCALES.items():
        for key in keys:
            tyres[key] = tyres[key] * factors.get(name, 1.0)


def scale_model(model: mujoco.MjModel, factors: Mapping[str, float]) -> None:
    """Scales a compiled car in place, factors by `VEHICLE_SCALES`."""
    travels = [model.joint(f"travel_{wheel}") for wheel in WHEELS]
    spring = factors.get("spring", 1.0)
    for joint in travels:
        model.jnt_stiffness[joint.id] *= spring
        model.qpos_spring[joint.qposadr] /= spring
        model.dof_damping[joint.dofadr] *= factors.get("damper", 1.0)
    model.tendon_stiffness[[bar for bar in bars(model) if bar >= 0]] *= spring
    drag = model.numeric("drag_area")
    model.numeric_data[model.numeric_adr[drag.id]] *= factors.get("drag", 1.0)


def bars(model: mujoco.MjModel) -> list[int]:
    """Tendons of the anti-roll bars, front and rear; -1 where there is none."""
    return [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TENDON, name) for name in BARS]


@behind(types.void, CAR, VECTOR)
def set_scales(car, p):
    """The part of `twin.kernel.set_parameters` that is no load."""
    now = car.parameters
    changed = False
    for i in range(_FRICTION, _DAMPER + 1):
        p[i] = min(max(p[i], LEAST_SCALE - 1.0), LARGEST_SCALE - 1.0)
        changed = changed or p[i] != now[i]
        now[i] = p[i]
    if not changed:
        return
    friction, cornering = 1.0 + p[_FRICTION], 1.0 + p[_CORNERING]
    spring, damper = 1.0 + p[_SPRING], 1.0 + p[_DAMPER]
    car.drag_area = car.nominal_drag_area * (1.0 + p[_DRAG])
    stiffness, free = pointer(car.jnt_stiffness), pointer(car.qpos_spring)
    damping, bar = pointer(car.dof_damping), pointer(car.tendon_stiffness)
    for w in range(len(WHEELS)):
        car.tyres[_LMUX, w] = car.nominal_tyre[0, w] * friction
        car.tyres[_LMUY, w] = car.nominal_tyre[1, w] * friction
        car.tyres[_LKY, w] = car.nominal_tyre[2, w] * cornering
        stiffness[car.travel_joint[w]] = car.nominal_stiffness[w] * spring
        free[car.travel_qpos[w]] = car.nominal_spring[w] / spring
        damping[car.travel_dof[w]] = car.nominal_damping[w] * damper
    for i in range(len(AXLES)):
        if car.bar[i] >= 0:
            bar[car.bar[i]] = car.nominal_bar[i] * spring
