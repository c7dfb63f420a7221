"""KBF Figures 5 and 6 as ours: the truck's velocities and load over time."""

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from estimators.base import Estimate
from scenarios.experiment.progress import parallel
from scenarios.experiment.result import Result, Row
from scenarios.papers.truck_drive import LOAD_STEPS, TruckCase, make_drive
from scenarios.papers.truck_estimators import ESTIMATORS, some
from scenarios.papers.truck_score import PAPER, UNITS, absolute, run_cases, settling_times
from scenarios.report import pictures
from twin import Drive
from twin.truck.model import RATES
from twin.truck.twin import TRUCK_PARAMETERS

CASE = TruckCase()
SHOWN = ("kalman-bucy", "til")
EVERY = 10  # samples between two points of a curve
EVENTS = ("start at 2 x nominal", *(f"load x {factor:g} at {t:g} s" for t, factor in LOAD_STEPS))


def figure_5(seeds: int, jobs: int, out: Path) -> Result:
    """Velocities: the picture of seed 0, the errors of all seeds."""
    start = time.perf_counter()
    rows = run_cases(
        [CASE],
        some(*SHOWN),
        range(seeds),
        jobs=jobs,
        quantities=RATES,
        metrics=("mape_pct", "rmse"),
    )
    drive, estimates = _seed_0()
    with pictures.figure(
        out / "kbf-figure-5.png",
        rows=3,
        title="KBF Figure 5: the chassis' velocities",
    ) as axes:
        for i, (ax, name) in enumerate(zip(axes, RATES, strict=True)):
            columns = {own: found.outputs[:, i] for own, found in estimates.items()}
            _draw(ax, drive, name, columns)
        axes[0].legend(ncols=3, fontsize="small")
        axes[-1].set(xlabel="time [s]")
    return _result("kbf-figure-5", seeds, start, rows)


def figure_6(seeds: int, jobs: int, out: Path) -> Result:
    """Load parameters: the picture of seed 0; the time to 10 % after each step, of all seeds.

    The paper says of its own figure: below 10 % after 0.5 s.
    """
    start = time.perf_counter()
    times = np.array(parallel(_times, list(range(seeds)), jobs, "figure 6"))
    rows = [
        Row.over_seeds(
            times[:, i, j, k].tolist(), case=event, quantity=name, metric="time_to_10pct", unit="s",
            estimator=own, paper=PAPER[name, "time_to_10pct"],
        )
        for k, event in enumerate(EVENTS)
        for i, own in enumerate(SHOWN)
        for j, name in enumerate(TRUCK_PARAMETERS)
    ]  # fmt: skip
    drive, estimates = _seed_0()
    with pictures.figure(
        out / "kbf-figure-6.png", rows=3, title="KBF Figure 6: load of the chassis, road class C"
    ) as axes:
        for ax, name in zip(axes, TRUCK_PARAMETERS, strict=True):
            columns = {own: found.absolute(name) for own, found in estimates.items()}
            _draw(ax, drive, name, columns)
            ax.set(ylim=(0.0, 1.6 * drive.truth[name].max()))
        axes[0].legend(ncols=3, fontsize="small")
        axes[-1].set(xlabel="time [s]")
    return _result("kbf-figure-6", seeds, start, rows)


def _times(seed: int) -> list[list[list[float]]]:
    """Settling times of a seed by estimator, parameter and event [s]."""
    drive = make_drive(CASE, seed)
    found = [absolute(ESTIMATORS[name](CASE, drive)) for name in SHOWN]
    return [
        [settling_times(drive, n, own) for n, own in zip(TRUCK_PARAMETERS, each, strict=True)]
        for each in found
    ]


def _seed_0() -> tuple[Drive, dict[str, Estimate]]:
    drive = make_drive(CASE, 0)
    return drive, {name: ESTIMATORS[name](CASE, drive) for name in SHOWN}


def _draw(axes, drive: Drive, name: str, columns: dict[str, np.ndarray]) -> None:
    """As the paper draws: the truth bold and light, estimates thin and dark."""
    time_ = drive.time[::EVERY]
    axes.plot(time_, drive.truth[name][::EVERY], color="0.75", lw=4, label="actual")
    for own, colour, above in zip(columns, ("k", "tab:orange"), (3, 2), strict=True):
        style = {"color": colour, "lw": 0.8, "zorder": above}
        axes.plot(time_, columns[own][::EVERY], label=own, **style)
    axes.set(ylabel=f"{name} [{UNITS[name]}]")


def _result(name: str, seeds: int, start: float, rows: Sequence[Row]) -> Result:
    settings = {"seeds": seeds, "case": CASE.name}
    return Result(
        name=name, settings=settings, seconds=time.perf_counter() - start, rows=list(rows)
    )
