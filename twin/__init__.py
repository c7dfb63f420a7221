"""The black box: a vehicle in MuJoCo, its tyres, loads, sensors and recorded drives.

What needs MuJoCo and compiled code is imported when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from twin.car.load import PointMass, RigidBody, loaded, parameter_deltas
from twin.channels import (
    ACCELERATIONS,
    ANGULAR_VELOCITY,
    BRAKE_TORQUES,
    CHANNEL,
    DRIVE_TORQUES,
    EXTENDED,
    FURTHER_OUTPUTS,
    IMU,
    INPUTS,
    OUTPUTS,
    POSITION,
    RATES,
    ROAD_HEIGHTS,
    ROTATION,
    SI_UNITS,
    SPINS,
    STATES,
    TORQUES,
    TRAVEL_RATES,
    TRAVELS,
    TYRE,
    TYRE_OUTPUTS,
    VELOCITY,
    WHEEL_ANGLES,
    WHEEL_SPEEDS,
    WHEELS,
    Channel,
    U,
    X,
    Y,
)
from twin.errors import TwinError, TwinWarning
from twin.fmu.names import FmuNames
from twin.logs.drive import Drive
from twin.logs.input_gaps import LONGEST_GAP
from twin.noise import noise_sd, with_noise
from twin.parameters import (
    AXLE_FORCES,
    CENTRE_OF_MASS,
    FORCES,
    INERTIA,
    LOAD,
    PARAMETER,
    PARAMETERS,
    PART_CHANGES,
    PARTS,
    SCALE_FACTORS,
    SCALES,
    P,
    Parameter,
)
from twin.truck.parameters import TruckParameters

if TYPE_CHECKING:
    from twin.car.vehicle import Vehicle
    from twin.commonroad.twin import CommonRoadTwin
    from twin.ensemble import Ensemble
    from twin.fmu.twin import FmuTwin
    from twin.truck.twin import TruckTwin
    from twin.twin import Snapshot, Twin, check_inputs

_COMPILED = {
    "CommonRoadTwin": "twin.commonroad.twin",
    "FmuTwin": "twin.fmu.twin",
    "Ensemble": "twin.ensemble",
    "Snapshot": "twin.twin",
    "TruckTwin": "twin.truck.twin",
    "Twin": "twin.twin",
    "Vehicle": "twin.car.vehicle",
    "check_inputs": "twin.twin",
}

__all__ = [
    "ACCELERATIONS",
    "ANGULAR_VELOCITY",
    "AXLE_FORCES",
    "BRAKE_TORQUES",
    "CENTRE_OF_MASS",
    "CHANNEL",
    "DRIVE_TORQUES",
    "EXTENDED",
    "FORCES",
    "FURTHER_OUTPUTS",
    "IMU",
    "INERTIA",
    "INPUTS",
    "LOAD",
    "LONGEST_GAP",
    "OUTPUTS",
    "PARAMETER",
    "PARAMETERS",
    "PARTS",
    "PART_CHANGES",
    "POSITION",
    "RATES",
    "ROAD_HEIGHTS",
    "ROTATION",
    "SCALES",
    "SCALE_FACTORS",
    "SI_UNITS",
    "SPINS",
    "STATES",
    "TORQUES",
    "TRAVELS",
    "TRAVEL_RATES",
    "TYRE",
    "TYRE_OUTPUTS",
    "VELOCITY",
    "WHEELS",
    "WHEEL_ANGLES",
    "WHEEL_SPEEDS",
    "Channel",
    "CommonRoadTwin",
    "Drive",
    "Ensemble",
    "FmuNames",
    "FmuTwin",
    "P",
    "Parameter",
    "PointMass",
    "RigidBody",
    "Snapshot",
    "TruckParameters",
    "TruckTwin",
    "Twin",
    "TwinError",
    "TwinWarning",
    "U",
    "Vehicle",
    "X",
    "Y",
    "check_inputs",
    "loaded",
    "noise_sd",
    "parameter_deltas",
    "with_noise",
]


def __getattr__(name: str) -> Any:
    """Imports a name of `_COMPILED` (PEP 562)."""
    if name not in _COMPILED:
        raise AttributeError(f"module 'twin' has no attribute {name!r}")
    return getattr(import_module(_COMPILED[name]), name)
