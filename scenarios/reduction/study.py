"""Which entries of K matter, found without a choice by hand: `til reproduce til-reduction`.

After Delcaro, Dettu, Formentin and Savaresi, arXiv 2401.10945. Compared are

* `hand`: the entries chosen by hand, with the gains that ship, set by hand;
* `hand-tuned`: the same entries, tuned by Bayesian optimisation;
* `ensemble`: the optimal linear gain of an ensemble of cars in closed form, all entries;
* `ensemble-rank-7`: its largest combinations; `ensemble-thresholded`: its entries that matter;
* `sparse`: sparse regression of the errors on the innovations;
* `directions`: the ensemble's gain, each of three groups of its rows by a searched factor;
* `all-entries`: every entry on its own, by Bayesian optimisation without any ensemble.

All of them see the same cars and drives, and are reported on other cars and longer drives.
"""

import time
from collections.abc import Mapping, Sequence

import numpy as np

from scenarios.experiment.progress import parallel
from scenarios.experiment.reproduction import Clock, Making
from scenarios.experiment.result import Result, Row
from scenarios.reduction import cars
from scenarios.reduction.cost import MASS_METRIC, errors_of, run
from scenarios.reduction.picture import draw
from scenarios.reduction.ways import Found, ways

NAME = "til-reduction"
METRICS = (("sideslip", "rmse", "deg"), ("mass", MASS_METRIC, "kg"))
TUNED = "hand-tuned"  # what the others are compared with


def reduction(making: Making) -> Result:
    """Errors on held-out cars and drives, evaluations, entries and time of each way."""
    clock = Clock.started()
    seconds = making.duration or cars.TUNING_SECONDS
    start = time.perf_counter()
    drives = cars.ensemble(seconds)
    made = time.perf_counter() - start
    found = dict(ways(drives, made, seconds, making.jobs, making.out))
    held_out = {label: _held_out(label, way, making) for label, way in found.items()}
    rows = [row for label in found for row in _rows(label, held_out[label], held_out[TUNED])]
    for label, way in found.items():
        made_by = {"evaluations": way.evaluations, "entries": len(way.k()), "seconds": way.seconds}
        rows += [
            Row.over_seeds(
                [float(value)], case="made", quantity="K", metric=metric,
                unit="s" if metric == "seconds" else "1", estimator=label,
            )
            for metric, value in made_by.items()
        ]  # fmt: skip
    draw(
        making.out / f"{NAME}.png",
        {label: way.k() for label, way in found.items()},
        "K by each way, and how many of its entries are not zero",
    )
    return clock.result(
        NAME, making, rows, cars=list(cars.TUNING_CARS), of_limits=cars.OF_LIMITS,
        K={label: _written(way) for label, way in found.items()},
    )  # fmt: skip


def _held_out(label: str, way: Found, making: Making) -> Mapping[str, np.ndarray]:
    """(cars, 2) errors by drive: of as many held-out cars as there are seeds."""
    todo = [
        run(cars.HELD_OUT_CARS + seed, name, way.estimator, way.gains, making.duration)
        for name in cars.DRIVES
        for seed in making.seeds
    ]
    values = np.array(parallel(errors_of, todo, making.jobs, f"{NAME}, {label} held out"))
    return dict(zip(cars.DRIVES, values.reshape(len(cars.DRIVES), -1, 2), strict=True))


def _rows(
    label: str, own: Mapping[str, np.ndarray], tuned: Mapping[str, np.ndarray]
) -> Sequence[Row]:
    """Errors, the share of sound runs, and errors over those of the tuned gains, car by car."""
    rows = []
    for name, values in own.items():
        sound = float(np.mean(np.isfinite(values[:, 0])))
        figures = [("all", "share_sound", "1", np.array([sound]))]
        for k, (quantity, metric, unit) in enumerate(METRICS):
            over = values[:, k] / tuned[name][:, k]
            figures += [
                (quantity, metric, unit, values[:, k]),
                (quantity, "over_tuned", "1", over),
            ]
        rows += [
            Row.over_seeds(
                found, case=f"{name}, held out", quantity=quantity, metric=metric, unit=unit,
                estimator=label,
            )
            for quantity, metric, unit, found in figures
        ]  # fmt: skip
    return rows


def _written(way: Found) -> dict[str, float]:
    return {name: float(f"{value:.4g}") for name, value in way.gains}
