"""Simulated trips are weighed: an i3 in traffic, with loads up to 300 kg (`til run weigh`).

The logs are those of a real car's bus: 10 Hz, a quantised speed, torques of unknown scale and
losses, brakes, slope and wind unknown. The car is calibrated from trips of its own without load.
"""

import sys
import time
from collections.abc import Sequence
from functools import partial

import numpy as np

from estimators.weigh.calibration import Calibration, Reference
from estimators.weigh.samples import samples_of
from estimators.weigh.trip import Trip
from estimators.weigh.weighing import weigh
from scenarios.experiment.experiment import Experiment, Study
from scenarios.experiment.progress import parallel
from scenarios.experiment.result import Result, Row
from scenarios.weighing.car import car_of
from scenarios.weighing.simulated import simulated_trip
from scenarios.weighing.study import everything, regression_of
from twin import Vehicle

VEHICLE = "bmw_i3"
LOADS = (0.0, 75.0, 150.0, 225.0, 300.0)  # [kg], one after the other over the seeds
REFERENCES = 10
FIRST_REFERENCE = 100_000  # seeds of the reference trips, beyond any of the user's
MINUTES = 12.0  # of every trip


def run(seeds: Sequence[int], jobs: int, duration: float | None) -> Result:
    """Weighs one trip for each seed."""
    start = time.perf_counter()
    minutes = MINUTES if duration is None else duration / 60.0
    vehicle = Vehicle.load(VEHICLE)
    car = car_of(vehicle)
    tasks = [(0.0, FIRST_REFERENCE + k) for k in range(REFERENCES)]
    tasks += [(LOADS[seed % len(LOADS)], seed) for seed in seeds]
    trips = parallel(partial(_trip, vehicle, minutes), tasks, jobs, "trips")
    known, new = trips[:REFERENCES], trips[REFERENCES:]
    loads = [load for load, _ in tasks[REFERENCES:]]
    calibration = everything(car, [Reference(name=t.name, samples=samples_of(t)) for t in known])
    weighed = _weighed(new, calibration)
    regression = regression_of(car, known, new)
    rows = [
        *_rows("weigh", [w[0] for w in weighed], [w[1] for w in weighed], loads),
        *_rows(
            "regression", [s.load for s in regression], [s.half_width for s in regression], loads
        ),
    ]
    return Result(
        name="weigh",
        settings={"seeds": list(seeds), "jobs": jobs, "duration": duration},
        seconds=time.perf_counter() - start,
        rows=rows,
    )


def _trip(vehicle: Vehicle, minutes: float, task: tuple[float, int]) -> Trip:
    return simulated_trip(vehicle, *task, minutes)


def _weighed(trips: Sequence[Trip], calibration: Calibration) -> list[tuple[float, float]]:
    """Loads and half widths of their intervals [kg]."""
    found = [weigh(trip, calibration) for trip in trips]
    return [(w.load, w.half_width) for w in found]


def _rows(
    estimator: str, found: Sequence[float], widths: Sequence[float], loads: Sequence[float]
) -> list[Row]:
    """Errors, coverage and half widths over the seeds."""
    error = np.abs(np.subtract(found, loads))
    case = f"loads of {LOADS[0]:.0f} to {LOADS[-1]:.0f} kg"
    metrics = (
        ("abs_error", "kg", error),
        ("coverage", "1", [float(np.mean(error <= widths))]),
        ("half_width", "kg", widths),
    )
    return [
        Row.over_seeds(
            values, case=case, quantity="load", metric=metric, unit=unit, estimator=estimator
        )
        for metric, unit, values in metrics
    ]


EXPERIMENT = Experiment(name="weigh", quantities=("load",), study=Study(run))


if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "weigh", *sys.argv[1:]]))
