"""`til weigh`: what each of many logs weighs, as text, JSON and a picture."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from estimators.weigh.calibration import (
    LEAST_AGREEMENT,
    Calibration,
    Reference,
    anchored,
    calibrate,
)
from estimators.weigh.trip import Trip
from estimators.weigh.weighing import PROBABILITY, Weighing, weigh
from scenarios.experiment.result import versions
from scenarios.weighing.calibration_file import Origin, write_calibration
from scenarios.weighing.car import MASS_SD, Car, car_of, check_car, known_calibration
from scenarios.weighing.logs import Log, read_trips, references_of
from scenarios.weighing.picture import draw
from twin import TwinError, Vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What the command line asks for.

    Attributes:
        logs: to weigh.
        vehicle: the car, by its name or file.
        map_path: which channels of the logs are ours; None: they are drives of ours.
        references: trips of known load: they move the scale of the calibration, or make one.
        calibration: file to take instead of the car's own; None: the car's own, if it has one.
        learnt: file for a calibration that is learnt anew from the references; None: none is.
        notes: words for the picture, by the log's name.
        picture: PNG to draw; None: none.
        jobs: logs read side by side.
    """

    logs: Sequence[Path]
    vehicle: str
    map_path: Path | None = None
    references: Sequence[Log] = ()
    calibration: Path | None = None
    learnt: Path | None = None
    notes: Mapping[str, str]
    picture: Path | None = None
    jobs: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of a task.

    Attributes:
        weighings: of the logs that could be read.
        sentences: about the reference trips.
        errors: one line for each log that could not be read.
        seconds: it took [s].
    """

    weighings: Sequence[Weighing]
    sentences: Sequence[str]
    errors: Sequence[str]
    seconds: float


def run(task: Task) -> Outcome:
    """Weighs the logs.

    Raises:
        TwinError: the car, the map, the calibration or a reference is missing or broken; or there
            is no calibration and there are no references.
    """
    start = time.perf_counter()
    vehicle = Vehicle.load(task.vehicle)
    car = car_of(vehicle)
    calibration, sentences = _calibration(task, vehicle, car)
    trips = read_trips(task.logs, task.map_path, car.radius, task.jobs)
    weighings = [weigh(trip, calibration) for trip in trips if isinstance(trip, Trip)]
    errors = [" ".join(str(trip).split()) for trip in trips if isinstance(trip, TwinError)]
    if task.picture:
        draw(task.picture, weighings, task.notes, title=f"{car.name}: load of each trip")
    return Outcome(
        weighings=weighings,
        sentences=sentences,
        errors=errors,
        seconds=time.perf_counter() - start,
    )


def _calibration(task: Task, vehicle: Vehicle, car: Car) -> tuple[Calibration, list[str]]:
    references = references_of(task.references, task.map_path, car.radius)
    if task.learnt:
        calibration = calibrate(
            references, mass=car.mass, mass_sd=MASS_SD, rotating_mass=car.rotating_mass
        )
        sentences = about_references(references, calibration)
        origin = Origin(vehicle=car.name, logs=[r.name for r in references], notes=sentences)
        write_calibration(task.learnt, calibration, origin)
        return calibration, sentences
    calibration = known_calibration(vehicle, task.calibration)
    if calibration is None:
        raise TwinError(
            f"{car.name}: has no calibration for weighing; allowed: --calibration FILE, or "
            "--reference trips of known load with --calibrate FILE"
        )
    check_car(car, calibration)
    if not references:
        return calibration, []
    moved = anchored(calibration, references)
    change = 100.0 * (moved.scatter.scale / calibration.scatter.scale - 1.0)
    sentence = f"The scale moves by {change:+.2f} % to that of the references, {len(references)}."
    return moved, [sentence]


def about_references(references: Sequence[Reference], calibration: Calibration) -> list[str]:
    """Sentences about references that are not as they were declared."""
    disagree = [r.name for r in references if not r.samples.agreement >= LEAST_AGREEMENT]
    sentences = [f"{name}: not used, speed and accelerometer disagree." for name in disagree]
    used = [r.name for r in references if r.name not in disagree]
    sentences += [
        f"{name}: seems to carry a load that was not noted, probability {1.0 - p:.2f}."
        for name, p in zip(used, calibration.scatter.as_declared, strict=False)
        if p < 0.5
    ]
    return sentences


def as_text(outcome: Outcome) -> str:
    """One line for each trip."""
    width = max((len(w.name) for w in outcome.weighings), default=4)
    head = f"{'trip':<{width}}  total kg  load kg  +- kg  used min  believable"
    lines = [head, "-" * len(head)]
    for w in outcome.weighings:
        lines.append(
            f"{w.name:<{width}}  {w.mass:8.0f}  {w.load:+7.0f}  {w.half_width:5.0f}  "
            f"{w.seconds / 60.0:8.1f}  {'yes' if w.believable else 'no: ' + w.reason}"
        )
    lines.append(f"+- is half the interval that holds the load with {PROBABILITY:.0%}.")
    return "\n".join([*lines, *outcome.sentences])


def as_json(task: Task, outcome: Outcome) -> dict[str, Any]:
    """The outcome for machines: an entry for each log, shaped as that of every user's log."""
    return {
        "name": "weigh",
        "settings": {
            "vehicle": task.vehicle,
            "map": None if task.map_path is None else str(task.map_path),
            "references": [[str(log.path), log.load] for log in task.references],
        },
        "versions": versions(),
        "seconds": outcome.seconds,
        "logs": [_entry(task, w) for w in outcome.weighings],
        "errors": list(outcome.errors),
        "notes": list(outcome.sentences),
    }


def _entry(task: Task, w: Weighing) -> dict[str, Any]:
    known = w.half_width < float("inf") and w.mass == w.mass
    estimates = [
        {
            "name": name,
            "value": value if known else None,
            "low_95": value - w.half_width if known else None,
            "high_95": value + w.half_width if known else None,
            "unit": "kg",
            "valid": w.believable,
            "reason": w.reason,
        }
        for name, value in (("total_mass", w.mass), ("load", w.load))
    ]
    return {
        "log": w.name,
        "vehicle": task.vehicle,
        "estimates": estimates,
        "seconds_used": w.seconds,
        "duration": w.duration,
    }
