"""TiL Figures 4 to 11: ours, with what can be read off the paper."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimators.score import settling_time
from scenarios import mass, pitch, roll_yaw
from scenarios.experiment.engine import observe, rows, runs, scores
from scenarios.experiment.experiment import CarPlant, Case, Experiment, Score, Trial
from scenarios.experiment.reproduction import Clock, Making
from scenarios.experiment.result import Result
from scenarios.report import pictures
from twin import Drive

SNR = (5.0, 7.5, 10.0, 15.0, 20.0)  # [dB], TiL Figures 5, 7, 8, 10
ROAD_NOISE = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25)  # half widths of Eq. (17), TiL Figure 11
STARTS = (-0.5, 0.0, 1.0, 2.0)  # shares of the variation believed at the start
ACCEPTED = 10.0  # [%], what the paper accepts
LAST = 0.5  # share of the drive in which the worst error counts
UNITS = {"mass": "kg", "Jxx": "kg m2", "Jyy": "kg m2", "Jzz": "kg m2"}
EVERY = 50  # samples to a point of a line
MASS, ROLL_YAW, PITCH = mass.EXPERIMENT, roll_yaw.EXPERIMENT, pitch.EXPERIMENT


def figure_4(making: Making) -> Result:
    """Mass over time, from several initial errors; the speed below."""
    return _over_time("til-figure-4", MASS, MASS.table[1:2], "vx", making)


def figure_5(making: Making) -> Result:
    """Error of the mass over the noise."""
    return _over_noise("til-figure-5", MASS, MASS.table[1], "mass", making)


def figure_6(making: Making) -> Result:
    """Roll and yaw inertia over time, mass wrong; above CM right, below CM wrong."""
    return _over_time("til-figure-6", ROLL_YAW, ROLL_YAW.table[3:5], "steering", making)


def figure_7(making: Making) -> Result:
    """Error of the roll inertia over the noise."""
    return _over_noise("til-figure-7", ROLL_YAW, ROLL_YAW.table[2], "Jxx", making)


def figure_8(making: Making) -> Result:
    """Error of the yaw inertia over the noise."""
    return _over_noise("til-figure-8", ROLL_YAW, ROLL_YAW.table[2], "Jzz", making)


def figure_9(making: Making) -> Result:
    """Pitch inertia over time, sensors noisy, road known."""
    return _over_time("til-figure-9", PITCH, PITCH.table[2:3], "road", making)


def figure_10(making: Making) -> Result:
    """Error of the pitch inertia over the noise of the sensors."""
    return _over_noise("til-figure-10", PITCH, PITCH.table[2], "Jyy", making)


def figure_11(making: Making) -> Result:
    """Error of the pitch inertia over the noise of the known road, and that road."""
    clock = Clock.started()
    table = {0.0: 0.11, 0.1: 3.19}
    cases = [
        replace(
            PITCH.table[1],
            name=f"noiseless, road noise {epsilon:g}",
            road_noise=epsilon,
            paper={("Jyy", "rms_pct"): table[epsilon]} if epsilon in table else {},
        )
        for epsilon in ROAD_NOISE
    ]
    todo = runs(PITCH, making.seeds, making.duration, cases=cases)
    found = [row for row in rows(todo, making.jobs, "til-figure-11") if row.metric == "rms_pct"]
    noisy = cases[2].noisy_drive(0, making.duration)
    with pictures.figure(
        making.out / "til-figure-11.png", rows=2, shared=False, title="Pitch inertia, noisy road"
    ) as (above, below):
        _draw_errors(above, ROAD_NOISE, PITCH, cases, "Jyy", making, table)
        above.set(xlabel="half width of the road's noise", ylabel="rms error of Jyy [%]")
        part = slice(20000, 21000)
        for drive, label in ((noisy, "known to the twin"), (_clean(cases[2], making), "real")):
            height = 100.0 * drive.channel("road_height_fl")
            below.plot(drive.time[part], height[part], lw=1, label=label)
        below.set(xlabel="time [s]", ylabel="road, front [cm]")
        below.legend(fontsize="small")
    return clock.result("til-figure-11", making, found)


def _clean(case: Case, making: Making) -> Drive:
    assert isinstance(case.plant, CarPlant)
    return case.plant.clean(making.duration)


def _from(case: Case, experiment: Experiment, share: float) -> Case:
    """The case with a share of the variation believed at the start."""
    load, names = case.load(), experiment.quantities
    words = ", ".join(f"{share * load[name]:.4g} {UNITS[name]}" for name in names)
    return replace(
        case,
        name=f"{case.name}, from {words}",
        initial=tuple((name, share * load[name]) for name in names),
        paper={},
    )


def _over_time(
    name: str, experiment: Experiment, cases: Sequence[Case], drawn: str, making: Making
) -> Result:
    """Convergence from several starts: rows over seeds, and a picture of the first seed."""
    clock = Clock.started()
    til = {"til": experiment.estimators["til"]}
    study = replace(experiment, metrics=_convergence, limit=None, estimators=til)
    starts = [_from(case, experiment, share) for case in cases for share in STARTS]
    found = rows(runs(study, making.seeds, making.duration, cases=starts), making.jobs, name)
    _draw_over_time(making, name, study, cases, drawn)
    return clock.result(name, making, found)


def _convergence(trial: Trial) -> list[Score]:
    _, drive, estimate = trial
    late, load = round(LAST * len(drive)), trial.run.case.load()
    found = []
    for name in trial.run.experiment.quantities:
        worst = 100.0 * np.abs(estimate[name][late:] - load[name]).max() / abs(load[name])
        found += [
            Score(name, "time_to_10pct", "s", settling_time(estimate[name], load[name], drive.dt)),
            Score(name, "worst_pct_last_half", "%", float(worst)),
        ]
    return found


def _draw_over_time(
    making: Making, name: str, study: Experiment, cases: Sequence[Case], drawn: str
) -> None:
    count = len(cases) * len(study.quantities)
    title = f"{study.name}, from several starts"
    path: Path = making.out / f"{name}.png"
    with pictures.figure(path, rows=count + 1, title=title) as axes:
        for c, case in enumerate(cases):
            todo = [
                run
                for share in STARTS
                for run in runs(study, [0], making.duration, cases=[_from(case, study, share)])
            ]
            trials = [observe(run) for run in todo]
            for p, parameter in enumerate(study.quantities):
                axis, truth = axes[len(study.quantities) * c + p], case.load()[parameter]
                for share, (_, drive, estimate) in zip(STARTS, trials, strict=True):
                    axis.plot(
                        drive.time[::EVERY],
                        estimate[parameter][::EVERY],
                        label=f"from {share * truth:.4g}",
                    )
                axis.axhspan(0.9 * truth, 1.1 * truth, color="0.9", label="within 10 %")
                axis.axhline(truth, color="k", lw=1, ls="--", label="truth")
                axis.set(ylabel=f"{parameter} [{UNITS[parameter]}]", title=case.name)
                axis.legend(ncols=3, fontsize="x-small")
        _draw_drive(axes[-1], _clean(cases[0], making), drawn)


def _draw_drive(axis, drive: Drive, drawn: str) -> None:
    values, label = {
        "vx": (3.6 * drive.truth["vx"], "speed [km/h]"),
        "steering": (np.degrees(drive.channel("steering_wheel_angle")), "hand wheel [deg]"),
        "road": (100.0 * drive.channel("road_height_fl"), "road, front [cm]"),
    }[drawn]
    axis.plot(drive.time[:: EVERY // 5], values[:: EVERY // 5], color="k", lw=0.8)
    axis.set(xlabel="time [s]", ylabel=label)


def _over_noise(
    name: str, experiment: Experiment, case: Case, parameter: str, making: Making
) -> Result:
    """The error over the noise of the sensors: rows, and a picture."""
    clock = Clock.started()
    key = parameter, "rms_pct"
    cases = [
        replace(
            case,
            snr=snr,
            name=case.name.replace("noisy", f"SNR {snr:g} dB", 1),
            paper={key: case.paper[key]} if snr == case.snr else {},
        )
        for snr in SNR
    ]
    todo = runs(experiment, making.seeds, making.duration, cases=cases)
    found = [
        row
        for row in rows(todo, making.jobs, name)
        if (row.quantity, row.metric) == (parameter, "rms_pct")
    ]
    with pictures.figure(
        making.out / f"{name}.png", title=f"Error of {parameter} over noise"
    ) as axis:
        paper = {case.snr: case.paper[key]}
        _draw_errors(axis, SNR, experiment, cases, parameter, making, paper)
        bounds = [row.limit for row in found if row.estimator == "til"]
        axis.plot(SNR, bounds, color="0.4", ls=":", label="Cramer-Rao bound of the rms")
        axis.set(xlabel="SNR [dB]", ylabel=f"rms error of {parameter} [%]")
        axis.legend(fontsize="small")
    return clock.result(name, making, found)


def _errors(
    experiment: Experiment, case: Case, estimator: str, parameter: str, making: Making
) -> NDArray[np.float64]:
    """(seeds,) rms errors [%]; one seed stands for all where nothing is random."""
    todo = runs(experiment, making.seeds, making.duration, cases=[case], estimators=[estimator])
    key = parameter, "rms_pct"
    found = [
        score.value
        for one in scores(todo, making.jobs, experiment.name)
        for score in one
        if (score.quantity, score.metric) == key
    ]
    return np.broadcast_to(found, len(making.seeds)) if len(found) == 1 else np.array(found)


def _draw_errors(
    axis,
    x: Sequence[float],
    experiment: Experiment,
    cases: Sequence[Case],
    parameter: str,
    making: Making,
    paper: dict[float, float],
) -> None:
    of = partial(_errors, parameter=parameter, making=making)
    for estimator in experiment.estimators:
        values = np.array([of(experiment, case, estimator) for case in cases])
        pictures.spread(axis, x, values, label=estimator)
    axis.plot(*zip(*paper.items(), strict=True), "kx", label="the paper's tables")
    axis.axhline(ACCEPTED, color="k", lw=1, ls="--", label="what the paper accepts")
    axis.set(yscale="log")
    axis.legend(fontsize="small")
