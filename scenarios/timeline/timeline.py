"""The timeline of a run for the Rerun viewer: estimates beside truth, signals, the car in 3D."""

from __future__ import annotations

import json
import subprocess
import sys
import uuid
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import twin
from estimators.base import Estimate
from estimators.ensemble.staged import Stage, StagedEstimate
from scenarios.timeline import scene as timeline_3d
from scenarios.timeline.plots import (
    BAND_COLOUR,
    MEASURED,
    TRUTH,
    TWIN,
    Line,
    Plot,
    plot_view,
    send_plot,
    thinned,
)
from scenarios.timeline.sideslip import sideslip_plots, trust_lane
from scenarios.timeline.states import Lane, lanes_view, send_lane

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

Array = NDArray[np.float64]

APPLICATION = "twin-in-the-loop"
FRAME_RATE = 30.0  # [Hz] at most
BAND = 0.1  # of the variation, TiL Section 4


def write_timeline(
    path: str | Path,
    *,
    vehicle: twin.Vehicle,
    drive: twin.Drive,
    estimate: Estimate,
    parameters: Sequence[str],
    title: str,
) -> None:
    """Writes a run as an .rrd file with its layout, whole or not at all.

    Args:
        path: the file, ending in .rrd.
        vehicle: what is drawn.
        drive: of N samples; without truth only the twin is shown.
        estimate: an observer's run over that drive.
        parameters: what it estimated, of `twin.PARAMETERS`.
        title: what the viewer calls the recording.

    Raises:
        TwinError: a name is unknown, the arrays do not belong together, or the file cannot be
            written.
    """
    path = Path(path)
    _check(path, drive, estimate, parameters)
    plots = [_parameter_plot(name, drive, estimate) for name in parameters]
    signals = dict.fromkeys([twin.PARAMETER[name].signal for name in parameters] or ["ax"])
    others = [*(_signal_plot(name, drive, estimate) for name in signals), _speed(drive, estimate)]
    plots += sideslip_plots(drive, estimate)
    trust = trust_lane(estimate)
    if isinstance(estimate, StagedEstimate):
        plots.append(_stage(estimate))
    moved = timeline_3d.motion(drive, estimate, frames(drive.time))
    known = any(name in drive.truth for name in twin.STATES)
    scene = timeline_3d.scene("vehicle" if known else "twin", moved)
    model = vehicle.compile()

    with recording_to(
        path, _blueprint(plots, others, scene, trust), title, drive.settings
    ) as recording:
        timeline_3d.log_car(recording, model, moved)
        for plot in (*plots, *others):
            send_plot(recording, drive.time, plot)
        if trust:
            send_lane(recording, drive.time, trust)


@contextmanager
def recording_to(
    path: Path, blueprint: rrb.Blueprint, title: str, settings: Mapping[str, Any]
) -> Iterator[rr.RecordingStream]:
    """Lends a recording that is at the path, whole, once the block has ended well.

    Raises:
        TwinError: the name does not end in .rrd, or the file cannot be written.
    """
    import rerun as rr

    if path.suffix != ".rrd":
        raise twin.TwinError(f"{path}: a timeline's name ends in {path.suffix!r}; allowed: '.rrd'")
    recording = rr.RecordingStream(APPLICATION, recording_id=uuid.uuid4())
    partial = path.with_name(f".{path.stem}.{uuid.uuid4().hex}.rrd")
    try:
        recording.save(partial, default_blueprint=blueprint)
        recording.send_recording_name(title)
        _send_settings(recording, settings)
        yield recording
        recording.flush()
        recording.disconnect()
        _check_whole(partial)
        partial.replace(path)
    except (OSError, RuntimeError) as error:
        reason = str(error).splitlines()[0]
        raise twin.TwinError(f"{path}: cannot be written: {reason}") from error
    finally:
        recording.disconnect()
        partial.unlink(missing_ok=True)


def view(path: str | Path) -> None:
    """Opens a timeline in the Rerun viewer, reachable from this machine only, until it is closed.

    Raises:
        TwinError: the viewer cannot open it.
    """
    command = [sys.executable, "-m", "rerun", str(path), "--bind", "127.0.0.1", "--port", "auto"]
    status = subprocess.run(command, stdout=sys.stderr, check=False).returncode
    if status != 0:
        raise twin.TwinError(
            f"{path}: the Rerun viewer gave up (status {status}); it needs a screen"
        )


def _check(path: Path, drive: twin.Drive, estimate: Estimate, parameters: Sequence[str]) -> None:
    for name in parameters:
        if name not in twin.PARAMETERS:
            allowed = ", ".join(twin.PARAMETERS)
            raise twin.TwinError(f"{path}: parameter {name!r} is unknown; allowed: {allowed}")
    if not np.array_equal(estimate.time, drive.time):
        raise twin.TwinError(
            f"{path}: the estimate has {estimate.time.size} samples, must be those of the drive, "
            f"{len(drive)}"
        )


def _check_whole(path: Path) -> None:
    """Raises OSError if a file lacks its end: Rerun says nothing when the disk fills up there."""
    from rerun.chunk import RrdReader

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the missing footer
            RrdReader(path).store()
    except RuntimeError as error:
        raise OSError("its end is missing; is the disk full?") from error


def frames(time: Array) -> NDArray[np.int64]:
    """Indices of the samples that 3D shows."""
    return thinned(time, FRAME_RATE)


def _parameter_plot(name: str, drive: twin.Drive, estimate: Estimate) -> Plot:
    lines = []
    if name in drive.truth:
        truth = drive.truth[name] - estimate.nominal[twin.PARAMETERS.index(name)]
        band = BAND * np.abs(truth).max()
        lines = [
            Line("upper", f"+{BAND:.0%} of the variation", truth + band, BAND_COLOUR, 1.0),
            Line("lower", f"-{BAND:.0%} of the variation", truth - band, BAND_COLOUR, 1.0),
            Line("truth", "truth", truth, TRUTH, 2.0),
        ]
    lines.append(Line("estimate", "estimate", estimate[name], TWIN, 2.5))
    return Plot(f"parameters/{name}", f"{name}: change from nominal [{unit_of(name)}]", lines)


def unit_of(parameter: str) -> str:
    """The unit of one of `twin.PARAMETERS`."""
    return twin.PARAMETER[parameter].unit.replace("m2", "m²")


def _signal_plot(name: str, drive: twin.Drive, estimate: Estimate) -> Plot:
    lines = []
    if name in drive.output_names:
        lines.append(Line("measured", "measured", drive.channel(name), MEASURED, 1.0))
    if name in drive.truth:
        lines.append(Line("vehicle", "vehicle, without noise", drive.truth[name], TRUTH, 1.2))
    lines.append(Line("twin", "twin", estimate[name], TWIN, 3.0))
    return Plot(f"signals/{name}", f"{name} [{'m/s²' if name[0] == 'a' else 'rad/s'}]", lines)


def _speed(drive: twin.Drive, estimate: Estimate) -> Plot:
    lines = (
        [Line("vehicle", "vehicle", drive.truth["vx"], TRUTH, 1.2)] if "vx" in drive.truth else []
    )
    lines.append(Line("twin", "twin", estimate["vx"], TWIN, 3.0))
    return Plot("speed", "speed, vx [m/s]", lines)


def _stage(estimate: StagedEstimate) -> Plot:
    names = ", ".join(f"{stage.value} {stage.name.lower()}" for stage in Stage)
    line = Line("stage", "stage", estimate.stage.astype(np.float64), TWIN, 2.5)
    return Plot("stage", f"stage: {names}", [line])


def _send_settings(recording: rr.RecordingStream, settings: Mapping[str, Any]) -> None:
    """Numbers and words as they are, lists and tables as JSON; versions under their own name."""
    import rerun as rr

    groups = {"drive": dict(settings)}
    groups["versions"] = groups["drive"].pop("versions", {})
    for group, values in groups.items():
        plain = {
            key: value if isinstance(value, str | int | float) else json.dumps(value)
            for key, value in values.items()
        }
        if plain:
            recording.send_property(group, rr.AnyValues(drop_untyped_nones=True, **plain))


def _blueprint(
    plots: Sequence[Plot], others: Sequence[Plot], scene: rrb.Spatial3DView, trust: Lane | None
) -> rrb.Blueprint:
    import rerun.blueprint as rrb

    small = [*plots, *others[:-1]]
    columns = 1 if len(small) <= 4 else 2
    # Where plots are many, one legend of each kind leaves room for the curves.
    explained = {plot.entity for plot in (small if columns == 1 else [*plots[:1], *others[:1]])}
    views = [plot_view(plot, legend=plot.entity in explained) for plot in small]
    below = [plot_view(others[-1], legend=True)]
    lanes = [lanes_view("trustworthy, or why not", [trust.entity])] if trust else []
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(scene, *below, *lanes, row_shares=[3, 1, 0.6][: 2 + len(lanes)]),
            rrb.Grid(*views, grid_columns=columns),
            column_shares=[3, 2] if columns == 1 else [1, 1],
        ),
        rrb.TimePanel(state="collapsed", timeline="time"),
        collapse_panels=True,
        auto_views=False,
    )
