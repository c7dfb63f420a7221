"""What gains cost on the tuning cars, and how they do on others."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from scenarios.experiment.engine import score
from scenarios.experiment.experiment import Experiment, Run, Score, Trial
from scenarios.experiment.metrics import mass_error, rms
from scenarios.experiment.sideslip_and_mass import (
    MASS_SHARE,
    RECIPES,
    SIDESLIP,
    TWIN,
    DriveName,
    wheels_of,
)
from scenarios.reduction import cars, laws
from scenarios.reduction.laws import Named
from twin import TwinError

MASS_METRIC = "rmse_second_half"
HAND, ENTRIES = "hand", "entries"  # estimators: gains by the hand-chosen names, or entries of K


def errors(trial: Trial) -> list[Score]:
    """Rms errors of the sideslip [deg], and of the mass over the second half of the drive [kg]."""
    _, drive, estimate = trial
    sideslip = np.degrees(estimate.sideslip - drive.truth["sideslip"])
    return [
        Score("sideslip", "rmse", "deg", rms(sideslip)),
        Score("mass", MASS_METRIC, "kg", rms(mass_error(trial)[len(drive) // 2 :])),
    ]


EXPERIMENT = Experiment(
    name="til-reduction",
    estimators={HAND: RECIPES["til"], ENTRIES: laws.ENTRIES},
    quantities=("sideslip", "mass"),
    metrics=errors,
)


@dataclass(frozen=True, slots=True)
class TuningCost:
    """Mean over the tuning cars and drives; 0.1 deg and 1 % of the car's mass count as one.

    Attributes:
        estimator: of `EXPERIMENT`.
        law: makes a run's gains of what is searched.
        seconds: of each drive.
    """

    estimator: str
    law: Callable[[Mapping[str, float]], Named]
    seconds: float

    def __call__(self, values: Mapping[str, float]) -> float:
        """The cost.

        Raises:
            TwinError: the gains blow the twin up.
        """
        gains, unit = self.law(values), MASS_SHARE * wheels_of(TWIN).mass
        found = []
        for name in cars.DRIVES:
            for seed in cars.TUNING_CARS:
                sideslip, mass = score(run(seed, name, self.estimator, gains, self.seconds))[0]
                found.append(sideslip.value / SIDESLIP + mass.value / unit)
        return float(np.mean(found))


def run(seed: int, drive: DriveName, estimator: str, gains: Named, seconds: float | None) -> Run:
    """One drawn car on a drive, the noise of the same seed as the car."""
    return Run(
        experiment=EXPERIMENT, case=cars.case(seed, drive), estimator=estimator, seed=seed,
        duration=seconds, gains=gains,
    )  # fmt: skip


def errors_of(one: Run) -> tuple[float, float]:
    """Sideslip [deg] and mass [kg]; NaN where the gains blow the twin up."""
    try:
        sideslip, mass = score(one)[0]
    except TwinError:
        return np.nan, np.nan
    return sideslip.value, mass.value
