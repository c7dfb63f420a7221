"""The timeline of the truck for the Rerun viewer: its load, its velocities, the truck in 3D."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

import models
from estimators.base import Estimate
from scenarios.experiment.truck import NOMINAL, UNITS
from scenarios.timeline import scene as timeline_3d
from scenarios.timeline import timeline as tl
from twin import Drive
from twin.truck.model import RATES
from twin.truck.parameters import TruckParameters
from twin.truck.twin import TRUCK_PARAMETERS, TRUCK_STATES

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

Array = NDArray[np.float64]

SIGMAS = 2.0  # half width of the band
_SECOND = (120, 165, 235)  # colour of another estimate
_ROAD_COLOUR = (95, 98, 104)
_SHOULDER = 0.4  # [m] of road beside the outermost wheel tracks
_EYE = (-9.5, -8.5, 4.0)  # from the truck [m]


def write_truck_timeline(
    path: Path, *, drive: Drive, estimates: Mapping[str, Estimate], title: str
) -> None:
    """Writes a drive of the truck as an .rrd file with its layout, whole or not at all.

    Args:
        path: the file, ending in .rrd.
        drive: with its truth.
        estimates: by name, one or two over that drive; the first is shown with its band.
        title: what the viewer calls the recording.

    Raises:
        TwinError: the file cannot be written.
    """
    nominal = TruckParameters().nominal.parameters
    load = [_parameter_plot(name, drive, estimates) for name in TRUCK_PARAMETERS]
    rates = [_rate_plot(i, name, drive, estimates) for i, name in enumerate(RATES)]
    scene = timeline_3d.view_of("truck", np.array(_EYE), np.array((0.0, 0.0, 1.2)))
    limits = [(0.0, 2.5 * value) for value in nominal]
    with tl.recording_to(path, _blueprint(load, limits, rates, scene), title, drive.settings) as to:
        _log_truck(to, drive, tl.frames(drive.time))
        _log_road(to, drive)
        for plot in (*load, *rates):
            tl.send_plot(to, drive.time, plot)


def _parameter_plot(name: str, drive: Drive, estimates: Mapping[str, Estimate]) -> tl.Plot:
    """Truth, the first estimate in its band, the second."""
    (first, found), *others = estimates.items()
    nominal = NOMINAL[name]
    values, band = nominal + found[name], SIGMAS * found.sd_of(name)
    lines = [
        tl.Line("upper", f"+{SIGMAS:g} standard deviations", values + band, tl.BAND_COLOUR, 1.0),
        tl.Line("lower", f"-{SIGMAS:g} standard deviations", values - band, tl.BAND_COLOUR, 1.0),
        tl.Line(first, first, values, tl.TWIN, 2.5),
        *(tl.Line(other, other, nominal + e[name], _SECOND, 1.5) for other, e in others),
        tl.Line("truth", "truth", drive.truth[name], tl.TRUTH, 2.0),
    ]
    return tl.Plot(f"parameters/{name}", f"{name} [{UNITS[name]}]", lines)


def _rate_plot(i: int, name: str, drive: Drive, estimates: Mapping[str, Estimate]) -> tl.Plot:
    first, found = next(iter(estimates.items()))
    lines = [
        tl.Line("measured", "measured", drive.channel(name), tl.MEASURED, 1.0),
        tl.Line(first, first, found.outputs[:, i], tl.TWIN, 3.0),
        tl.Line("truth", "truth", drive.truth[name], tl.TRUTH, 1.2),
    ]
    return tl.Plot(f"rates/{name}", f"{name} [{UNITS[name]}]", lines)


def _log_truck(recording: rr.RecordingStream, drive: Drive, frames: NDArray[np.int64]) -> None:
    """Logs the truck's shapes and poses; it stands x further on than its model."""
    import rerun as rr

    model = mujoco.MjModel.from_xml_path(str(models.path("truck")))
    data = mujoco.MjData(model)
    joints = np.column_stack([drive.truth[name][frames] for name in TRUCK_STATES[: model.nq]])
    positions = np.empty((frames.size, model.nbody, 3))
    quaternions = np.empty((frames.size, model.nbody, 4))
    for k, qpos in enumerate(joints):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        positions[k], quaternions[k] = data.xpos, data.xquat
    positions[..., 0] += drive.truth["x"][frames][:, None]
    index = [rr.TimeColumn("time", duration=drive.time[frames])]
    timeline_3d.log_bodies(recording, model, index, positions, quaternions)


def _log_road(recording: rr.RecordingStream, drive: Drive) -> None:
    """Logs the road as a surface through the heights of its two tracks, to scale."""
    import rerun as rr

    left, right, x = _tracks(drive)
    half = max(TruckParameters().half_track)
    slope = (left - right) / (2.0 * half)
    edges = [
        np.column_stack([x, np.full_like(x, side), 0.5 * (left + right) + slope * side])
        for side in (half + _SHOULDER, -half - _SHOULDER)
    ]
    vertices = np.stack(edges, axis=1).reshape(-1, 3)
    corner = 2 * np.arange(x.size - 1)[:, None, None]
    triangles = (corner + np.array([[0, 1, 2], [2, 1, 3]])).reshape(-1, 3)
    surface = rr.Mesh3D(
        vertex_positions=vertices,
        triangle_indices=triangles,
        vertex_normals=np.tile([0.0, 0.0, 1.0], (len(vertices), 1)),
        vertex_colors=np.repeat(_shades(x), 2, axis=0),
    )
    recording.log(f"{timeline_3d.WORLD}/road", surface, static=True)


def _tracks(drive: Drive) -> tuple[Array, Array, Array]:
    """Heights of the left and right track over the way x [m], where any wheel has been."""
    front, rear = TruckParameters().axle_distance
    x = drive.truth["x"]
    behind = x - rear < x[0] + front
    fl, fr, rl, rr = (drive.channel(name) for name in drive.input_names)
    return (
        np.concatenate([rl[behind], fl]),
        np.concatenate([rr[behind], fr]),
        np.concatenate([x[behind] - rear, x + front]),
    )


def _shades(x: Array) -> NDArray[np.uint8]:
    """Colours (n, 3) of the road, a darker band every other metre, so that its motion is seen."""
    dark = (np.floor(x) % 2.0)[:, None]
    return (np.array(_ROAD_COLOUR) * (1.0 - 0.15 * dark)).astype(np.uint8)


def _blueprint(
    load: list[tl.Plot],
    limits: list[tuple[float, float]],
    rates: list[tl.Plot],
    scene: rrb.Spatial3DView,
) -> rrb.Blueprint:
    import rerun.blueprint as rrb

    views = [
        tl.plot_view(plot, legend=plot is load[0], left=True, limits=limit)
        for plot, limit in zip(load, limits, strict=True)
    ]
    below = [tl.plot_view(plot, legend=plot is rates[0]) for plot in rates]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(scene, rrb.Horizontal(*below), row_shares=[2, 1]),
            rrb.Vertical(*views),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline="time"),
        collapse_panels=True,
        auto_views=False,
    )
