"""Tunes the observers of sideslip and mass, TiL Section 5.

On the mismatched car, with noise seeds that no result is reported on. Two costs:

* "paper", TiL Eq. (26): over a lap, from the paper's initial error, 10 times the rms of the
  sideslip's error [deg] (k_beta = 100 stands inside the root) plus the rms of the mass's over the
  last 10 s [kg]. It can be met by a mass that happens to pass the truth at the end.
* "robust", ours: rms of the sideslip's error over 0.1 deg plus that of the mass's over the last
  minute over 1 % of the car's mass; the mean over a lap and lane changes, each from two initial
  errors of either sign.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenarios.cli.catalogue import Tuning
from scenarios.experiment import state_study
from scenarios.experiment.result import Result
from scenarios.experiment.state_study import BOUNDS, MISSING, Run, score
from scenarios.tuning import gains as gains_file
from scenarios.tuning.tune import Gain, Objective, search, tuning_rows, with_bounds
from twin import TwinError

SEED = 1000
LAP = 105.0  # [s]: a lap
COSTS = ("robust", "paper")
STARTS = {"robust": (MISSING, 200.0), "paper": (MISSING,)}  # [kg]
DURATIONS = {"laps": LAP, "lane-change": 80.0}  # [s]
SIDESLIP, MASS_SHARE = 0.1, 0.01  # [deg], [-]: errors that count as one
K_BETA = 100.0  # TiL Eq. (26)
WORST = {"robust": 1e3, "paper": 1e4}


@dataclass(frozen=True, slots=True)
class Cost:
    """See the module."""

    case: str
    estimator: str
    cost: str

    def __call__(self, values: Mapping[str, float]) -> float:
        """The cost of gains by their names.

        Raises:
            TwinError: they blow the observer up.
        """
        drives = DURATIONS if self.cost == "robust" else {"laps": LAP}
        todo = [
            Run(
                case=self.case,
                drive=drive,
                estimator=self.estimator,
                seed=SEED,
                start=start,
                duration=duration,
                gains=tuple(values.items()),
            )
            for drive, duration in drives.items()
            for start in STARTS[self.cost]
        ]
        mass = float(state_study.wheels_of_car(state_study.twin_of(self.case)).mass)
        found = [score(run) for run in todo]
        if self.cost == "paper":
            return float(
                np.mean([np.sqrt(K_BETA) * one.sideslip + one.mass_last_10s for one in found])
            )
        return float(
            np.mean([one.sideslip / SIDESLIP + one.mass / (MASS_SHARE * mass) for one in found])
        )


def run(case: str, tuning: Tuning) -> Result:
    """Tunes one observer and writes its gains as TOML.

    Raises:
        TwinError: no such estimator or cost, or bounds are wrong.
    """
    estimator, cost = tuning.estimator, tuning.cost or "robust"
    if estimator not in BOUNDS:
        raise TwinError(f"tune: estimator is {estimator!r}; allowed: {', '.join(BOUNDS)}")
    if cost not in COSTS:
        raise TwinError(f"tune: cost is {cost!r}; allowed: {', '.join(COSTS)}")
    start = time.perf_counter()
    car = state_study.twin_of(case)
    objective = Objective(
        name=f"{case} {estimator}",
        gains=with_bounds(_gains(car, estimator), tuning.bounds),
        cost=Cost(case, estimator, cost),
        metric=f"{cost}_cost",
        unit="1",
        worst=WORST[cost],
    )
    tuned = search(objective, tuning.evaluations, tuning.jobs, tuning.journal)
    made = {
        "tuning": "til tune laps",
        "real_vehicle": case,
        "metric": objective.metric,
        "seed": SEED,
        "snr": state_study.SNR,
        "starts": list(STARTS[cost]),
        "seconds": list(DURATIONS.values()) if cost == "robust" else [LAP],
        "bounds": {gain.name: [gain.low, gain.high] for gain in objective.gains},
    }
    gains_file.write(tuning.path, vehicle=car, estimator=estimator, tuned=tuned, made=made)
    return Result(
        name="tune laps",
        settings={"estimator": estimator, "evaluations": tuned.evaluations, **made},
        seconds=time.perf_counter() - start,
        rows=tuning_rows(objective, tuned, estimator),
    )


# Where a search starts that has no gains yet: a prototype's, by hand
UNTUNED: Mapping[str, Mapping[str, float]] = {
    "til": {
        "wheel_speed": 100.0,
        "ax_vx": 1e-3,
        "ay_vy": 0.05,
        "pitch_rate": 50.0,
        "yaw_rate": 50.0,
        "yaw_rate_vy": 50.0,
        "noise_density": 0.063,
        "drift": 0.22,
    },
    # TiL Table 8's, as continuous gains
    "til-paper": {
        "wheel_speed": 0.259,
        "ax_vx": 3.287e-3,
        "ay_vy": 7.43e-2,
        "pitch_rate": 0.913,
        "yaw_rate": 1.046,
        "mass": 248.17,
    },
    "double-track": {"ax_vx": 9.282e-2, "ay_vy": 5.271e-2, "yaw_rate": 0.314, "mass": 2.06},
}


def _gains(car: str, estimator: str) -> list[Gain]:
    today = UNTUNED[estimator]
    if (gains_file.FOLDER / f"{car}-{estimator}.toml").is_file():
        today = state_study.gains_of(car, estimator)
    return [
        Gain(name=name, low=low, high=high, today=today[name])
        for name, (low, high) in BOUNDS[estimator].items()
    ]
