"""The black box: a vehicle in MuJoCo, its tyres, loads, sensors and recorded drives."""

from twin.channels import INPUTS, OUTPUTS, STATES, TYRE_OUTPUTS, WHEELS
from twin.drive import Drive
from twin.errors import TwinError
from twin.load import PARAMETERS, PointMass, RigidBody, loaded, parameter_deltas
from twin.noise import noise_sd, with_noise
from twin.twin import Snapshot, Twin, check_inputs
from twin.vehicle import Vehicle

__all__ = [
    "INPUTS",
    "OUTPUTS",
    "PARAMETERS",
    "STATES",
    "TYRE_OUTPUTS",
    "WHEELS",
    "Drive",
    "PointMass",
    "RigidBody",
    "Snapshot",
    "Twin",
    "TwinError",
    "Vehicle",
    "check_inputs",
    "loaded",
    "noise_sd",
    "parameter_deltas",
    "with_noise",
]
