"""Ways to gains: chosen by hand, from the ensemble in closed form, by regression, by search."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimators.til import ensemble_gain, state_and_mass
from estimators.til.ensemble_gain import EnsembleGain
from estimators.til.forecast_errors import BLOCK, CORRECTED, ForecastErrors
from scenarios.experiment.experiment import Gain
from scenarios.experiment.progress import parallel
from scenarios.experiment.sideslip_and_mass import BOUNDS, TWIN, gains_of
from scenarios.reduction import laws
from scenarios.reduction.cost import ENTRIES, HAND, TuningCost
from scenarios.reduction.laws import Named
from scenarios.tuning.tune import Objective, search
from twin import TwinError

Array = NDArray[np.float64]

THRESHOLDS = (0.2, 0.4, 0.6, 0.8)  # of an entry's share
PENALTIES = (0.4, 0.6, 0.7, 0.8)
RANK = 7
EVALUATIONS = 80  # of a search by entries
FEW, FIRST = 8, 4  # of one along directions, and how many of these before the first surrogate
WORST = 1e3
GROUPS = (("vx", "vy", "vz"), ("roll_rate", "pitch_rate", "yaw_rate"), ("wheel_speed",))
LARGEST_RATE = 200.0  # [1/s], of an entry that is searched for without an ensemble; chosen


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What one way found.

    Attributes:
        estimator: of `cost.EXPERIMENT`.
        gains: of a run.
        evaluations: of the cost on the tuning cars that it took.
        seconds: that it took.
    """

    estimator: str
    gains: Named
    evaluations: int
    seconds: float

    def k(self) -> dict[tuple[str, str], float]:
        """Entries of K that are not zero."""
        values = dict(self.gains)
        k = state_and_mass.state_gains(values) if self.estimator == HAND else laws.k_of(values)
        return {at: value for at, value in k.items() if value != 0.0}


def ways(
    drives: Sequence[ForecastErrors], made: float, seconds: float, jobs: int, out: Path
) -> Iterator[tuple[str, Found]]:
    """Every way by its name.

    Args:
        drives: errors of the ensemble.
        made: how long these took [s].
        seconds: of each drive that is tuned on.
        jobs: processes.
        out: folder for journals.
    """
    shipped = gains_of(TWIN, "til")
    yield HAND, Found(estimator=HAND, gains=laws.itself(shipped), evaluations=0, seconds=0.0)
    own = tuple(Gain(n, low, high, shipped[n]) for n, (low, high) in BOUNDS["til"].items())
    by_hand = TuningCost(HAND, laws.itself, seconds)
    yield "hand-tuned", _searched(by_hand, own, "hand-tuned", EVALUATIONS, jobs, out)
    start = time.perf_counter()
    both = ensemble_gain.mirrored(drives)
    model = ensemble_gain.error_model(both)
    whole = ensemble_gain.optimal_gain(model)
    law = {"noise_density": float(np.sqrt(model.noise[0, 0] * BLOCK)), "drift": laws.DRIFT}
    made += time.perf_counter() - start
    full = laws.named(whole.gain, law)
    yield "ensemble", Found(estimator=ENTRIES, gains=full, evaluations=0, seconds=made)
    low = laws.named(ensemble_gain.of_rank(whole, RANK), law)
    yield f"ensemble-rank-{RANK}", Found(estimator=ENTRIES, gains=low, evaluations=0, seconds=made)
    cut = [laws.named(ensemble_gain.kept_entries(whole, t), law) for t in THRESHOLDS]
    yield "ensemble-thresholded", _best_of(cut, made, seconds, jobs)
    sparse = [laws.named(ensemble_gain.sparse_gain(both, p), law) for p in PENALTIES]
    yield "sparse", _best_of(sparse, made, seconds, jobs)
    along = laws.Directions(_parts(whole), tuple(law.items()))
    cost = TuningCost(ENTRIES, along, seconds)
    yield "directions", _searched(cost, along.gains(), "directions", FEW, jobs, out, FIRST, made)
    every = laws.AllEntries(_unit(whole), ensemble_gain.mirror_pairs(), tuple(law.items()))
    cost = TuningCost(ENTRIES, every, seconds)
    yield "all-entries", _searched(cost, every.gains(), "all-entries", EVALUATIONS, jobs, out)


def _searched(
    cost: TuningCost,
    gains: Sequence[Gain],
    label: str,
    evaluations: int,
    jobs: int,
    out: Path,
    first: int = 12,
    made: float = 0.0,
) -> Found:
    start = time.perf_counter()
    objective = Objective(
        name=f"til-reduction {label}", gains=tuple(gains), cost=cost, metric="cost", unit="1",
        worst=WORST, first=first,
    )  # fmt: skip
    tuned = search(objective, evaluations, jobs, out / f"til-reduction-{label}.journal")
    took = made + time.perf_counter() - start
    return Found(
        estimator=cost.estimator, gains=cost.law(tuned.evaluated), evaluations=tuned.evaluations,
        seconds=took,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _CostOf:
    """The cost of gains as they are, infinite where they blow the twin up; can be pickled."""

    seconds: float

    def __call__(self, gains: Named) -> float:
        try:
            return TuningCost(ENTRIES, laws.itself, self.seconds)(dict(gains))
        except TwinError:
            return np.inf


def _best_of(candidates: Sequence[Named], made: float, seconds: float, jobs: int) -> Found:
    """The best of some candidates on the tuning cars."""
    start = time.perf_counter()
    costs = parallel(_CostOf(seconds), candidates, jobs, "")
    return Found(
        estimator=ENTRIES, gains=candidates[int(np.argmin(costs))], evaluations=len(candidates),
        seconds=made + time.perf_counter() - start,
    )  # fmt: skip


def _parts(whole: EnsembleGain) -> Array:
    """(r, n, ny) the gain by groups of states, what is in none the last."""
    inside = np.array([[name.startswith(group) for name in CORRECTED] for group in GROUPS])
    rows = np.vstack([inside, ~inside.any(axis=0)])
    return rows[:, :, None] * whole.gain


def _unit(whole: EnsembleGain) -> Array:
    """(n, ny) what an entry can be: so quick that its state follows its output's whole error."""
    states, outputs = np.sqrt(np.diag(whole.error)), np.sqrt(np.diag(whole.innovation))
    return LARGEST_RATE * BLOCK * states[:, None] / outputs
