"""TiL Figures 14 to 18, and the double track's ramp.

The paper's car cannot be had: what is beside ours is its gains, not its errors.
"""

from dataclasses import replace
from typing import Literal

import numpy as np

from scenarios.experiment import sideslip_and_mass
from scenarios.experiment.engine import observe, rows, runs
from scenarios.experiment.experiment import CarPlant, Run
from scenarios.experiment.metrics import mass_error
from scenarios.experiment.reproduction import Clock, Making
from scenarios.experiment.result import Result, Row
from scenarios.experiment.sideslip_and_mass import CASE, MISSING, TWIN
from scenarios.report import pictures

Drives = Literal["laps", "lane-change"]
# [kg/s per m/s2] of the double track on the ramp; chosen. Tuning leaves as good as none, for lack
# of anything to find.
RAMP_GAIN = 20.0
STARTS = (MISSING, 0.0, -MISSING)  # [kg]
EVERY = 20  # samples to a point of a line
DRAWN = {"til": "C0", "til-paper": "C2", "double-track": "C1", "static-map": "0.6"}
HIGHLIGHT = 40.0  # [s] of Figure 17
LAPS = sideslip_and_mass.experiment("laps")


def figure_14(making: Making) -> Result:
    """Speed, yaw rate and lateral acceleration on the laps."""
    return _profile("til-figure-14", "laps", making)


def figure_15(making: Making) -> Result:
    """The same of the lane changes."""
    return _profile("til-figure-15", "lane-change", making)


def figure_16(making: Making) -> Result:
    """Mass and sideslip on the laps."""
    return _estimates("til-figure-16", "laps", None, making)


def figure_17(making: Making) -> Result:
    """The last part of Figure 16."""
    return _estimates("til-figure-17", "laps", HIGHLIGHT, making)


def figure_18(making: Making) -> Result:
    """Mass and sideslip on the lane changes."""
    return _estimates("til-figure-18", "lane-change", None, making)


def ramp(making: Making) -> Result:
    """Mass of the double track and of the twin from three initial errors, on laps."""
    clock, found = Clock.started(), []
    name = "til-double-track-ramp"
    with pictures.figure(
        making.out / f"{name}.png", rows=2, title="Mass from three starts"
    ) as axes:
        for axis, estimator in zip(axes, ("til", "double-track"), strict=True):
            gains = dict(sideslip_and_mass.gains_of(TWIN, estimator))
            if estimator == "double-track":
                gains["mass"] = RAMP_GAIN
            for first in STARTS:
                case = replace(LAPS.cases[0], initial=(("mass", first),))
                trial = observe(
                    Run(
                        experiment=LAPS,
                        case=case,
                        estimator=estimator,
                        duration=making.duration,
                        gains=tuple(gains.items()),
                    )
                )
                error, label = mass_error(trial), f"from {first:+.0f} kg"
                axis.plot(trial.drive.time[::EVERY], error[::EVERY], label=label)
                found.append(
                    Row.over_seeds(
                        [error[-1]], case=f"{CASE}, laps, {label}", quantity="mass",
                        metric="error_at_end", unit="kg", estimator=estimator,
                    )
                )  # fmt: skip
            axis.axhline(0.0, color="k", lw=1, ls="--")
            axis.set(ylabel="error of the mass [kg]", title=estimator)
            axis.legend(fontsize="small")
        axes[-1].set(xlabel="time [s]")
    settings = {"starts": list(STARTS), "double_track_mass_gain": RAMP_GAIN}
    return clock.result(name, making, found, **settings)


def _profile(name: str, drive: Drives, making: Making) -> Result:
    clock = Clock.started()
    plant = sideslip_and_mass.case(CASE, drive).plant
    assert isinstance(plant, CarPlant)
    clean = plant.clean(making.duration)
    truth = clean.truth
    # with what the paper's figure shows at most
    drawn = {
        ("speed", "km/h"): (3.6 * truth["vx"], 230.0 if drive == "laps" else None),
        ("yaw rate", "deg/s"): (np.degrees(truth["yaw_rate"]), None),
        ("lateral acceleration", "g"): (truth["ay"] / 9.81, 1.5 if drive == "laps" else None),
    }
    path = making.out / f"{name}.png"
    with pictures.figure(path, rows=len(drawn), title=f"Real vehicle: {drive}") as axes:
        for axis, ((quantity, unit), (values, _)) in zip(axes, drawn.items(), strict=True):
            axis.plot(clean.time[::EVERY], values[::EVERY], color="k", lw=0.8)
            axis.set(ylabel=f"{quantity} [{unit}]")
        axes[-1].set(xlabel="time [s]")
    found = [
        Row.over_seeds(
            [float(np.abs(values).max())], case=f"{CASE}, {drive}", quantity=quantity,
            metric="largest", unit=unit, estimator="real vehicle", paper=paper,
        )
        for (quantity, unit), (values, paper) in drawn.items()
    ]  # fmt: skip
    return clock.result(name, making, found)


def _estimates(name: str, drive: Drives, last: float | None, making: Making) -> Result:
    clock, experiment = Clock.started(), sideslip_and_mass.experiment(drive)
    path = making.out / f"{name}.png"
    with pictures.figure(path, rows=3, title=f"Mass and sideslip: {drive}") as axes:
        above, middle, below = axes
        truth = None
        for run in runs(experiment, [0], making.duration, estimators=DRAWN):
            trial, style = observe(run), {"color": DRAWN[run.estimator], "label": run.estimator}
            seen = trial.drive
            part = slice(0 if last is None else -round(last / seen.dt), None, EVERY)
            truth = seen.time[part], np.degrees(seen.truth["sideslip"][part])
            if trial.estimate.has("mass"):
                above.plot(truth[0], mass_error(trial)[part], **style)
            sideslip = np.degrees(trial.estimate.sideslip[part])
            middle.plot(truth[0], sideslip, lw=1, **style)
            below.plot(truth[0], sideslip - truth[1], lw=1, **style)
        if truth:
            middle.plot(*truth, color="k", lw=1, ls="--", label="truth")
        above.axhline(0.0, color="k", lw=1, ls="--", label="truth")
        above.set(ylabel="error of the mass [kg]")
        middle.set(ylabel="sideslip [deg]")
        below.set(ylabel="error of the sideslip [deg]", xlabel="time [s]")
        for axis in axes:
            axis.legend(fontsize="small", ncols=3)
    found = rows(runs(experiment, making.seeds, making.duration), making.jobs, name)
    return clock.result(name, making, found)
