"""What a drive gives to an observer: inputs and measurements in its twin's order."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.black_box import BlackBox
from estimators.speed_follower import TORQUES, SpeedFollower
from twin import Drive, Twin, TwinError

Array = NDArray[np.float64]


class DriveChannels(NamedTuple):
    """What a drive gives to the observer of a twin."""

    inputs: Array  # (N, nu), torques zero where the twin is to follow the speed
    measurements: Array  # (N, ny)
    speed: Array  # (N,) to follow [m/s]; (0,) where the drive has torques


def given_by(drive: Drive, twin: BlackBox, follower: SpeedFollower | None) -> DriveChannels:
    """Inputs and measurements in the twin's order.

    Raises:
        TwinError: the drive has others than the twin needs, or another sample time.
    """
    if abs(drive.dt - twin.dt) > 1e-9:
        raise TwinError(f"drive: has samples every {drive.dt} s, the twin steps {twin.dt} s")
    ny = len(twin.outputs)
    torqueless = tuple(name for name in twin.inputs if name not in TORQUES)
    has = (*drive.input_names, *drive.output_names)
    if drive.output_names[:ny] != twin.outputs or drive.input_names not in (
        twin.inputs,
        torqueless,
    ):
        needed = (*twin.inputs, *twin.outputs)
        raise TwinError(f"drive: has channels {has}, the twin needs {needed} in this order")
    measurements = np.ascontiguousarray(drive.measurements[:, :ny])
    if drive.input_names == twin.inputs:
        return DriveChannels(drive.inputs, measurements, np.empty(0))
    if follower is None or not isinstance(twin, Twin) or "vx" not in drive.output_names:
        raise TwinError(
            "drive: has no torques; allowed: with a measured vx, a `Twin` and a speed follower"
        )
    speed = np.ascontiguousarray(drive.channel("vx"))
    if not np.isfinite(speed).all():
        raise TwinError(
            f"drive: vx is {speed[~np.isfinite(speed)][0]} in sample "
            f"{np.argmin(np.isfinite(speed))}; allowed: finite numbers, for a twin that follows it"
        )
    inputs = np.zeros((len(drive), len(twin.inputs)))
    inputs[:, [twin.inputs.index(name) for name in torqueless]] = drive.inputs
    return DriveChannels(inputs, measurements, speed)


def check_measurements(y: Array, names: tuple[str, ...], what: str, *, infinite: bool) -> None:
    """Refuses measurements (n, ny) of another shape, and infinite ones unless they are allowed.

    Raises:
        TwinError: as said.
    """
    if y.shape[1:] != (len(names),):
        raise TwinError(f"{what}: measurements have shape {y.shape}; allowed: (n, {len(names)})")
    if np.isinf(y).any() and not infinite:
        row, column = np.argwhere(np.isinf(y))[0]
        raise TwinError(
            f"{what}: {names[column]} is {y[row, column]} in sample {row}; allowed: finite "
            "numbers, and NaN where there is no measurement"
        )
