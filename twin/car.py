"""What compiled code sees of a car: addresses, numpy views and constants, in one named tuple."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Car(NamedTuple):
    """A simulated car as `twin.kernel` sees it; the `Twin` that made it owns what it points to.

    Views on MuJoCo's arrays carry MuJoCo's names.
    """

    model: int  # addresses of MjModel and MjData
    data: int
    # state and kinematics, views on MjData
    qpos: Array
    qvel: Array
    xpos: Array
    xmat: Array
    xaxis: Array
    cvel: Array
    subtree_com: Array
    qfrc_applied: Array
    sensordata: Array
    # inertia and steering, views on MjModel
    body_mass: Array
    body_ipos: Array
    body_inertia: Array
    body_iquat: Array
    body_subtreemass: Array
    body_quat: Array
    # where things are, ids of MuJoCo
    chassis: int
    wheel_body: NDArray[np.int64]  # (4,)
    travel_joint: NDArray[np.int64]  # (4,)
    travel_qpos: NDArray[np.int64]  # (4,)
    travel_dof: NDArray[np.int64]  # (4,)
    spin_qpos: NDArray[np.int64]  # (4,)
    spin_dof: NDArray[np.int64]  # (4,)
    sensor: NDArray[np.int64]  # (10,) address of each output
    # constants
    dt: float  # step [s]
    wheelbase: float  # [m]
    track: float  # [m]
    steering_ratio: float
    ackermann: float
    drag_area: float  # [m2]
    spin_inertia: Array  # (4,) of each wheel about its axis [kg m2]
    nominal: Array  # (10,) mass, CM and inertia tensor of the unloaded chassis
    side: Array  # (4,) 1 for a tyre as measured, -1 for a mirrored one
    # ours, not MuJoCo's
    tyres: NDArray[np.void]  # (4,) coefficients, `twin.tir.TYRE_DTYPE`
    tyre_state: Array  # (4, 3) deflection along and across [m], last road height [m]
    tyre_output: Array  # (4, 9) see `twin.channels.TYRE_OUTPUTS`
    parameters: Array  # (10,) deltas in force, see `twin.load.PARAMETERS`
    scratch: Array  # (32,)


_views = list(Car._fields)
DATA_VIEWS = tuple(_views[_views.index("qpos") : _views.index("sensordata") + 1])
MODEL_VIEWS = tuple(_views[_views.index("body_mass") : _views.index("body_quat") + 1])
