"""TiL Tables 3 and 4, Figures 4 and 5: the paper's figures beside ours."""

import time
from pathlib import Path

import numpy as np

from estimators.score import settling_time
from scenarios import mass, pictures
from scenarios.progress import parallel
from scenarios.result import Result, Row
from twin import Vehicle

INITIAL = (-200.0, 0.0, 355.0, 655.0, 955.0)  # delta of the mass at the start [kg], TiL Figure 4
SNR = (5.0, 7.5, 10.0, 12.5, 15.0, 17.5, 20.0)  # [dB], TiL Figure 5
LATE = 60.0  # [s], from when on the worst error counts


def table_3(seeds: int, jobs: int, out: Path) -> Result:
    """Our loaded chassis beside the paper's, which no point masses of Table 2 can give."""
    start = time.perf_counter()
    real, nominal = Vehicle.load("suv_loaded").chassis(), Vehicle.load("suv").chassis()
    # d is measured from the front axle and the road: where the chassis frame stands
    place = np.array([-1.25, 0.0, 0.644])
    quantities = (
        ("mass", "kg", real.mass, 2480.8),
        ("Jxx", "kg m2", real.inertia[0, 0], 901.9),
        ("Jyy", "kg m2", real.inertia[1, 1], 4394.4),
        ("Jzz", "kg m2", real.inertia[2, 2], 4760.0),
        ("cm_x", "cm", 100.0 * (real.cm + place)[0], -131.6),
        ("cm_y", "cm", 100.0 * (real.cm + place)[1], 1.6),
        ("cm_z", "cm", 100.0 * (real.cm + place)[2], 68.4),
    )
    rows = [
        Row.over_seeds(
            [value], case="loaded chassis", quantity=name, metric="value", unit=unit,
            estimator="model", paper=paper,
        )
        for name, unit, value, paper in quantities
    ]  # fmt: skip
    return Result(
        name="til-table-3",
        settings={"nominal_mass": nominal.mass},
        seconds=time.perf_counter() - start,
        rows=rows,
    )


def table_4(seeds: int, jobs: int, out: Path) -> Result:
    """TiL Table 4."""
    start = time.perf_counter()
    rows = mass.rows(mass.TABLE_4, tuple(range(seeds)), jobs, None)
    return Result(
        name="til-table-4",
        settings={"seeds": seeds},
        seconds=time.perf_counter() - start,
        rows=rows,
    )


def figure_4(seeds: int, jobs: int, out: Path) -> Result:
    """TiL Figure 4: the mass over time from several initial errors, sensors noisy, CM known."""
    start = time.perf_counter()
    case = mass.TABLE_4[1]
    runs = [
        mass.Run(law="til", case=case, seed=seed, initial=initial, duration=None)
        for initial in INITIAL
        for seed in range(seeds)
    ]
    scores = np.array(parallel(_convergence, runs, jobs, "figure 4")).reshape(
        len(INITIAL), seeds, 2
    )
    rows = []
    for initial, values in zip(INITIAL, scores, strict=True):
        what = {"case": f"from {initial:g} kg", "quantity": "mass", "estimator": "til"}
        rows += [
            Row.over_seeds(values[:, 0], metric="time_to_10pct", unit="s", **what),
            Row.over_seeds(values[:, 1], metric="worst_pct_after_60s", unit="%", **what),
        ]
    _draw_4([run for run in runs if run.seed == 0], out / "til-figure-4.png")
    return Result(
        name="til-figure-4",
        settings={"seeds": seeds, "snr": case.snr},
        seconds=time.perf_counter() - start,
        rows=rows,
    )


def _convergence(run: mass.Run) -> tuple[float, float]:
    drive, estimate = mass.observe(run)
    truth = mass.variation()["mass"]
    late = estimate["mass"][drive.time >= LATE] - truth
    return (
        settling_time(estimate["mass"], truth, drive.dt),
        float(100.0 * np.abs(late).max() / truth),
    )


def _draw_4(runs: list[mass.Run], path: Path) -> None:
    truth = mass.variation()["mass"]
    with pictures.figure(path, rows=2, title="Mass in town, SNR 10 dB, CM known") as (above, below):
        for run in runs:
            drive, estimate = mass.observe(run)
            above.plot(drive.time[::50], estimate["mass"][::50], label=f"from {run.initial:g} kg")
        above.axhspan(0.9 * truth, 1.1 * truth, color="0.9", label="within 10 %")
        above.axhline(truth, color="k", lw=1, ls="--", label=f"truth, {truth:g} kg")
        above.set(ylabel="mass added [kg]")
        above.legend(ncols=2, fontsize="small")
        below.plot(drive.time[::50], 3.6 * drive.truth["vx"][::50], color="k")
        below.set(xlabel="time [s]", ylabel="speed [km/h]")


def figure_5(seeds: int, jobs: int, out: Path) -> Result:
    """TiL Figure 5: the error of the mass over the noise of the sensors."""
    start = time.perf_counter()
    paper = {10.0: 1.61}
    cases = [mass.Case(snr=snr, cm_known=True, paper=paper.get(snr)) for snr in SNR]
    runs = [
        mass.Run(law=law, case=case, seed=seed, initial=0.0, duration=None)
        for law in mass.LAWS
        for case in cases
        for seed in range(seeds)
    ]
    scores = np.array(parallel(mass.score, runs, jobs, "figure 5"))[:, 0]
    scores = scores.reshape(len(mass.LAWS), len(cases), seeds)
    rows = [
        Row.over_seeds(
            values, case=f"SNR {case.snr:g} dB, correct CM", quantity="mass", metric="rms_pct",
            unit="%", estimator=law, paper=case.paper,
        )
        for law, by_case in zip(mass.LAWS, scores, strict=True)
        for case, values in zip(cases, by_case, strict=True)
    ]  # fmt: skip
    with pictures.figure(out / "til-figure-5.png", title="Error of the mass over noise") as axes:
        for law, values in zip(mass.LAWS, scores, strict=True):
            pictures.spread(axes, SNR, values, label=law)
        axes.plot(*zip(*paper.items(), strict=True), "kx", label="the paper, Table 4")
        axes.axhline(10.0, color="k", lw=1, ls="--", label="the paper's limit")
        axes.set(xlabel="SNR [dB]", ylabel="rms error of the mass [%]", yscale="log")
        axes.legend(fontsize="small")
    return Result(
        name="til-figure-5",
        settings={"seeds": seeds},
        seconds=time.perf_counter() - start,
        rows=rows,
    )
