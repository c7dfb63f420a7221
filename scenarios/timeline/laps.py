"""The timeline of laps and lane changes: sideslip and mass of several observers, the car, a ghost.

The ghost is the twin. Nobody tells it where on the track it is, so that it is drawn where the
vehicle is and moves where the vehicle moves; how it stands to that, its sideslip, and how it leans
are its own.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from estimators.base import Estimate
from estimators.til import state_and_mass
from scenarios.experiment.experiment import Trial
from scenarios.experiment.metrics import mass_error
from scenarios.timeline import scene as timeline_3d
from scenarios.timeline.scene import Motion
from scenarios.timeline.states import Colour, Lane, lanes_view, send_lane
from scenarios.timeline.timeline import (
    BAND_COLOUR,
    MEASURED,
    TRUTH,
    TWIN,
    Line,
    Plot,
    frames,
    plot_view,
    recording_to,
    send_plot,
)
from twin import STATES, Drive, Vehicle

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

Array = NDArray[np.float64]

COLOURS = {"til": TWIN, "double-track": (90, 150, 230)}
_CLOSED: Colour = (75, 80, 90)
MAP = "map"
MAP_MARGIN = 40.0  # [m] around the way: chosen
CORRECTED = "mass is corrected"
YAW, VX, VY = STATES.index("yaw"), STATES.index("vx"), STATES.index("vy")


def write(path: Path, trials: Sequence[Trial], vehicle: Vehicle, title: str) -> None:
    """Writes trials on one drive as an .rrd file, whole or not at all.

    Args:
        path: the file.
        trials: of estimators of `COLOURS`, the default observer first.
        vehicle: the real one, which is drawn.
        title: what the viewer calls the recording.

    Raises:
        TwinError: the file cannot be written.
    """
    drive, estimate = trials[0].drive, trials[0].estimate
    plots = _plots(trials)
    lanes = _lanes(drive, estimate)
    moved = timeline_3d.motion(drive, estimate, frames(drive.time))
    model = vehicle.compile()
    with recording_to(path, _blueprint(plots, lanes, moved), title, drive.settings) as recording:
        import rerun as rr

        timeline_3d.log_car(recording, model, moved)
        ghost = timeline_3d.poses(model, _ghost(moved, estimate, frames(drive.time)))
        timeline_3d.log_bodies(
            recording,
            model,
            [rr.TimeColumn("time", duration=moved.time)],
            ghost.positions,
            ghost.quaternions,
            root=f"{timeline_3d.WORLD}/twin",
            outlines=TWIN,
        )
        _log_map(recording, moved)
        for plot in plots:
            send_plot(recording, drive.time, plot)
        for lane in lanes:
            send_lane(recording, drive.time, lane)


def gates(drive: Drive, estimate: Estimate) -> dict[str, Array]:
    """Of each gate of the mass law whether it is open, 1 or 0."""
    turning = np.abs(drive.channel("yaw_rate")) <= state_and_mass.LARGEST_YAW_RATE
    pushing = np.abs(estimate["ax"]) >= state_and_mass.LEAST_ACCELERATION
    return {
        "straight ahead": turning.astype(np.float64),
        "speeding up or braking": pushing.astype(np.float64),
        CORRECTED: (turning & pushing).astype(np.float64),
    }


def _ghost(moved: Motion, estimate: Estimate, shown: NDArray[np.int64]) -> Motion:
    """The twin where the vehicle is, moving in its direction."""
    states = estimate.states[shown].copy()
    own = np.arctan2(states[:, VY], states[:, VX])
    real = np.arctan2(moved.states[:, VY], moved.states[:, VX])
    states[:, :2] = moved.states[:, :2]
    states[:, YAW] = moved.states[:, YAW] + real - own
    return moved._replace(states=states, forces=None)


def _lanes(drive: Drive, estimate: Estimate) -> list[Lane]:
    return [
        Lane(
            f"gates/{name.replace(' ', '_')}",
            values.astype(np.int64),
            {"closed": _CLOSED, "open": TWIN if name == CORRECTED else BAND_COLOUR},
        )
        for name, values in gates(drive, estimate).items()
    ]


def _plots(trials: Sequence[Trial]) -> list[Plot]:
    """Sideslip, its error, the error of the mass and the speed."""
    drive = trials[0].drive
    truth = np.degrees(drive.truth["sideslip"])

    def lines(values: Callable[[Trial], Array], true: Array) -> list[Line]:
        found = [
            Line(name.replace("-", "_"), name, values(trial), COLOURS[name], 2.5)
            for trial in trials
            for name in (trial.run.estimator,)
        ]
        return [*found, Line("truth", "truth", true, TRUTH, 1.2)]

    def sideslip(trial: Trial) -> Array:
        return np.degrees(trial.estimate.sideslip)

    zero = np.zeros(len(drive))
    return [
        Plot("sideslip", "sideslip [deg]", lines(sideslip, truth)),
        Plot(
            "sideslip_error",
            "error of the sideslip [deg]",
            lines(lambda trial: sideslip(trial) - truth, zero),
        ),
        Plot("mass", "error of the mass [kg]", lines(mass_error, zero)),
        Plot(
            "speed",
            "speed [km/h]",
            [Line("vehicle", "vehicle", 3.6 * drive.truth["vx"], TRUTH, 1.2)],
        ),
    ]


def _log_map(recording: "rr.RecordingStream", moved: Motion) -> None:
    """Logs the way and where on it the car is, seen from above; a picture's y points down."""
    import rerun as rr

    way = moved.states[:, :2] * (1.0, -1.0)
    line = rr.LineStrips2D([way], colors=MEASURED, radii=rr.Radius.ui_points(1.5))
    recording.log(f"{MAP}/way", line, static=True)
    dot = rr.Points2D.from_fields(colors=TRUTH, radii=rr.Radius.ui_points(6.0))
    recording.log(f"{MAP}/vehicle", dot, static=True)
    index = [rr.TimeColumn("time", duration=moved.time)]
    recording.send_columns(f"{MAP}/vehicle", index, rr.Points2D.columns(positions=way))


def _blueprint(plots: Sequence[Plot], lanes: Sequence[Lane], moved: Motion) -> "rrb.Blueprint":
    import rerun.blueprint as rrb

    scene = timeline_3d.scene("vehicle, its twin in outlines", moved)
    # One legend: all plots have the same colours, and laps and lane changes begin straight ahead
    *views, speed = [plot_view(p, legend=p.entity == "sideslip", left=True) for p in plots]
    (left, bottom), (right, top) = (f(moved.states[:, :2], axis=0) for f in (np.min, np.max))
    above = rrb.Spatial2DView(
        origin=MAP,
        name="from above",
        background=timeline_3d.BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(
            x_range=(left - MAP_MARGIN, right + MAP_MARGIN),
            y_range=(-top - MAP_MARGIN, -bottom + MAP_MARGIN),
        ),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(scene, rrb.Horizontal(above, speed), row_shares=[2, 1]),
            rrb.Vertical(
                *views,
                lanes_view("gates of the mass", [lane.entity for lane in lanes]),
                row_shares=[10, 10, 10, 9],
            ),
            column_shares=[1, 1],
        ),
        rrb.TimePanel(state="collapsed", timeline="time"),
        collapse_panels=True,
        auto_views=False,
    )
