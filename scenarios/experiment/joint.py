"""Everything at once: the joint observer on a drive, against every real vehicle.

The real vehicle of `same` is the twin's own model with the loads on board, an inverse crime; the
others of `scenarios.plants.mismatch` differ from it in what is estimated along or in what is not.
"""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from estimators.identifiability.cramer_rao import cramer_rao
from estimators.identifiability.report import report
from estimators.joint.observer import JointEstimate
from scenarios.driving import joint_drives
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import Manoeuvre
from scenarios.experiment import metrics
from scenarios.experiment.bounds import sensitivities_at
from scenarios.experiment.experiment import Case, Experiment, Recipe, Trial
from scenarios.experiment.plants import LoadChange, SimulatedCar
from scenarios.experiment.progress import progress
from twin import LOAD, OUTPUTS, SCALES, noise_sd

TWIN, REAL = "suv", "suv_loaded"
SNR = 10.0  # [dB], as in TiL
LOAD_CHANGE = "load-change"
MANOEUVRES: Mapping[str, Callable[..., Manoeuvre]] = {
    "mixed": joint_drives.mixed,
    "hard": joint_drives.hard,
    "straight": joint_drives.straight,
    "urban": urban,
}
NAMES = (*LOAD, *SCALES)  # estimated in all of them
BLOCK = 10  # samples
RECIPES = {"joint": Recipe(estimator="joint")}


def case(drive: str, mismatch: str) -> Case:
    """A real vehicle on a drive, a name of `MANOEUVRES` or `LOAD_CHANGE`."""
    plant: Any = LoadChange(car=TWIN, mismatch=mismatch)
    if drive != LOAD_CHANGE:
        plant = SimulatedCar(car=REAL, manoeuvre=MANOEUVRES[drive], mismatch=mismatch)
    return Case(name=f"{drive}, {mismatch}", plant=plant, twin=TWIN, snr=SNR)


def experiment(drive: str, recipes: Mapping[str, Recipe] = RECIPES) -> Experiment:
    """A drive of the twin's own model with loads on board."""
    return Experiment(
        name=drive,
        cases=(case(drive, "same"),),
        estimators=recipes,
        quantities=NAMES,
        metrics=metrics.load_change if drive == LOAD_CHANGE else metrics.errors_at_end,
        notes=notes,
        timeline="joint",
    )


def notes(trial: Trial) -> tuple[str, ...]:
    """What the drive did not make identifiable, in words."""
    return tuple(report(trial.estimate)) if isinstance(trial.estimate, JointEstimate) else ()


def bound(
    experiment: Experiment, case: Case, duration: float | None
) -> Mapping[tuple[str, str], float]:
    """The Cramer-Rao bound of all parameters together [%], for perfect sensors; takes a minute."""
    del experiment
    sds, load = _bound(case, duration), case.load()
    return {
        (name, "pct"): float(100.0 * sd / metrics.unit_of_error(load, name))
        for name, sd in zip(NAMES, sds, strict=True)
    }


@cache
def _bound(case: Case, duration: float | None) -> np.ndarray:
    """(p,) standard deviations.

    Means of ten samples stand for them, as the observer takes them: a tenth of the memory.
    """
    clean = case.plant.clean(duration)  # pyright: ignore[reportAttributeAccessIssue]
    n = len(clean) // BLOCK * BLOCK
    columns = [
        sensitivities_at(case, clean, [name])[0, :n]
        for name in progress(NAMES, "bound", len(NAMES))
    ]
    means = np.array([c.reshape(-1, BLOCK, len(OUTPUTS)).mean(axis=1) for c in columns])
    sd = noise_sd(clean.measurements, case.snr) / np.sqrt(BLOCK)
    return cramer_rao(NAMES, means, sd).joint
