"""TiL Table 8 and Figures 14 to 18, a table of all real vehicles, and the double track's ramp.

The paper's car cannot be had: what is beside ours is its gains, not its errors.
"""

import time
import tomllib
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from scenarios import laps
from scenarios.experiment import state_study
from scenarios.experiment.result import Result, Row
from scenarios.experiment.state_study import (
    BOUNDS,
    COMMONROAD,
    ESTIMATORS,
    MISSING,
    TWIN,
    WITH_FORCES,
    Run,
    clean_drive,
    observe,
)
from scenarios.plants.mismatch import MISMATCHES
from scenarios.report import pictures
from scenarios.tuning import gains

CASE = "mismatched"
# TiL Table 8; its gains on the mass are printed without a unit
TABLE_8 = {
    "til-paper": {
        "wheel_speed": 0.259,
        "ax_vx": 3.287e-3,
        "ay_vy": 7.430e-2,
        "pitch_rate": 0.913,
        "yaw_rate": 1.046,
        "mass": 248.17,
    },
    "double-track": {"ax_vx": 9.282e-2, "ay_vy": 5.271e-2, "yaw_rate": 0.314, "mass": 2.06},
}
# Errors of one force at a time: what they do to the mass does not average out
SINGLE = ("drive-5", "drive+5", "brake-5", "brake+5", "cornering_stiffness+10", "drag+10", "delay")
# [kg/s per m/s2] of the double track on the ramp; chosen. Tuning leaves as good as none, for lack
# of anything to find.
RAMP_GAIN = 20.0
STARTS = (MISSING, 0.0, -MISSING)  # [kg]
EVERY = 20  # samples to a point of a line
DRAWN = {"til": "C0", "til-paper": "C2", "double-track": "C1", "static-map": "0.6"}
HIGHLIGHT = 40.0  # [s] of Figure 17


def table_8(seeds: int, jobs: int, out: Path) -> Result:
    """Bounds and optima of the gains, ours beside the paper's."""
    del seeds, jobs, out
    start = time.perf_counter()
    rows = []
    for estimator, bounds in BOUNDS.items():
        own = state_study.gains_of(TWIN, estimator)
        for name, ends in bounds.items():
            paper = TABLE_8.get(estimator, {}).get(name)
            values = {"lower bound": ends[0], "upper bound": ends[1], "optimised": own[name]}
            rows += [
                Row.over_seeds(
                    [value], case=case, quantity=name, metric="gain", unit=_unit(name),
                    estimator=estimator, paper=paper if case == "optimised" else None,
                )
                for case, value in values.items()
            ]  # fmt: skip
    made = {name: _made(name) for name in BOUNDS}
    return _result("til-table-8", {"made": made}, rows, start)


def _unit(name: str) -> str:
    if name in ("ax_vx", "ay_vy"):
        return "1"
    units = {
        "mass": "kg/(m/s)",
        "yaw_rate_vy": "m/s",
        "noise_density": "m/s2/Hz^0.5",
        "drift": "kg/s^0.5",
    }
    return units.get(name, "1/s")


def _made(estimator: str) -> Any:
    text = (gains.FOLDER / f"{TWIN}-{estimator}.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)["made"]


def joint_table(seeds: int, jobs: int, out: Path) -> Result:
    """Sideslip, mass and axle forces of every observer on every real vehicle."""
    del out
    start = time.perf_counter()
    some = range(seeds)
    todo = [
        *state_study.runs(["same"], tuple(state_study.DRIVES), ESTIMATORS, some),
        *state_study.runs([CASE], tuple(state_study.DRIVES), (*ESTIMATORS, WITH_FORCES), some),
        *state_study.runs(SINGLE, ["laps"], ["til"], some),
    ]
    others = find_spec("vehiclemodels") is not None
    if others:
        todo += state_study.runs([COMMONROAD], tuple(state_study.DRIVES), ESTIMATORS, some)
    rows = laps.rows(todo, jobs, "til-joint-table")
    vehicles = {name: MISMATCHES[name].summary for name in ("same", CASE, *SINGLE)}
    vehicles[COMMONROAD] = (
        "BMW 320i of commonroad-vehicle-models, below 0.6 g"
        if others
        else "left out: commonroad-vehicle-models is not installed"
    )
    settings = {"seeds": seeds, "snr": state_study.SNR, "real_vehicles": vehicles}
    return _result("til-joint-table", settings, rows, start)


def figure_14(seeds: int, jobs: int, out: Path) -> Result:
    """Speed, yaw rate and lateral acceleration on the laps."""
    return _profile("til-figure-14", "laps", out)


def figure_15(seeds: int, jobs: int, out: Path) -> Result:
    """The same of the lane changes."""
    return _profile("til-figure-15", "lane-change", out)


def figure_16(seeds: int, jobs: int, out: Path) -> Result:
    """Mass and sideslip on the laps."""
    return _estimates("til-figure-16", "laps", None, seeds, jobs, out)


def figure_17(seeds: int, jobs: int, out: Path) -> Result:
    """The last part of Figure 16."""
    return _estimates("til-figure-17", "laps", HIGHLIGHT, seeds, jobs, out)


def figure_18(seeds: int, jobs: int, out: Path) -> Result:
    """Mass and sideslip on the lane changes."""
    return _estimates("til-figure-18", "lane-change", None, seeds, jobs, out)


def ramp(seeds: int, jobs: int, out: Path) -> Result:
    """Mass of the double track and of the twin from three initial errors, on laps."""
    start = time.perf_counter()
    rows = []
    name = "til-double-track-ramp"
    with pictures.figure(out / f"{name}.png", rows=2, title="Mass from three starts") as axes:
        for axis, estimator in zip(axes, ("til", "double-track"), strict=True):
            for first in STARTS:
                own = state_study.gains_of(TWIN, estimator)
                if estimator == "double-track":
                    own = {**own, "mass": RAMP_GAIN}
                run = Run(
                    case=CASE, drive="laps", estimator=estimator, start=first,
                    gains=tuple(own.items()),
                )  # fmt: skip
                drive, belief = observe(run)
                axis.plot(drive.time[::EVERY], belief.mass[::EVERY], label=f"from {first:+.0f} kg")
                rows.append(
                    Row.over_seeds(
                        [belief.mass[-1]], case=f"{CASE}, laps, from {first:+.0f} kg",
                        quantity="mass", metric="error_at_end", unit="kg", estimator=estimator,
                    )
                )  # fmt: skip
            axis.axhline(0.0, color="k", lw=1, ls="--")
            axis.set(ylabel="error of the mass [kg]", title=estimator)
            axis.legend(fontsize="small")
        axes[-1].set(xlabel="time [s]")
    return _result(name, {"starts": list(STARTS), "double_track_mass_gain": RAMP_GAIN}, rows, start)


def _result(name: str, settings: dict[str, Any], rows: Sequence[Row], start: float) -> Result:
    return Result(
        name=name, settings=settings, seconds=time.perf_counter() - start, rows=list(rows)
    )


def _profile(name: str, drive: str, out: Path) -> Result:
    start = time.perf_counter()
    truth = (clean := clean_drive(CASE, drive, None)).truth
    drawn = {
        "speed [km/h]": 3.6 * truth["vx"],
        "yaw rate [deg/s]": np.degrees(truth["yaw_rate"]),
        "lateral acceleration [g]": truth["ay"] / 9.81,
    }
    with pictures.figure(
        out / f"{name}.png", rows=len(drawn), title=f"Real vehicle: {drive}"
    ) as axes:
        for axis, (label, values) in zip(axes, drawn.items(), strict=True):
            axis.plot(clean.time[::EVERY], values[::EVERY], color="k", lw=0.8)
            axis.set(ylabel=label)
        axes[-1].set(xlabel="time [s]")
    extremes: dict[str, tuple[str, Callable[[Any], Any], float | None]] = {
        "speed [km/h]": ("km/h", np.max, 230.0 if drive == "laps" else None),
        "yaw rate [deg/s]": ("deg/s", lambda x: np.abs(x).max(), None),
        "lateral acceleration [g]": (
            "g",
            lambda x: np.abs(x).max(),
            1.5 if drive == "laps" else None,
        ),
    }
    rows = [
        Row.over_seeds(
            [float(largest(drawn[label]))], case=f"{CASE}, {drive}", quantity=label.split(" [")[0],
            metric="largest", unit=unit, estimator="real vehicle", paper=paper,
        )
        for label, (unit, largest, paper) in extremes.items()
    ]  # fmt: skip
    return _result(name, {}, rows, start)


def _estimates(
    name: str, drive: str, last: float | None, seeds: int, jobs: int, out: Path
) -> Result:
    start = time.perf_counter()
    with pictures.figure(out / f"{name}.png", rows=3, title=f"Mass and sideslip: {drive}") as axes:
        above, middle, below = axes
        truth = None
        for estimator, colour in DRAWN.items():
            seen, belief = observe(Run(case=CASE, drive=drive, estimator=estimator))
            part = slice(0 if last is None else -round(last / seen.dt), None, EVERY)
            truth = seen.time[part], np.degrees(seen.truth["sideslip"][part])
            above.plot(truth[0], belief.mass[part], color=colour, label=estimator)
            sideslip = np.degrees(belief.sideslip[part])
            middle.plot(truth[0], sideslip, color=colour, lw=1, label=estimator)
            below.plot(truth[0], sideslip - truth[1], color=colour, lw=1, label=estimator)
        if truth:
            middle.plot(*truth, color="k", lw=1, ls="--", label="truth")
        above.axhline(0.0, color="k", lw=1, ls="--", label="truth")
        above.set(ylabel="error of the mass [kg]")
        middle.set(ylabel="sideslip [deg]")
        below.set(ylabel="error of the sideslip [deg]", xlabel="time [s]")
        for axis in axes:
            axis.legend(fontsize="small", ncols=3)
    todo = state_study.runs([CASE], [drive], ESTIMATORS, range(seeds))
    return _result(name, {"seeds": seeds}, laps.rows(todo, jobs, name), start)
