"""Writes the timeline of an experiment: its first case and seed, by the kind of the experiment."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from estimators.joint.observer import JointEstimate
from estimators.joint.sensor_errors import SENSOR_ERRORS
from scenarios.experiment.engine import first_trials
from scenarios.experiment.experiment import Experiment, HasVehicle, Trial
from scenarios.plants.mismatch import MISMATCHES
from scenarios.plants.sensors import Sensors
from scenarios.timeline import laps, truck
from scenarios.timeline.joint import write_joint_timeline
from scenarios.timeline.timeline import write_timeline
from twin import PARAMETERS, TwinError, Vehicle


def write(experiment: Experiment, path: Path, *, seed: int, **settings: Any) -> None:
    """Writes it as an .rrd file, whole or not at all.

    Args:
        experiment: whose first case is driven.
        path: the file.
        seed: of the noise.
        settings: as of `run_experiment`.

    Raises:
        TwinError: the file cannot be written, or an estimator lacks something.
    """
    trials = first_trials(experiment, seed, shown=SHOWN.get(experiment.timeline), **settings)
    KINDS[experiment.timeline](trials, path)


def _parameters(trials: Sequence[Trial], path: Path) -> None:
    trial = trials[0]
    drive = trial.drive
    if trial.run.case.measured:  # of a log's truth only what is drawn beside the estimate
        known = {name: values for name, values in drive.truth.items() if name == "sideslip"}
        drive = drive.replace(truth=known)
    write_timeline(
        path,
        vehicle=_vehicle(trial),
        drive=drive,
        estimate=trial.estimate,
        parameters=tuple(name for name in trial.estimate.estimated if name in PARAMETERS),
        title=trial.run.experiment.name,
    )


def _joint(trials: Sequence[Trial], path: Path) -> None:
    trial = trials[0]
    if not isinstance(trial.estimate, JointEstimate):
        _parameters(trials, path)
        return
    notes = trial.run.experiment.notes
    settings = {"report": list(notes(trial)) if notes else []}
    mismatch = getattr(trial.run.case.plant, "mismatch", "same")
    write_joint_timeline(
        path,
        vehicle=_vehicle(trial),
        drive=trial.drive.replace(settings=trial.drive.settings | settings),
        estimate=trial.estimate,
        faults=_sensor_errors(MISMATCHES[mismatch].sensors),
        title=trial.run.experiment.name,
    )


def _sensor_errors(sensors: Sensors) -> dict[str, float]:
    """The true values of what the observer estimates of the sensors, by name."""
    biases = (*sensors.acceleration_bias, *sensors.rate_bias)
    return dict(zip(SENSOR_ERRORS, (*biases, sensors.delay, *sensors.position, 0.0), strict=True))


def _sideslip_and_mass(trials: Sequence[Trial], path: Path) -> None:
    if trials[0].run.estimator == "til":
        laps.write(path, trials, _vehicle(trials[0]), title=trials[0].run.experiment.name)
    else:
        _parameters(trials, path)


def _truck(trials: Sequence[Trial], path: Path) -> None:
    truck.write_truck_timeline(
        path,
        drive=trials[0].drive,
        estimates={trial.run.estimator: trial.estimate for trial in trials},
        title=trials[0].run.experiment.name,
    )


def _vehicle(trial: Trial) -> Vehicle:
    """The car that is drawn."""
    plant = trial.run.case.plant
    if not isinstance(plant, HasVehicle):
        raise TwinError(f"{trial.run.experiment.name}: has no car to draw")
    return plant.vehicle()


KINDS: dict[str, Callable[[Sequence[Trial], Path], None]] = {
    "parameters": _parameters,
    "joint": _joint,
    "sideslip and mass": _sideslip_and_mass,
    "truck": _truck,
}
# The estimators that a kind shows, where it is not the first
SHOWN = {
    "sideslip and mass": ("til", "double-track"),
    "truck": ("kalman-bucy-matched", "til"),
}
