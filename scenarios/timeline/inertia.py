"""A body as the uniform ellipsoid of its mass and inertia, drawn in the car of a timeline."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

import twin
from estimators.base import Estimate
from scenarios.timeline.scene import WORLD
from scenarios.timeline.timeline import TRUTH, TWIN

if TYPE_CHECKING:
    import rerun as rr

Array = NDArray[np.float64]

# Chosen [m]: where both coincide the truth is a thin line within the estimate's broad one
LINE_RADIUS = {"estimate": 0.02, "truth": 0.01}
ARROW = 1.5  # [m]: out of the roof


def uniform_ellipsoid(parameters: Array) -> tuple[Array, Array]:
    """The ellipsoid of uniform density that has a mass and an inertia.

    Its principal moments are J_a = M (b^2 + c^2) / 5 and so on, hence
    a^2 = 5 / (2 M) (J_b + J_c - J_a); a body that no mass can make has an axis of zero.

    Args:
        parameters: (n, 10) mass [kg], CM [m] and inertia about it [kg m2], as `twin.LOAD`.

    Returns:
        (n, 3) semi-axes [m], and (n, 4) quaternions w x y z of their directions.
    """
    mass, (xx, yy, zz, xy, xz, yz) = parameters[:, 0], parameters[:, 4:].T
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    moments, directions = np.linalg.eigh(inertia)
    directions[:, :, 2] *= np.linalg.det(directions)[:, None]  # right-handed
    squares = 2.5 / mass[:, None] * (moments.sum(axis=1, keepdims=True) - 2.0 * moments)
    quaternions = np.empty((len(mass), 4))
    for quaternion, matrix in zip(quaternions, directions, strict=True):
        mujoco.mju_mat2Quat(quaternion, matrix.ravel())
    return np.sqrt(np.maximum(squares, 0.0)), quaternions


def log_inertia(
    recording: rr.RecordingStream,
    drive: twin.Drive,
    estimate: Estimate,
    frames: NDArray[np.int64],
) -> None:
    """Logs the chassis with its load as an ellipsoid with its CM: the estimate, and the truth.

    Args:
        recording: with the car's bodies.
        drive: whose truth is shown, where it has all of the load.
        estimate: of the load.
        frames: samples that are shown.
    """
    load = slice(len(twin.LOAD))
    estimated = estimate.nominal[load] + estimate.parameters[frames, load]
    _log(recording, "estimate", drive.time[frames], estimated, TWIN)
    if set(twin.LOAD) <= set(drive.truth):
        true = np.column_stack([drive.truth[name][frames] for name in twin.LOAD])
        _log(recording, "truth", drive.time[frames], true, TRUTH)


def _log(
    recording: rr.RecordingStream,
    name: str,
    time: Array,
    parameters: Array,
    colour: tuple[int, int, int],
) -> None:
    import rerun as rr

    entity = f"{WORLD}/chassis/inertia/{name}"
    style = rr.Ellipsoids3D.from_fields(
        colors=colour, fill_mode="majorwireframe", line_radii=LINE_RADIUS[name]
    )
    recording.log(entity, style, static=True)
    index = [rr.TimeColumn("time", duration=time)]
    axes, quaternions = uniform_ellipsoid(parameters)
    centres = parameters[:, 1:4]
    shape = rr.Ellipsoids3D.columns(
        half_sizes=axes, centers=centres, quaternions=quaternions[:, [1, 2, 3, 0]]
    )
    recording.send_columns(entity, index, shape)
    _log_cm(recording, entity, index, centres, colour, LINE_RADIUS[name])


def _log_cm(
    recording: rr.RecordingStream,
    entity: str,
    index: list[rr.TimeColumn],
    centres: Array,
    colour: tuple[int, int, int],
    radius: float,
) -> None:
    """Logs an arrow from above the roof, which hides the CM, down to it."""
    import rerun as rr

    arrow = rr.Arrows3D.from_fields(colors=colour, radii=radius)
    recording.log(f"{entity}/cm", arrow, static=True)
    down = np.tile([0.0, 0.0, -ARROW], (len(centres), 1))
    columns = rr.Arrows3D.columns(vectors=down, origins=centres - down)
    recording.send_columns(f"{entity}/cm", index, columns)
