"""What a model of a car gets wrong besides its load, as factors on numbers of the car.

`TARGETS` alone says which numbers a scale multiplies. `Vehicle.scaled` makes another car with it
("the real vehicle"); `twin.scale_setter` does the same to a twin while it drives.
"""

from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.channels import WHEELS
from twin.parameters import FACTORS

AXLES = ("front", "rear")
Array = NDArray[np.float64]


class Target(NamedTuple):
    """Numbers of a car that a scale multiplies.

    Attributes:
        where: "tyre", a coefficient of the tyres; "number", one of <custom> in the MJCF, and a
            field of the car's record; "share", a field of the car's record, per wheel; "model", an
            array of `mujoco.MjModel`, per wheel or per axle (see `places`).
        name: of the coefficient, number, field or array.
        axle: "front" or "rear"; empty for both.
        divides: it divides the numbers instead.
    """

    where: Literal["tyre", "number", "share", "model"]
    name: str
    axle: str = ""
    divides: bool = False


def _tyre(*names: str) -> tuple[Target, ...]:
    return tuple(Target("tyre", name) for name in names)


_TYRES = {
    "tyre_friction": _tyre("lmux", "lmuy"),
    "cornering_stiffness": _tyre("lky"),
    "relaxation": _tyre("lsgkp", "lsgal"),
    "slip_stiffness": _tyre("lkx"),
    "combined_slip": _tyre("lyka"),  # how soon lateral force is lost to slip
    "load_of_largest_stiffness": _tyre("pky2"),  # large: stiffness in proportion to load
    "lateral_curvature": _tyre("ley"),
    "tyre_stiffness": _tyre("vertical_stiffness"),
    "rolling_radius": _tyre("unloaded_radius"),
}
_ALL_TARGETS = {
    **_TYRES,
    "drag": (Target("number", "drag_area"),),
    # with the anti-roll bars, at the nominal ride height: a stiffer spring is shorter by as much
    "spring": (
        Target("model", "jnt_stiffness"),
        Target("model", "qpos_spring", divides=True),
        Target("model", "tendon_stiffness"),
    ),
    "front_spring": (
        Target("model", "jnt_stiffness", "front"),
        Target("model", "qpos_spring", "front", divides=True),
    ),
    "damper": (Target("model", "dof_damping"),),
    "front_damper": (Target("model", "dof_damping", "front"),),
    "drive_torque": (Target("share", "drive_share"),),
    "brake_torque": (Target("share", "brake_share"),),
    "front_brake_torque": (Target("share", "brake_share", "front"),),
    **{
        f"{axle}_{name}": tuple(target._replace(axle=axle) for target in targets)
        for axle in AXLES
        for name, targets in _TYRES.items()
    },
    **{f"{axle}_anti_roll": (Target("model", "tendon_stiffness", axle),) for axle in AXLES},
    "steering_ratio": (Target("number", "steering_ratio"),),
}
TARGETS: Mapping[str, tuple[Target, ...]] = {
    name: _ALL_TARGETS[name] for name in (*FACTORS, *_ALL_TARGETS)
}
"""By the name of a scale; those of `twin.FACTORS`, the first, are parameters of a twin too."""

VEHICLE_SCALES = tuple(TARGETS)
MOST_FACTORS = 4 * sum(len(TARGETS[name]) for name in FACTORS)
"""On how many numbers of a running twin parameters act at most."""


def scale_tyres(tyres: NDArray[np.void], factors: Mapping[str, float]) -> None:
    """Scales four tyres in place.

    Args:
        tyres: (4,) records of `twin.tyre.record.TYRE_DTYPE`.
        factors: by `VEHICLE_SCALES`.
    """
    for target, factor in _chosen(factors, "tyre"):
        _scale(tyres[target.name], _wheels(target), target, factor)


def scale_shares(car: NDArray[np.void], factors: Mapping[str, float]) -> None:
    """Scales in place what belongs to the car's record only.

    Args:
        car: (1,) record of `twin.car_record.CAR_DTYPE`.
        factors: by `VEHICLE_SCALES`.
    """
    for target, factor in _chosen(factors, "share"):
        _scale(car[target.name][0], _wheels(target), target, factor)


def scale_model(model: mujoco.MjModel, factors: Mapping[str, float]) -> None:
    """Scales a compiled car in place.

    Args:
        model: of the car.
        factors: by `VEHICLE_SCALES`.
    """
    for target, factor in _chosen(factors, "model"):
        _scale(getattr(model, target.name), places(model, target), target, factor)
    for target, factor in _chosen(factors, "number"):
        address = model.numeric_adr[model.numeric(target.name).id]
        _scale(model.numeric_data, [address], target, factor)


def _chosen(factors: Mapping[str, float], where: str) -> Iterator[tuple[Target, float]]:
    for name, factor in factors.items():
        for target in TARGETS[name]:
            if target.where == where:
                yield target, factor


def _scale(numbers: Array, places: list[int], target: Target, factor: float) -> None:
    if target.divides:
        numbers[places] /= factor
    else:
        numbers[places] *= factor


def places(model: mujoco.MjModel, target: Target) -> list[int]:
    """Indices of a target's numbers in their array.

    Args:
        model: of the car.
        target: of which; a single number has index 0.
    """
    if target.where == "number":
        return [0]
    if target.name == "tendon_stiffness":
        axles = [target.axle] if target.axle else AXLES
        names = [f"anti_roll_{axle}" for axle in axles]
        bars = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TENDON, name) for name in names]
        return [bar for bar in bars if bar >= 0]
    if target.where != "model":
        return _wheels(target)
    travels = [model.joint(f"travel_{WHEELS[w]}").id for w in _wheels(target)]
    of_joint = {"qpos_spring": model.jnt_qposadr, "dof_damping": model.jnt_dofadr}
    return [int(of_joint.get(target.name, np.arange(model.njnt))[joint]) for joint in travels]


def _wheels(target: Target) -> list[int]:
    return [w for w, wheel in enumerate(WHEELS) if wheel[0] == target.axle[:1] or not target.axle]
