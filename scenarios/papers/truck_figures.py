"""KBF Figures 5 and 6 as ours: the truck's velocities and load over time."""

import numpy as np

from scenarios.experiment import truck
from scenarios.experiment.engine import observe, rows, runs
from scenarios.experiment.experiment import Experiment, Score, Trial
from scenarios.experiment.reproduction import Clock, Making
from scenarios.experiment.result import Result
from scenarios.experiment.truck import CASES, UNITS, estimate_of, settling_times, some
from scenarios.experiment.truck_plant import LOAD_STEPS
from scenarios.report import pictures
from twin.truck.model import RATES
from twin.truck.twin import TRUCK_PARAMETERS

SHOWN = ("kalman-bucy", "til")
EVERY = 10  # samples between two points of a curve
EVENTS = ("start at 2 x nominal", *(f"load x {factor:g} at {t:g} s" for t, factor in LOAD_STEPS))


def figure_5(making: Making) -> Result:
    """Velocities: the picture of seed 0, the errors of all seeds."""
    clock, name = Clock.started(), "kbf-figure-5"
    experiment = truck.experiment(name, CASES[:1], some(*SHOWN), RATES)
    found = rows(runs(experiment, making.seeds, making.duration), making.jobs, name)
    _draw(experiment, making, "KBF Figure 5: the chassis' velocities")
    return clock.result(name, making, found, case=CASES[0].name)


def figure_6(making: Making) -> Result:
    """Load parameters: the picture of seed 0; the time to 10 % after each step, of all seeds.

    The paper says of its own figure: below 10 % after 0.5 s.
    """
    clock, name = Clock.started(), "kbf-figure-6"
    experiment = truck.experiment(name, CASES[:1], some(*SHOWN))
    timed = Experiment(
        name=name,
        cases=experiment.cases,
        estimators=experiment.estimators,
        quantities=TRUCK_PARAMETERS,
        metrics=_times,
    )
    found = rows(runs(timed, making.seeds, making.duration), making.jobs, name)
    _draw(experiment, making, "KBF Figure 6: load of the chassis, road class C")
    return clock.result(name, making, found, case=CASES[0].name)


def _times(trial: Trial) -> list[Score]:
    """Settling times of each parameter and event [s]."""
    return [
        Score(name, "time_to_10pct", "s", seconds, case=event)
        for name in TRUCK_PARAMETERS
        for event, seconds in zip(
            EVENTS, settling_times(trial.drive, name, estimate_of(trial, name)), strict=False
        )
    ]


def _draw(experiment: Experiment, making: Making, title: str) -> None:
    """As the paper draws: the truth bold and light, estimates thin and dark."""
    trials = [observe(run) for run in runs(experiment, [0], making.duration)]
    path = making.out / f"{experiment.name}.png"
    with pictures.figure(path, rows=len(experiment.quantities), title=title) as axes:
        for axis, name in zip(axes, experiment.quantities, strict=True):
            truth = trials[0].drive.truth[name]
            time = trials[0].drive.time[::EVERY]
            axis.plot(time, truth[::EVERY], color="0.75", lw=4, label="actual")
            for trial, colour, above in zip(trials, ("k", "tab:orange"), (3, 2), strict=True):
                style = {"color": colour, "lw": 0.8, "zorder": above}
                axis.plot(
                    time, estimate_of(trial, name)[::EVERY], label=trial.run.estimator, **style
                )
            axis.set(ylabel=f"{name} [{UNITS[name]}]")
            if name in TRUCK_PARAMETERS:
                axis.set(ylim=(0.0, 1.6 * np.max(truth)))
        axes[0].legend(ncols=3, fontsize="small")
        axes[-1].set(xlabel="time [s]")
