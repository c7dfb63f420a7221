"""Fills the record of a car with what compiled code needs of its model, data and tyres."""

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.car_record import DATA_VIEWS, MODEL_VIEWS
from twin.channels import CHANNEL, OUTPUTS, WHEELS
from twin.parameters import PARAMETER
from twin.scale_setter import bind_factors
from twin.scales import AXLES, scale_shares
from twin.tyre.four_tyres import table_of

# Of the parameters that are no load
_NOMINAL = tuple(
    1.0 if record.kind == "scale" else 0.0 for record in PARAMETER.values() if record.kind != "load"
)
NUMERICS = ("steering_ratio", "ackermann", "drag_area", *(f"lift_area_{axle}" for axle in AXLES))


def bind(
    room: NDArray[np.void],
    model: mujoco.MjModel,
    data: mujoco.MjData,
    tyres: NDArray[np.void],
    scales: Mapping[str, float],
) -> None:
    """Fills in the record of a car.

    Args:
        room: (1,) record of `twin.car_record.CAR_DTYPE`, zeros.
        model: of the car, whose arrays the record points to.
        data: likewise.
        tyres: (4,) records of `twin.tyre.record.TYRE_DTYPE`.
        scales: factors of the vehicle, see `twin.scales`.
    """
    chassis = model.body("chassis").id
    wheels = [model.body(f"wheel_{w}").id for w in WHEELS]
    travels = [model.joint(f"travel_{w}").id for w in WHEELS]
    spins = [model.joint(f"spin_{w}").id for w in WHEELS]
    hub_bodies = model.body_parentid[wheels]
    hubs = model.body_pos[hub_bodies]
    other_mass = model.body_subtreemass[[0, chassis]] - model.body_mass[chassis]
    # MuJoCo takes the inertial frame for the body frame where the file has them equal.
    model.body_sameframe[chassis] = 0
    fields = {
        "model": model._address,
        "data": data._address,
        **{name: getattr(data, name).ctypes.data for name in DATA_VIEWS},
        **{name: getattr(model, name).ctypes.data for name in MODEL_VIEWS},
        "chassis": chassis,
        "wheel": np.arange(len(WHEELS)),
        "wheel_body": wheels,
        "hub_body": hub_bodies,
        "travel_joint": travels,
        "travel_qpos": model.jnt_qposadr[travels],
        "travel_dof": model.jnt_dofadr[travels],
        "spin_qpos": model.jnt_qposadr[spins],
        "spin_dof": model.jnt_dofadr[spins],
        "sensor": [
            model.sensor_adr[model.sensor(CHANNEL[name].sensor).id] + CHANNEL[name].axis
            for name in OUTPUTS
        ],
        "dt": model.opt.timestep,
        "wheelbase": hubs[:2, 0].mean() - hubs[2:, 0].mean(),
        "track": hubs[0, 1] - hubs[1, 1],
        **{name: model.numeric(name).data[0] for name in NUMERICS},
        "drive_share": 1.0,
        "brake_share": 1.0,
        "axle": hubs[:, 0].reshape(2, 2).mean(axis=1),
        "spin_inertia": model.body_inertia[wheels, 1],
        "nominal": [*_body(model, chassis), *_NOMINAL],
        "damping": model.dof_damping[model.jnt_dofadr[travels]],
        "nominal_unsprung": [
            model.body_mass[hub_bodies],
            model.body_mass[wheels],
            *model.body_inertia[wheels].T,
        ],
        "nominal_axis": model.jnt_axis[travels],
        "nominal_lift_area": [model.numeric(f"lift_area_{axle}").data[0] for axle in AXLES],
        "nominal_other_mass": other_mass,
        "input_state": np.nan,
        "compiled_inertia": np.append(model.body_inertia[chassis], model.body_iquat[chassis]),
        "other_mass": other_mass,
        "side": np.array([1.0, -1.0, 1.0, -1.0]) * tyres["side"],
        "tyres": table_of(tyres),
    }
    for name, value in fields.items():
        room[name] = value
    scale_shares(room, scales)
    bind_factors(room, model)


def _body(model: mujoco.MjModel, body: int) -> list[float]:
    """Mass, CM and inertia tensor of a body, in the order of `twin.LOAD`."""
    axes = np.empty(9)
    mujoco.mju_quat2Mat(axes, model.body_iquat[body])
    turn = axes.reshape(3, 3)
    inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
    products = inertia[0, 1], inertia[0, 2], inertia[1, 2]
    return [model.body_mass[body], *model.body_ipos[body], *np.diag(inertia), *products]
