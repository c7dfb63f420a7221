"""What tells one vehicle from another: a hash of all that decides its motion and its observers."""

import hashlib
import json

import mujoco
import numpy as np

from twin.car.vehicle import Vehicle


def fingerprint(vehicle: Vehicle) -> str:
    """SHA-256 of the compiled model, the tyres and the calibration, in hexadecimal.

    Raises:
        TwinError: the vehicle's files are missing or broken.
    """
    model = vehicle.compile()
    content = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, content)
    further = json.dumps(vehicle.calibration).encode() if vehicle.calibration else b""
    return hashlib.sha256(content.tobytes() + vehicle.tyres().tobytes() + further).hexdigest()
