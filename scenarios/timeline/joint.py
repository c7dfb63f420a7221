"""The timeline of the joint observer: every estimate in its band, what is known when, the load."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import twin
from estimators.joint.observer import JointEstimate
from estimators.joint.sensor_errors import SENSOR_ERROR
from scenarios.timeline import scene as timeline_3d
from scenarios.timeline import timeline as tl
from scenarios.timeline.inertia import log_inertia
from scenarios.timeline.plots import PLOT_RATE
from scenarios.timeline.states import Colour, Lane, lanes_view, send_lane

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

Array = NDArray[np.float64]

SIGMAS = 2.0  # half width of the band
MARGIN = 0.4  # of the prior's sd, shown beyond truth and estimate: chosen
_BAND: Colour = (70, 120, 160)
_CHANGE: Colour = (235, 90, 160)
_UNKNOWN, _KNOWN = (75, 80, 90), (60, 140, 100)
CHANGES = "changes of the load"
SUBJECT = "inertia as a uniform ellipsoid, estimate orange, truth green"
_TABS = {"load": "load", "model": "tyres and springs", "sensors": "sensors"}


def write_joint_timeline(
    path: Path,
    *,
    vehicle: twin.Vehicle,
    drive: twin.Drive,
    estimate: JointEstimate,
    faults: Mapping[str, float],
    title: str,
) -> None:
    """Writes a run of the joint observer as an .rrd file with its layout, whole or not at all.

    Args:
        path: the file, ending in .rrd.
        vehicle: what is drawn.
        drive: of N samples; what its truth lacks is shown without it.
        estimate: over that drive.
        faults: of the real sensors, by name of `SENSOR_ERRORS`; others are not known.
        title: what the viewer calls the recording.

    Raises:
        TwinError: the file cannot be written.
    """
    truth = {name: _truth(name, drive, estimate, faults) for name in estimate.estimated}
    lanes = _lanes(estimate)
    shown = tl.frames(drive.time)
    moved = timeline_3d.motion(drive, estimate, shown)
    blueprint = _blueprint(estimate, truth, lanes, timeline_3d.scene(SUBJECT, moved))
    with tl.recording_to(path, blueprint, title, drive.settings) as recording:
        timeline_3d.log_car(recording, vehicle.compile(), moved, opacity=0.2)
        log_inertia(recording, drive, estimate, shown)
        for name in estimate.estimated:
            _send_plot(recording, drive.time, name, estimate, truth[name])
        for lane in lanes.values():
            send_lane(recording, drive.time, lane)


def _values(i: int, estimate: JointEstimate) -> Array:
    """(N,) of the i-th of all that is estimated."""
    return estimate[estimate.estimated[i]]


def _truth(
    name: str, drive: twin.Drive, estimate: JointEstimate, faults: Mapping[str, float]
) -> Array | None:
    """(N,) what an estimate should be; None: unknown."""
    if name in faults:
        return np.full(len(drive), faults[name])
    if name in drive.truth:
        return drive.truth[name] - estimate.nominal[twin.PARAMETERS.index(name)]
    return None


def _send_plot(
    recording: rr.RecordingStream,
    time: Array,
    name: str,
    estimate: JointEstimate,
    truth: Array | None,
) -> None:
    """Logs an estimate and its band, changes of the load on it, and the truth where it changes.

    Estimate and band are one entity: a row of an entity costs more than the number that it holds.
    """
    import rerun as rr

    i = estimate.estimated.index(name)
    samples = tl.thinned(time, PLOT_RATE)
    values, sd = _values(i, estimate)[samples], estimate.sd[samples, i]
    banded = values[:, None] + SIGMAS * np.outer(sd, (1.0, -1.0, 0.0))
    found = np.diff(estimate.changes[samples], prepend=0) > 0
    entity = f"{_group(name)}/{name}"
    styles = {
        "estimate": rr.SeriesLines(
            names=[f"within {SIGMAS:g} sd", f"within {SIGMAS:g} sd", "estimate"],
            colors=[_BAND, _BAND, tl.TWIN],
            widths=[1.5, 1.5, 2.5],
        ),
        "truth": rr.SeriesLines(
            names="truth",
            colors=tl.TRUTH,
            widths=1.5,
            # Its few corners are not to be averaged
            aggregation_policy=rr.components.AggregationPolicy.Off,
        ),
        "change": rr.SeriesPoints(
            names="change of load found", colors=_CHANGE, markers="diamond", marker_sizes=5.0
        ),
    }
    columns = {"estimate": (time[samples], banded)}
    if truth is not None:
        corners = _corners(truth)
        columns["truth"] = (time[corners], truth[corners, None])
    if found.any():
        columns["change"] = (time[samples[found]], values[found, None])
    for part, (when, what) in columns.items():
        recording.log(f"{entity}/{part}", styles[part], static=True)
        index = [rr.TimeColumn("time", duration=when)]
        scalars = rr.Scalars.columns(scalars=what.ravel())
        recording.send_columns(
            f"{entity}/{part}", index, scalars.partition(np.full(len(what), what.shape[1]))
        )


def _corners(values: Array) -> NDArray[np.int64]:
    """Indices of the samples beside each change, of the first and of the last."""
    steps = np.flatnonzero(np.diff(values))
    ends = np.array([0, values.size - 1])
    return np.unique(np.concatenate([ends, steps, steps + 1]))


def _group(name: str) -> str:
    if name in twin.PARAMETERS:
        return "load" if name in twin.LOAD else "model"
    return "sensors"


def _unit(name: str) -> str:
    if name in twin.PARAMETERS:
        return tl.unit_of(name)
    return SENSOR_ERROR[name].unit.replace("2", "²")


def _lanes(estimate: JointEstimate) -> dict[str, Lane]:
    """Of each estimate whether it is known, and of the load how often it has changed."""
    loads = {f"load {k + 1}": _CHANGE for k in range(int(estimate.changes.max()) + 1)}
    lanes = {CHANGES: Lane("known/changes_of_load", estimate.changes, loads | {"load 1": _UNKNOWN})}
    states = {"not known": _UNKNOWN, "known": _KNOWN}
    for name, valid in zip(estimate.estimated, estimate.valid.T, strict=True):
        lanes[name] = Lane(f"known/{name}", valid.astype(np.int64), states)
    return lanes


def _range(name: str, estimate: JointEstimate, truth: Array | None) -> tuple[float, float]:
    """What the vertical axis shows: all but the band while nothing is known yet."""
    i = estimate.estimated.index(name)
    shown = np.concatenate([_values(i, estimate), () if truth is None else truth])
    margin = MARGIN * estimate.prior[i]
    return float(shown.min()) - margin, float(shown.max()) + margin


def _blueprint(
    estimate: JointEstimate,
    truth: Mapping[str, Array | None],
    lanes: Mapping[str, Lane],
    scene: rrb.Spatial3DView,
) -> rrb.Blueprint:
    import rerun.blueprint as rrb

    plots, known = [], []
    for group, title in _TABS.items():
        names = [name for name in estimate.estimated if _group(name) == group]
        if not names:
            continue
        views = [
            tl.plot_view(
                tl.Plot(f"{group}/{name}", f"{name} [{_unit(name)}]", []),
                legend=name == names[0],
                limits=_range(name, estimate, truth[name]),
            )
            for name in names
        ]
        plots.append(rrb.Grid(*views, grid_columns=2, name=title))
        shown = [lanes[name].entity for name in names]
        if group == "load":
            shown.insert(0, lanes[CHANGES].entity)
        known.append(lanes_view(f"known: {title}", shown))
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(scene, rrb.Tabs(*known, active_tab=0), row_shares=[5, 4]),
            rrb.Tabs(*plots, active_tab=0),
        ),
        rrb.TimePanel(state="collapsed", timeline="time"),
        collapse_panels=True,
        auto_views=False,
    )
