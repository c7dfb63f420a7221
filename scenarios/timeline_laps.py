"""The timeline of laps and lane changes: sideslip and mass of several observers, the car, a ghost.

The ghost is the twin. Nobody tells it where on the track it is, so that it is drawn where the
vehicle is and moves where the vehicle moves; how it stands to that, its sideslip, and how it leans
are its own.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from estimators import state_and_mass
from estimators.estimate import Estimate
from scenarios import timeline_3d
from scenarios.mismatch import MISMATCHES, real_vehicle
from scenarios.state_study import Belief, Run, observe
from scenarios.timeline import (
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
from scenarios.timeline_3d import Motion
from twin import STATES, Drive, TwinError, Vehicle

if TYPE_CHECKING:
    import rerun.blueprint as rrb

Array = NDArray[np.float64]

COLOURS = {"til": TWIN, "double-track": (90, 150, 230)}
GHOST = (0.95, 0.5, 0.2, 0.35)
YAW, VX, VY = STATES.index("yaw"), STATES.index("vx"), STATES.index("vy")


def write(path: Path, runs: Sequence[Run], title: str) -> None:
    """Writes the first run of each estimator of `COLOURS` as an .rrd file, whole or not at all.

    Args:
        path: the file.
        runs: of one real vehicle.
        title: what the viewer calls the recording.

    Raises:
        TwinError: the file cannot be written, or there is no run of the default observer.
    """
    first = {run.estimator: run for run in reversed(runs) if run.estimator in COLOURS}
    seen = {name: observe(first[name]) for name in COLOURS if name in first}
    if "til" not in seen or seen["til"][1].estimate is None:
        raise TwinError(f"{path}: a timeline needs a run of til")
    drive, estimate = seen["til"][0], seen["til"][1].estimate
    plots = _plots(drive, estimate, {name: found for name, (_, found) in seen.items()})
    moved = timeline_3d.motion(drive, estimate, frames(drive.time))
    run = first["til"]
    vehicle = real_vehicle(Vehicle.load("sports_car"), MISMATCHES[run.case])
    with recording_to(path, _blueprint(plots, moved), title, drive.settings) as recording:
        import rerun as rr

        timeline_3d.log_car(recording, vehicle.compile(), moved)
        ghost = timeline_3d.poses(vehicle.compile(), _ghost(moved, estimate, frames(drive.time)))
        timeline_3d.log_bodies(
            recording,
            vehicle.compile(),
            [rr.TimeColumn("time", duration=moved.time)],
            ghost.positions,
            ghost.quaternions,
            root=f"{timeline_3d.WORLD}/twin",
            tint=GHOST,
        )
        for plot in plots:
            send_plot(recording, drive.time, plot)


def gates(drive: Drive, estimate: Estimate) -> dict[str, Array]:
    """Of each gate of the mass law whether it is open, 1 or 0."""
    turning = np.abs(drive.channel("yaw_rate")) <= state_and_mass.LARGEST_YAW_RATE
    pushing = np.abs(estimate["ax"]) >= state_and_mass.LEAST_ACCELERATION
    return {
        "straight ahead": turning.astype(np.float64),
        "speeding up or braking": pushing.astype(np.float64),
        "mass is corrected": (turning & pushing).astype(np.float64),
    }


def _ghost(moved: Motion, estimate: Estimate, shown: NDArray[np.int64]) -> Motion:
    """The twin where the vehicle is, moving in its direction."""
    states = estimate.states[shown].copy()
    own = np.arctan2(states[:, VY], states[:, VX])
    real = np.arctan2(moved.states[:, VY], moved.states[:, VX])
    states[:, :2] = moved.states[:, :2]
    states[:, YAW] = moved.states[:, YAW] + real - own
    return moved._replace(states=states, forces=None)


def _plots(drive: Drive, estimate: Estimate, beliefs: dict[str, Belief]) -> list[Plot]:
    sideslip = [
        Line(name.replace("-", "_"), name, np.degrees(found.sideslip), COLOURS[name], 2.5)
        for name, found in beliefs.items()
    ]
    truth = np.degrees(drive.truth["sideslip"])
    sideslip.append(Line("truth", "truth", truth, TRUTH, 1.2))
    mass = [
        Line(name.replace("-", "_"), name, found.mass, COLOURS[name], 2.5)
        for name, found in beliefs.items()
    ]
    mass.append(Line("truth", "truth", np.zeros(len(drive)), TRUTH, 1.2))
    speed = [Line("vehicle", "vehicle", 3.6 * drive.truth["vx"], TRUTH, 1.2)]
    states = zip(
        gates(drive, estimate).items(), (MEASURED, BAND_COLOUR, TWIN), (4.0, 2.0, 0.0), strict=True
    )
    return [
        Plot("sideslip", "sideslip [deg]", sideslip),
        Plot("mass", "error of the mass [kg]", mass),
        Plot(
            "gates",
            "gates, up where open",
            [
                Line(name.replace(" ", "_"), name, values + height, colour, 2.0)
                for (name, values), colour, height in states
            ],
        ),
        Plot("speed", "speed [km/h]", speed),
    ]


def _blueprint(plots: Sequence[Plot], moved: Motion) -> "rrb.Blueprint":
    import rerun.blueprint as rrb

    scene = timeline_3d.scene("vehicle, its twin as a ghost", moved)
    views = [plot_view(plot, legend=True, left=True) for plot in plots[:-1]]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(scene, plot_view(plots[-1], legend=False), row_shares=[3, 1]),
            rrb.Vertical(*views),
            column_shares=[1, 1],
        ),
        rrb.TimePanel(state="collapsed", timeline="time"),
        collapse_panels=True,
        auto_views=False,
    )
