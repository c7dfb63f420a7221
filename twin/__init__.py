"""The black box: a vehicle in MuJoCo, its tyres, loads, sensors and recorded drives.

What needs MuJoCo and compiled code is imported when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from twin.channels import (
    EXTENDED,
    FORCES,
    FURTHER_OUTPUTS,
    INPUTS,
    LOAD,
    OUTPUTS,
    PARAMETERS,
    SCALES,
    STATES,
    TYRE_OUTPUTS,
    WHEELS,
)
from twin.drive import Drive
from twin.errors import TwinError
from twin.fmu_names import FmuNames
from twin.load import PointMass, RigidBody, loaded, parameter_deltas
from twin.noise import noise_sd, with_noise
from twin.truck_parameters import TruckParameters

if TYPE_CHECKING:
    from twin.commonroad_twin import CommonRoadTwin
    from twin.fleet import Fleet
    from twin.fmu_twin import FmuTwin
    from twin.truck_twin import TruckTwin
    from twin.twin import Snapshot, Twin, check_inputs
    from twin.vehicle import Vehicle

_COMPILED = {
    "CommonRoadTwin": "twin.commonroad_twin",
    "FmuTwin": "twin.fmu_twin",
    "Fleet": "twin.fleet",
    "Snapshot": "twin.twin",
    "TruckTwin": "twin.truck_twin",
    "Twin": "twin.twin",
    "Vehicle": "twin.vehicle",
    "check_inputs": "twin.twin",
}

__all__ = [
    "EXTENDED",
    "FORCES",
    "FURTHER_OUTPUTS",
    "INPUTS",
    "LOAD",
    "OUTPUTS",
    "PARAMETERS",
    "SCALES",
    "STATES",
    "TYRE_OUTPUTS",
    "WHEELS",
    "CommonRoadTwin",
    "Drive",
    "Fleet",
    "FmuNames",
    "FmuTwin",
    "PointMass",
    "RigidBody",
    "Snapshot",
    "TruckParameters",
    "TruckTwin",
    "Twin",
    "TwinError",
    "Vehicle",
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
