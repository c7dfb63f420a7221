"""TiL Figures 4 to 11: ours, with what can be read off the paper."""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimators.score import settling_time
from scenarios import mass, pitch, roll_yaw
from scenarios.experiment.progress import parallel
from scenarios.experiment.result import Result, Row
from scenarios.experiment.study import (
    Case,
    Run,
    Study,
    find,
    limit,
    noisy_drive,
    observe,
    real_drive,
    scores,
    variation,
)
from scenarios.report import pictures

SNR = (5.0, 7.5, 10.0, 15.0, 20.0)  # [dB], TiL Figures 5, 7, 8, 10
ROAD_NOISE = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25)  # half widths of Eq. (17), TiL Figure 11
STARTS = (-0.5, 0.0, 1.0, 2.0)  # shares of the variation believed at the start
LIMIT = 10.0  # [%], what the paper accepts
LAST = 0.5  # share of the drive in which the worst error counts
UNITS = {"mass": "kg", "Jxx": "kg m2", "Jyy": "kg m2", "Jzz": "kg m2"}
EVERY = 50  # samples to a point of a line


def figure_4(seeds: int, jobs: int, out: Path) -> Result:
    """Mass over time, from several initial errors; the speed below."""
    return _over_time("til-figure-4", mass.STUDY, [mass.STUDY.cases[1]], "vx", seeds, jobs, out)


def figure_5(seeds: int, jobs: int, out: Path) -> Result:
    """Error of the mass over the noise."""
    return _over_noise("til-figure-5", mass.STUDY, mass.STUDY.cases[1], "mass", seeds, jobs, out)


def figure_6(seeds: int, jobs: int, out: Path) -> Result:
    """Roll and yaw inertia over time, mass wrong; above CM right, below CM wrong."""
    cases = roll_yaw.STUDY.cases[3:5]
    return _over_time("til-figure-6", roll_yaw.STUDY, cases, "steering", seeds, jobs, out)


def figure_7(seeds: int, jobs: int, out: Path) -> Result:
    """Error of the roll inertia over the noise."""
    study = roll_yaw.STUDY
    return _over_noise("til-figure-7", study, study.cases[2], "Jxx", seeds, jobs, out)


def figure_8(seeds: int, jobs: int, out: Path) -> Result:
    """Error of the yaw inertia over the noise."""
    study = roll_yaw.STUDY
    return _over_noise("til-figure-8", study, study.cases[2], "Jzz", seeds, jobs, out)


def figure_9(seeds: int, jobs: int, out: Path) -> Result:
    """Pitch inertia over time, sensors noisy, road known."""
    return _over_time("til-figure-9", pitch.STUDY, [pitch.STUDY.cases[2]], "road", seeds, jobs, out)


def figure_10(seeds: int, jobs: int, out: Path) -> Result:
    """Error of the pitch inertia over the noise of the sensors."""
    return _over_noise("til-figure-10", pitch.STUDY, pitch.STUDY.cases[2], "Jyy", seeds, jobs, out)


def figure_11(seeds: int, jobs: int, out: Path) -> Result:
    """Error of the pitch inertia over the noise of the known road, and that road."""
    start = time.perf_counter()
    study = pitch.STUDY
    cases = [
        replace(study.cases[1], name=f"noiseless, road noise {epsilon:g}", road_noise=epsilon)
        for epsilon in ROAD_NOISE
    ]
    paper = {0.0: 0.11, 0.1: 3.19}
    errors = _errors(study, cases, "Jyy", seeds, jobs)
    found = _rows(study, cases, "Jyy", errors, [paper.get(epsilon) for epsilon in ROAD_NOISE])
    clean = real_drive(study.target, None)
    noisy = noisy_drive(clean, cases[2], 0)
    with pictures.figure(
        out / "til-figure-11.png", rows=2, shared=False, title="Pitch inertia and a noisy road"
    ) as (above, below):
        _draw_errors(above, ROAD_NOISE, errors, paper)
        above.set(xlabel="half width of the road's noise", ylabel="rms error of Jyy [%]")
        part = slice(20000, 21000)
        for drive, label in ((noisy, "known to the twin"), (clean, "real")):
            height = 100.0 * drive.channel("road_height_fl")
            below.plot(drive.time[part], height[part], lw=1, label=label)
        below.set(xlabel="time [s]", ylabel="road, front [cm]")
        below.legend(fontsize="small")
    return _result("til-figure-11", found, seeds, start)


def _run(study: Study, case: Case, estimator: str, seed: int, start: float) -> Run:
    initial = tuple(start * variation()[name] for name in study.parameters)
    return Run(
        study=study.target, estimator=estimator, case=case, seed=seed, initial=initial
    )  # fmt: skip


def _result(name: str, found: list[Row], seeds: int, start: float) -> Result:
    return Result(
        name=name, settings={"seeds": seeds}, seconds=time.perf_counter() - start, rows=found
    )


def _over_time(
    name: str, study: Study, cases: Sequence[Case], drawn: str, seeds: int, jobs: int, out: Path
) -> Result:
    """Convergence from several starts: rows over seeds, and a picture of the first seed."""
    start = time.perf_counter()
    todo = [
        _run(study, case, "til", seed, share)
        for case in cases
        for share in STARTS
        for seed in range(seeds)
    ]
    values = np.array(parallel(_convergence, todo, jobs, name))
    values = values.reshape(len(cases), len(STARTS), seeds, len(study.parameters), 2)
    found = []
    for c, case in enumerate(cases):
        for s, share in enumerate(STARTS):
            for p, parameter in enumerate(study.parameters):
                what = f"{case.name}, from {share * variation()[parameter]:.4g} {UNITS[parameter]}"
                found += [
                    Row.over_seeds(
                        values[c, s, :, p, m], case=what, quantity=parameter, metric=metric,
                        unit=unit, estimator="til",
                    )
                    for m, (metric, unit) in enumerate(
                        (("time_to_10pct", "s"), ("worst_pct_last_half", "%"))
                    )
                ]  # fmt: skip
    _draw_over_time(out / f"{name}.png", study, cases, drawn)
    return _result(name, found, seeds, start)


def _convergence(run: Run) -> list[tuple[float, float]]:
    drive, estimate = observe(run)
    late = round(LAST * len(drive))
    found = []
    for name in find(run.study).parameters:
        truth = variation()[name]
        worst = 100.0 * np.abs(estimate[name][late:] - truth).max() / abs(truth)
        found.append((settling_time(estimate[name], truth, drive.dt), float(worst)))
    return found


def _draw_over_time(path: Path, study: Study, cases: Sequence[Case], drawn: str) -> None:
    count = len(cases) * len(study.parameters)
    title = f"{study.name}, from several starts"
    with pictures.figure(path, rows=count + 1, title=title) as axes:
        for case, name, axis in (
            (case, name, axes[len(study.parameters) * c + p])
            for c, case in enumerate(cases)
            for p, name in enumerate(study.parameters)
        ):
            truth = variation()[name]
            for share in STARTS:
                drive, estimate = observe(_run(study, case, "til", 0, share))
                axis.plot(
                    drive.time[::EVERY], estimate[name][::EVERY], label=f"from {share * truth:.4g}"
                )
            axis.axhspan(0.9 * truth, 1.1 * truth, color="0.9", label="within 10 %")
            axis.axhline(truth, color="k", lw=1, ls="--", label="truth")
            axis.set(ylabel=f"{name} [{UNITS[name]}]", title=case.name)
            axis.legend(ncols=3, fontsize="x-small")
        _draw_drive(axes[-1], study, drawn)


def _draw_drive(axis, study: Study, drawn: str) -> None:
    drive = real_drive(study.target, None)
    values, label = {
        "vx": (3.6 * drive.truth["vx"], "speed [km/h]"),
        "steering": (np.degrees(drive.channel("steering_wheel_angle")), "hand wheel [deg]"),
        "road": (100.0 * drive.channel("road_height_fl"), "road, front [cm]"),
    }[drawn]
    axis.plot(drive.time[:: EVERY // 5], values[:: EVERY // 5], color="k", lw=0.8)
    axis.set(xlabel="time [s]", ylabel=label)


def _errors(
    study: Study, cases: Sequence[Case], parameter: str, seeds: int, jobs: int
) -> dict[str, NDArray[np.float64]]:
    """Of each estimator, rms errors [%] of shape (cases, seeds)."""
    todo = [
        _run(study, case, estimator, seed, 0.0)
        for estimator in study.laws
        for case in cases
        for seed in range(seeds)
    ]
    column = study.parameters.index(parameter)
    values = np.array(scores(todo, jobs, study.name))[:, column, 0]
    return dict(zip(study.laws, values.reshape(len(study.laws), len(cases), seeds), strict=True))


def _rows(
    study: Study,
    cases: Sequence[Case],
    parameter: str,
    errors: dict[str, NDArray[np.float64]],
    paper: Sequence[float | None],
) -> list[Row]:
    law = study.laws["til"][study.parameters.index(parameter)]
    return [
        Row.over_seeds(
            values, case=case.name, quantity=parameter, metric="rms_pct", unit="%",
            estimator=estimator, paper=theirs, limit=limit(study, case, law, None),
        )
        for estimator, by_case in errors.items()
        for case, values, theirs in zip(cases, by_case, paper, strict=True)
    ]  # fmt: skip


def _over_noise(
    name: str, study: Study, case: Case, parameter: str, seeds: int, jobs: int, out: Path
) -> Result:
    """The error over the noise of the sensors: rows, and a picture."""
    start = time.perf_counter()
    cases = [
        replace(case, snr=snr, name=case.name.replace("noisy", f"SNR {snr:g} dB", 1)) for snr in SNR
    ]
    paper = {10.0: dict(case.paper)[parameter]}
    errors = _errors(study, cases, parameter, seeds, jobs)
    found = _rows(study, cases, parameter, errors, [paper.get(snr) for snr in SNR])
    with pictures.figure(out / f"{name}.png", title=f"Error of {parameter} over noise") as axis:
        _draw_errors(axis, SNR, errors, paper)
        bounds = [row.limit for row in found[: len(SNR)]]
        axis.plot(SNR, bounds, color="0.4", ls=":", label="Cramer-Rao bound of the rms")
        axis.set(xlabel="SNR [dB]", ylabel=f"rms error of {parameter} [%]")
        axis.legend(fontsize="small")
    return _result(name, found, seeds, start)


def _draw_errors(
    axis, x: Sequence[float], errors: dict[str, NDArray[np.float64]], paper: dict[float, float]
) -> None:
    for estimator, values in errors.items():
        pictures.spread(axis, x, values, label=estimator)
    axis.plot(*zip(*paper.items(), strict=True), "kx", label="the paper's tables")
    axis.axhline(LIMIT, color="k", lw=1, ls="--", label="what the paper accepts")
    axis.set(yscale="log")
    axis.legend(fontsize="small")
