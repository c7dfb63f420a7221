"""A real car is weighed: the loads of a BMW i3 from everyday trips (`til run i3`).

The trips are those of "Battery and Heating Data in Real Driving Cycles" (Technical University of
Munich, IEEE DataPort, 2020), one Parquet file each, in the folder that BMW_I3 names; they are not
shipped. The owners' list notes a load on two of the trips here, beyond the usual driver. These two
are held out: nothing was chosen by them. All others count as the driver alone.
"""

import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

import models
from estimators.weigh.calibration import Calibration, Reference
from estimators.weigh.samples import samples_of
from estimators.weigh.trip import Trip
from estimators.weigh.weighing import weigh
from scenarios.experiment.experiment import Experiment, Study
from scenarios.experiment.result import Result, Row
from scenarios.weighing.car import Car, car_of
from scenarios.weighing.logs import read_trips
from scenarios.weighing.picture import draw
from scenarios.weighing.study import (
    CLOSE,
    Scored,
    as_scored,
    by_regression,
    by_twin,
    cross_validated,
    everything,
    seconds_to_stay,
)
from twin import TwinError, Vehicle

VEHICLE = "bmw_i3"
MAP = "maps/bmw_i3.toml"
VARIABLE = "BMW_I3"
HELD_OUT = {"TripB22": 80.0, "TripB33": 160.0}  # [kg], as the owners note them
LONG = 600.0  # [s]
# Trips of the two seasons by what their names start with
SEASONS = {"summer": "TripA", "winter": "TripB"}


def folder() -> Path:
    """Where the trips lie.

    Raises:
        TwinError: BMW_I3 names no folder with trips.
    """
    place = os.environ.get(VARIABLE, "")
    if not place or not any(Path(place).glob("Trip*.parquet")):
        raise TwinError(
            f"{VARIABLE}: is {place!r}; allowed: a folder with the trips of the data set, as "
            "TripA01.parquet"
        )
    return Path(place)


def load_trips(jobs: int = 1) -> tuple[Car, list[Trip], list[Trip]]:
    """The car, its reference trips and those that are held out, in order of their names.

    Raises:
        TwinError: the data are not there, or a trip cannot be read.
    """
    car = car_of(Vehicle.load(VEHICLE))
    paths = sorted(folder().glob("Trip*.parquet"))
    read = read_trips(paths, models.path(MAP), car.radius, jobs)
    trips = []
    for one in read:
        if isinstance(one, TwinError):
            raise one
        trips.append(one)
    references = [trip for trip in trips if trip.name not in HELD_OUT]
    return car, references, [trip for trip in trips if trip.name in HELD_OUT]


def run(seeds: Sequence[int], jobs: int, duration: float | None) -> Result:
    """Weighs every trip by all others, with the baseline and the twin's own answer beside it."""
    start = time.perf_counter()
    if duration is not None:
        raise TwinError("i3: takes no duration; the trips are weighed whole")
    car, trips, held_out = load_trips(jobs)
    weighings, calibrations = cross_validated(car, trips, jobs)
    calibration = _all(car, trips)
    new = [weigh(trip, calibration) for trip in held_out]
    found = {
        "weigh": as_scored([*weighings, *new]),
        "regression": by_regression(car, trips, held_out),
        "til": by_twin(Vehicle.load(VEHICLE), car, trips, held_out, calibration, jobs),
    }
    heavy = _unnoted(trips, calibration)
    rows = [row for name, scored in found.items() for row in _rows(name, scored, trips, heavy)]
    alone = [i for i, trip in enumerate(trips) if trip.name not in heavy]
    seconds = [seconds_to_stay(trips[i], calibrations[i], 0.0) for i in alone]
    rows.append(_row("weigh", f"load within {CLOSE:.0f} kg", "time", "s", seconds))
    report = [
        f"Seem to carry a load that was not noted: {', '.join(heavy)}.",
        *(f"{w.name} is not believed: {w.reason}." for w in [*weighings, *new] if w.reason),
    ]
    return Result(
        name="i3",
        settings={"seeds": list(seeds), "jobs": jobs, "duration": duration} | {"notes": report},
        seconds=time.perf_counter() - start,
        rows=rows,
    )


def _all(car: Car, trips: Sequence[Trip]) -> Calibration:
    return everything(car, [Reference(name=t.name, samples=samples_of(t)) for t in trips])


def _unnoted(trips: Sequence[Trip], calibration: Calibration) -> list[str]:
    """Names of the trips that are not as declared, by the mixture over all of them."""
    used = [w for w in (weigh(trip, calibration) for trip in trips) if "disagree" not in w.reason]
    pairs = zip(used, calibration.scatter.as_declared, strict=True)
    return [w.name for w, probability in pairs if probability < 0.5]


def _rows(
    estimator: str, scored: Mapping[str, Scored], trips: Sequence[Trip], heavy: Sequence[str]
) -> list[Row]:
    """Scatter and coverage over the trips, with and without the heavy ones; the held-out trips."""
    groups: dict[str, Callable[[Trip], bool]] = {
        "all trips": lambda trip: True,
        "driver alone": lambda trip: trip.name not in heavy,
        "unnoted": lambda trip: trip.name in heavy,
    }
    rows = []
    for group, belongs in groups.items():
        chosen = [scored[trip.name] for trip in trips if belongs(trip)]
        trusted = [one for one in chosen if one.believable]
        inside = [abs(one.load) <= one.half_width for one in trusted]
        rows.append(_row(estimator, group, "share_believed", "1", [len(trusted) / len(chosen)]))
        rows.append(_row(estimator, group, "coverage", "1", [float(np.mean(inside))]))
        rows.append(_row(estimator, group, "half_width", "kg", [one.half_width for one in trusted]))
        for season, prefix in SEASONS.items():
            loads = [
                scored[trip.name].load
                for trip in trips
                if belongs(trip)
                and trip.name.startswith(prefix)
                and trip.duration >= LONG - 1.0
                and scored[trip.name].believable
            ]
            case = f"{group}, {season}"
            if len(loads) > 1:
                rows.append(_row(estimator, case, "mean", "kg", [float(np.mean(loads))]))
                rows.append(_row(estimator, case, "sd", "kg", [float(np.std(loads, ddof=1))]))
    for name, truth in HELD_OUT.items():
        if name in scored:
            one, case = scored[name], f"{name}, {truth:+.0f} kg"
            rows.append(_row(estimator, case, "load", "kg", [one.load]))
            rows.append(_row(estimator, case, "error", "kg", [one.load - truth]))
            rows.append(_row(estimator, case, "half_width", "kg", [one.half_width]))
    return rows


def _row(estimator: str, case: str, metric: str, unit: str, values: Sequence[float]) -> Row:
    return Row.over_seeds(
        values, case=case, quantity="load", metric=metric, unit=unit, estimator=estimator
    )


def picture(path: Path, jobs: int) -> None:
    """Load and interval of every trip, each weighed by the others."""
    car, trips, held_out = load_trips(jobs)
    weighings, _ = cross_validated(car, trips, jobs)
    calibration = _all(car, trips)
    everyone = [*weighings, *(weigh(trip, calibration) for trip in held_out)]
    notes = {name: f"noted: {load:+.0f} kg" for name, load in HELD_OUT.items()}
    draw(
        path,
        sorted(everyone, key=lambda w: w.name),
        notes,
        title="BMW i3: load of each trip, weighed by the other trips",
    )


EXPERIMENT = Experiment(name="i3", quantities=("load",), study=Study(run, picture))


if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "i3", *sys.argv[1:]]))
