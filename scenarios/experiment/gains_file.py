"""Tuned gains on file: small TOML files that say what car and observer they are for, and how made.

Those that ship with the project lie in models/gains, named CAR-ESTIMATOR.toml.
"""

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w

import models
from scenarios.experiment.experiment import Experiment
from scenarios.experiment.result import replacing, versions
from twin import TwinError

FOLDER = Path(models.__file__).parent / "gains"


def write(
    path: Path,
    *,
    vehicle: str,
    estimator: str,
    gains: Mapping[str, float],
    predicted: Mapping[str, float],
    made: Mapping[str, Any],
) -> None:
    """Writes what a tuning found, whole or not at all.

    Args:
        path: of the TOML file.
        vehicle: name of the twin's car.
        estimator: whose gains.
        gains: the best point tried.
        predicted: the point predicted best.
        made: how it was made: evaluations, settings, seeds, the cost.
    """
    content = {
        "vehicle": vehicle,
        "estimator": estimator,
        "gains": dict(gains),
        "predicted": dict(predicted),
        "made": {**made, "versions": versions()},
    }
    with replacing(path) as partial:
        partial.write_bytes(tomli_w.dumps(content).encode())


def ships(vehicle: str, estimator: str) -> bool:
    """Whether the project has tuned gains of an estimator for a car."""
    return (FOLDER / f"{vehicle}-{estimator}.toml").is_file()


def shipped(vehicle: str, estimator: str, names: Iterable[str]) -> dict[str, float]:
    """The gains of the project, see `read`."""
    path = FOLDER / f"{vehicle}-{estimator}.toml"
    return read(path, vehicle=vehicle, estimator=estimator, names=names)


def read(path: Path, *, vehicle: str, estimator: str, names: Iterable[str]) -> dict[str, float]:
    """The gains of a file of `write`.

    Args:
        path: of the file.
        vehicle: name of the twin's car, which they have to be for.
        estimator: whose gains they have to be.
        names: of the gains, in order.

    Raises:
        TwinError: no such file, or one for another car or estimator, or a gain is missing.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise TwinError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise TwinError(f"{path}: is no TOML: {' '.join(str(error).split())}") from None
    for field, wanted in (("vehicle", vehicle), ("estimator", estimator)):
        if content.get(field) != wanted:
            raise TwinError(f"{path}: {field} is {content.get(field)!r}; allowed here: {wanted!r}")
    gains = content.get("gains")
    found = {}
    for name in names:
        value = gains.get(name) if isinstance(gains, dict) else None
        if not isinstance(value, int | float) or not 0.0 <= value < float("inf"):
            raise TwinError(f"{path}: gains.{name} is {value}; allowed: a finite number, 0 or more")
        found[name] = float(value)
    return found


def of_run(
    path: Path, experiment: Experiment, estimators: Sequence[str] = ()
) -> tuple[tuple[str, float], ...]:
    """The gains of a file for the first estimator of `til run`.

    Raises:
        TwinError: that has no gains, or the file is broken, or for another car or estimator.
    """
    name = next(iter(estimators or experiment.estimators))
    own = experiment.estimators.get(name)
    if own is None or own.tunable is None:
        raise TwinError(f"--gains: {name} on {experiment.name} takes none")
    car = experiment.cases[0].twin
    names = [gain.name for gain in own.tunable(car)]
    return tuple(read(path, vehicle=car, estimator=name, names=names).items())
