"""Deltas of a chassis from its file, written into the compiled model: what a calibration found."""

from collections.abc import Mapping

import mujoco
import numpy as np

from twin.errors import TwinError
from twin.parameters import LOAD

_LEAST_SHARE = 0.3  # of mass and of the least moment that is left, as of a twin's parameters
_PRODUCTS = {"Jxy": (0, 1), "Jxz": (0, 2), "Jyz": (1, 2)}


def check_deltas(source: object, deltas: Mapping[str, float]) -> None:
    """Refuses what is no finite delta of `twin.LOAD`.

    Raises:
        TwinError: a name is unknown or a number not finite.
    """
    for name, value in deltas.items():
        if name not in LOAD:
            raise TwinError(f"{source}: delta {name!r} is unknown; allowed: {', '.join(LOAD)}")
        if not np.isfinite(value):
            raise TwinError(f"{source}: delta {name} is {value}; allowed: a finite number")


def apply_deltas(model: mujoco.MjModel, deltas: Mapping[str, float], source: object) -> None:
    """Changes mass, CM and inertia (about the new CM) of the chassis of a model in place.

    Args:
        model: of a car.
        deltas: by name of `twin.LOAD`; zero where not given.
        source: the file, for messages.

    Raises:
        TwinError: no rigid body is so.
    """
    if not any(deltas.values()):
        return
    chassis = model.body("chassis").id
    axes = np.empty(9)
    mujoco.mju_quat2Mat(axes, model.body_iquat[chassis])
    axes = axes.reshape(3, 3)
    tensor = axes @ np.diag(model.body_inertia[chassis]) @ axes.T
    tensor += np.diag([deltas.get(name, 0.0) for name in ("Jxx", "Jyy", "Jzz")])
    for name, (row, column) in _PRODUCTS.items():
        tensor[row, column] += deltas.get(name, 0.0)
        tensor[column, row] += deltas.get(name, 0.0)
    mass = float(model.body_mass[chassis]) + deltas.get("mass", 0.0)
    moments, vectors = np.linalg.eigh(tensor)
    least = _LEAST_SHARE * model.body_inertia[chassis].min()
    if (
        mass < _LEAST_SHARE * model.body_mass[chassis]
        or moments[0] < least
        or (moments[2] > moments[0] + moments[1])
    ):
        raise TwinError(
            f"{source}: with these deltas the chassis has {mass:.4g} kg and moments of "
            f"{', '.join(f'{m:.4g}' for m in moments)} kg m2; allowed: those of a rigid body"
        )
    if np.linalg.det(vectors) < 0.0:
        vectors[:, 0] *= -1.0
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, vectors.ravel())
    model.body_mass[chassis] = mass
    model.body_ipos[chassis] += [deltas.get(f"cm_{axis}", 0.0) for axis in "xyz"]
    model.body_inertia[chassis] = moments
    model.body_iquat[chassis] = quat
    model.body_sameframe[chassis] = 0
    mujoco.mj_setConst(model, mujoco.MjData(model))
