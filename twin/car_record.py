"""What compiled code sees of a car, in one record: addresses, ids, constants and tyre states."""

import numpy as np
from numba import from_dtype
from numpy.typing import NDArray

from twin.channels import OUTPUTS, TYRE_OUTPUTS, WHEELS
from twin.parameters import PARAMETERS
from twin.scales import AXLES, MOST_FACTORS
from twin.tyre.record import TYRE_DTYPE

# Arrays of MjData (state, kinematics, sensors) and MjModel (inertia, steering), by MuJoCo's names;
# the record holds their addresses.
DATA_VIEWS = (
    *("qpos", "qvel", "xpos", "xmat", "xaxis", "cvel", "subtree_com"),
    *("qfrc_applied", "sensordata"),
)
MODEL_VIEWS = (
    *("body_mass", "body_ipos", "body_inertia", "body_iquat", "body_subtreemass", "body_quat"),
    *("jnt_axis", "dof_damping"),
)
_PER_WHEEL = (len(WHEELS),)

CAR_DTYPE = np.dtype(
    [
        *((name, np.int64) for name in ("model", "data", *DATA_VIEWS, *MODEL_VIEWS)),
        # where things are, ids of MuJoCo
        ("chassis", np.int64),
        ("wheel", np.int64, _PER_WHEEL),  # 0 to 3
        ("wheel_body", np.int64, _PER_WHEEL),
        ("hub_body", np.int64, _PER_WHEEL),
        ("travel_joint", np.int64, _PER_WHEEL),
        ("travel_qpos", np.int64, _PER_WHEEL),
        ("travel_dof", np.int64, _PER_WHEEL),
        ("spin_qpos", np.int64, _PER_WHEEL),
        ("spin_dof", np.int64, _PER_WHEEL),
        ("sensor", np.int64, (len(OUTPUTS),)),  # address of each output
        # constants
        ("dt", np.float64),  # step [s]
        ("wheelbase", np.float64),  # [m]
        ("track", np.float64),  # [m]
        ("steering_ratio", np.float64),
        ("ackermann", np.float64),
        ("drag_area", np.float64),  # [m2]
        ("drive_share", np.float64, _PER_WHEEL),  # of the drive torque, what reaches each wheel
        ("brake_share", np.float64, _PER_WHEEL),
        *((f"lift_area_{axle}", np.float64) for axle in AXLES),  # [m2], positive pushes down
        ("axle", np.float64, (len(AXLES),)),  # x of its hubs in the chassis frame [m]
        ("spin_inertia", np.float64, _PER_WHEEL),  # of each wheel about its axis [kg m2]
        ("nominal", np.float64, (len(PARAMETERS),)),  # the unloaded chassis; 1 for a scale
        # of each number that parameters scale: address, as the files have it, index in `p`, and
        # whether the parameter divides it; see `twin.scale_setter`
        ("factors", np.int64),
        ("factor_address", np.int64, (MOST_FACTORS,)),
        ("factor_nominal", np.float64, (MOST_FACTORS,)),
        ("factor_parameter", np.int64, (MOST_FACTORS,)),
        ("factor_divides", np.int64, (MOST_FACTORS,)),
        ("damping", np.float64, _PER_WHEEL),  # [N s/m], of bump and rebound the mean
        # as the files have it, see `twin.parts`: masses of hub and wheel, the wheel's moments
        ("nominal_unsprung", np.float64, (5, *_PER_WHEEL)),
        ("nominal_axis", np.float64, (*_PER_WHEEL, 3)),  # of each travel
        ("nominal_lift_area", np.float64, (len(AXLES),)),  # [m2]
        ("nominal_other_mass", np.float64, (2,)),
        ("compiled_inertia", np.float64, (7,)),  # principal moments, and their axes' quaternion
        ("other_mass", np.float64, (2,)),  # of the world's and the chassis' trees, without chassis
        ("side", np.float64, _PER_WHEEL),  # 1 for a tyre as measured, -1 for a mirrored one
        (
            "tyres",
            np.float64,
            (len(TYRE_DTYPE.names or ()), *_PER_WHEEL),
        ),  # see `twin.tyre.four_tyres`
        # ours, not MuJoCo's
        ("tyre_state", np.float64, (*_PER_WHEEL, 3)),  # see `twin.tyre.contact`
        ("tyre_output", np.float64, (*_PER_WHEEL, len(TYRE_OUTPUTS))),
        # hand wheel and torques, smoothed: what makes their delay; NaN before the first sample
        ("input_state", np.float64, (1 + 2 * len(WHEELS),)),
        ("inputs", np.float64, (1 + 2 * len(WHEELS),)),  # hand wheel and torques as they act
        ("front_force", np.float64, (2,)),  # lateral, of the step before [N]
        ("parameters", np.float64, (len(PARAMETERS),)),  # deltas in force
        # room to find the principal axes of the chassis
        ("tensor", np.float64, (3, 3)),
        ("vectors", np.float64, (3, 3)),
        ("moments", np.float64, (3,)),
    ],
    align=True,
)
"""A simulated car as `twin.kernel` sees it; the `Twin` that made it owns what it points to."""

Car = np.record
CAR = from_dtype(CAR_DTYPE)  # its type in compiled code


def new_cars(size: int) -> NDArray[np.void]:
    """(size,) records of zeros."""
    return np.zeros(size, np.dtype((np.record, CAR_DTYPE)))
