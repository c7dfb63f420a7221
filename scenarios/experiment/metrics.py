"""How estimates are scored, figure by figure."""

import numpy as np
from numpy.typing import NDArray

from estimators.score import rms_pct, settling_time
from scenarios.experiment.experiment import Score, Trial, nominal_values
from twin import LOAD, SCALES

Array = NDArray[np.float64]

LAST = 60.0  # [s], over which the mass is scored
PAPERS_LAST = 10.0  # [s], TiL Eq. (26)


def parameter_errors(trial: Trial) -> list[Score]:
    """Rms error of each quantity [%] and time until it is below 10 % for good [s]: TiL Eq. (11)."""
    run, drive, estimate = trial
    variation = run.case.load()
    found = []
    for name in run.experiment.quantities:
        if name not in estimate.estimated:
            continue
        found += [
            Score(name, "rms_pct", "%", rms_pct(estimate[name], variation[name], drive.dt)),
            Score(
                name, "time_to_10pct", "s", settling_time(estimate[name], variation[name], drive.dt)
            ),
        ]
    return found


def sideslip_and_mass(trial: Trial) -> list[Score]:
    """Rms errors of sideslip [deg], mass over the last minute [kg] and lateral axle forces [N]."""
    _, drive, estimate = trial
    truth = drive.truth
    found = []
    if np.isfinite(estimate.sideslip).any():
        error = np.degrees(estimate.sideslip - truth["sideslip"])
        found.append(Score("sideslip", "rmse", "deg", rms(error)))
    if estimate.has("mass"):
        error = mass_error(trial)
        found += [
            Score("mass", f"rmse_last_{last:g}s", "kg", rms(error[-round(last / drive.dt) :]))
            for last in (LAST, PAPERS_LAST)
        ]
    for axle, (left, right) in {"front": ("fl", "fr"), "rear": ("rl", "rr")}.items():
        if not estimate.has(f"fy_{left}"):
            continue
        own = estimate[f"fy_{left}"] + estimate[f"fy_{right}"] + estimate[f"axle_force_{axle}"]
        true = truth[f"fy_{left}"] + truth[f"fy_{right}"]
        found.append(Score(f"fy_{axle}", "rmse", "N", rms(own - true)))
    return found


def mass_error(trial: Trial) -> Array:
    """(N,) of the chassis' mass [kg]."""
    return trial.estimate["mass"] - trial.run.case.load()["mass"]


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def true_deltas(trial: Trial) -> dict[str, Array]:
    """(N,) what each load parameter and scale of the real vehicle differs in from the twin's."""
    values = nominal_values(trial.run.case.twin)
    truth = trial.drive.truth
    return {name: truth[name] - values[name] for name in (*LOAD, *SCALES)}


def unit_of_error(variation: dict[str, float], name: str) -> float:
    """What 100 % is: of a load what it changes, of a scale its nominal value."""
    return abs(variation[name]) if name in LOAD else 1.0


def errors_at_end(trial: Trial) -> list[Score]:
    """Error and claimed standard deviation at the end, and how well the one fits the other."""
    run, drive, estimate = trial
    truth, variation = true_deltas(trial), run.case.load()
    found, covered = [], []
    for name in run.experiment.quantities:
        if name not in estimate.estimated:
            continue
        off, unit = estimate[name] - truth[name], unit_of_error(variation, name)
        found.append(Score(name, "pct", "%", 100.0 * abs(off[-1]) / unit))
        if estimate.sd is not None:
            sd = estimate.sd_of(name)[-1]
            covered.append(abs(off[-1]) <= 2.0 * sd)
            found += [
                Score(name, "claimed_sd_pct", "%", 100.0 * sd / unit),
                Score(name, "rmse_over_sd", "1", off[-1] / sd, "rms"),
            ]
        if estimate.valid is not None:
            found.append(Score(name, "valid", "1", float(estimate.valid_of(name)[-1]), "mean"))
        if name in LOAD and np.ptp(truth["mass"]) == 0.0:
            time = settling_time(off + variation[name], variation[name], drive.dt)
            found.append(Score(name, "time_to_10pct", "s", time))
    if covered:
        found.append(Score("all", "coverage", "1", float(np.mean(covered)), "mean"))
    return found


def load_change(trial: Trial) -> list[Score]:
    """As `errors_at_end`, and how a change of the load was met.

    After how many seconds of driving it was found, NaN if it was not, and the largest error from
    then on of a parameter that it does not touch, over its claimed standard deviation.
    """
    _, drive, estimate = trial
    truth = true_deltas(trial)
    found = errors_at_end(trial)
    change = np.flatnonzero(np.diff(truth["mass"]))[0]
    changes = getattr(estimate, "changes", None)
    if changes is not None:
        seen = np.flatnonzero(np.diff(changes))
        moving = np.cumsum(drive.truth["vx"] > 1.0) * drive.dt
        seconds = float(moving[seen[0]] - moving[change]) if seen.size else np.nan
        found.append(Score("load", "found_after", "s", seconds))
    if estimate.sd is not None:
        worst = [
            np.abs((estimate[n] - truth[n]) / estimate.sd_of(n))[change:].max()
            for n in SCALES
            if n in estimate.estimated
        ]
        found.append(Score("others", "worst_over_sd", "1", float(max(worst, default=np.nan))))
    return found
