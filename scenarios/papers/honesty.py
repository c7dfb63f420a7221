"""Are the joint observer's claims true on cars that are not its twin? `til reproduce honesty`.

The real vehicles are drawn: all properties of `scenarios.plants.random_car` at once, and each of
them alone. The observer is told what a car has: its bus, and nothing of the road, the noise or the
true speed.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate
from estimators.entry import Given
from estimators.joint.noise import noise_of_record
from estimators.joint.observer import JointSettings
from estimators.joint.real_car import REAL_CAR
from estimators.registry import make
from estimators.til.observer import Observer
from estimators.til.stream import rolling_radius
from scenarios.driving import joint_drives
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import Manoeuvre
from scenarios.experiment.engine import runs, scores
from scenarios.experiment.experiment import Case, Experiment, Recipe, Run, Score, Trial
from scenarios.experiment.joint import REAL, TWIN
from scenarios.experiment.metrics import true_deltas, unit_of_error
from scenarios.experiment.reproduction import Clock, Making
from scenarios.experiment.result import Result, Row
from scenarios.plants.random_car import RealCar, properties, random_car
from scenarios.plants.real_record import record_real
from scenarios.plants.real_sensors import told
from scenarios.report.pictures import figure
from twin import (
    OUTPUTS,
    PARAMETERS,
    WHEEL_SPEEDS,
    Drive,
    RigidBody,
    Twin,
    Vehicle,
    parameter_deltas,
)

Array = NDArray[np.float64]

SEVEN = ("mass", "cm_x", "cm_y", "cm_z", "Jxx", "Jyy", "Jzz")
DRIVES: Mapping[str, Callable[..., Manoeuvre]] = {"mixed": joint_drives.mixed, "urban": urban}
DURATION = 60.0  # [s]
SNR = 20.0  # [dB]
FIRST_CAR = 1000  # seeds of the cars; what was chosen was chosen on those below
ALONE = "one property each"
LEVELS = (0.5, 0.68, 0.8, 0.9, 0.95, 0.99)  # of the calibration plot
_Z = (0.674, 1.0, 1.282, 1.645, 1.960, 2.576)  # of a normal distribution


@dataclass(frozen=True, slots=True, kw_only=True)
class RealCarOnDrive:
    """A loaded SUV that differs from its files, on a drive.

    Attributes:
        real: how it differs.
        manoeuvre: a name of `DRIVES`.
    """

    real: RealCar
    manoeuvre: str

    def vehicle(self) -> Vehicle:
        """What is drawn."""
        return Vehicle.load(REAL)

    def clean(self, duration: float | None) -> Drive:
        """Without noise."""
        manoeuvre = DRIVES[self.manoeuvre](duration=DURATION if duration is None else duration)
        return record_real(self.vehicle(), self.real, manoeuvre)

    def load(self, nominal: RigidBody) -> dict[str, float]:
        """See `CarPlant`."""
        deltas = parameter_deltas(nominal, _loaded_chassis())
        return dict(zip(PARAMETERS, deltas.tolist(), strict=True))

    def drive(self, case: Case, rng: np.random.Generator, duration: float | None) -> Drive:
        """What its bus shows."""
        return told(self.clean(duration), self.real, case.snr, rng)


@cache
def _loaded_chassis() -> RigidBody:
    return Vehicle.load(REAL).chassis()


class _AsInACar:
    """An estimator of the registry that is told nothing beyond the drive: no speed, road, noise."""

    def __init__(self, name: str, car: str, drive: Drive) -> None:
        """Args: name: of the estimator; car: of its twins; drive: to take the noise from."""
        vehicle = Vehicle.load(car)
        noise = dict(zip(OUTPUTS, noise_of_record(drive.measurements).tolist(), strict=True))
        settings = JointSettings(parameters=REAL_CAR) if name == "joint" else None
        self._estimator = make(
            name, Given(vehicle=vehicle, noise_sd=noise, dt=drive.dt, settings=settings)
        )
        self._radius = rolling_radius(Observer(Twin(vehicle), []))

    def reset(
        self,
        speed: float,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """Heeds none of what a simulation knows; see `run`."""

    def run(self, drive: Drive) -> Estimate:
        """Starts at the speed of the wheels, over a tenth of a second."""
        wheels = drive.measurements[: round(0.1 / drive.dt), WHEEL_SPEEDS]
        self._estimator.reset(max(self._radius * float(np.median(wheels)), 0.0))
        return self._estimator.run(drive)


def _claims(trial: Trial) -> list[Score]:
    """Error, claimed standard deviation and validity of the seven at the end."""
    truth, variation = true_deltas(trial), trial.run.case.load()
    found = []
    for name in SEVEN:
        unit = unit_of_error(variation, name)
        off = trial.estimate[name][-1] - truth[name][-1]
        sd = trial.estimate.sd_of(name)[-1]
        valid = float(trial.estimate.valid_of(name)[-1])
        found += [
            Score(name, "error_pct", "%", 100.0 * off / unit),
            Score(name, "claimed_sd_pct", "%", 100.0 * sd / unit),
            Score(name, "valid", "1", valid),
        ]
    return found


def _joint(run: Run, drive: Drive) -> Any:
    return _AsInACar("joint", run.case.twin, drive)


EXPERIMENT_OF = Experiment(
    name="honesty",
    estimators={"joint": Recipe(estimator="joint", make=_joint)},
    quantities=SEVEN,
    metrics=_claims,
)


def _cases(seeds: Sequence[int]) -> dict[str, list[Case]]:
    """The cases of every row of the table: drawn cars on each drive, and one property each."""
    drawn = {
        drive: [_case(drive, random_car(FIRST_CAR + seed)) for seed in seeds] for drive in DRIVES
    }
    alone = [
        _case("mixed", random_car(FIRST_CAR + k, (name,))) for k, name in enumerate(properties())
    ]
    return drawn | {f"mixed, {ALONE}": alone[: max(len(seeds), 1) * 3]}


def _case(drive: str, real: RealCar) -> Case:
    plant = RealCarOnDrive(real=real, manoeuvre=drive)
    return Case(name=drive, plant=plant, twin=TWIN, snr=SNR)


def honesty(making: Making) -> Result:
    """Coverage, validity and width of the joint observer's intervals."""
    clock = Clock.started()
    groups = _cases(making.seeds)
    found: list[Row] = []
    claims = []
    for name, cases in groups.items():
        todo = runs(EXPERIMENT_OF, [making.seeds[0]], making.duration, cases=cases)
        one = _table(scores(todo, making.jobs, f"honesty: {name}"))
        claims.append(one)
        found += _rows(name, *one)
    _draw(making.out / "honesty.png", groups, claims)
    return clock.result("honesty", making, found, knows="", first_car=FIRST_CAR)


def _table(scored: Sequence[Sequence[Score]]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """(runs, 7) errors and standard deviations [%], and validity."""
    values = np.array([[score.value for score in one] for one in scored])
    values = values.reshape(len(scored), len(SEVEN), 3)
    return values[..., 0], values[..., 1], values[..., 2] > 0.5


def _rows(case: str, error: Array, sd: Array, valid: NDArray[np.bool_]) -> list[Row]:
    """The rows of one case: each quantity, and all together."""
    found = []
    for k, name in enumerate((*SEVEN, "all")):
        chosen = slice(None) if name == "all" else slice(k, k + 1)
        e, s, v = np.abs(error[:, chosen]), sd[:, chosen], valid[:, chosen]
        within = e <= 2.0 * s
        values = [
            ("coverage", "1", [within[v].mean() if v.any() else np.nan]),
            ("coverage_all", "1", [within.mean()]),
            ("share_valid", "1", [v.mean()]),
            ("valid_and_off", "1", [(v & (e > 3.0 * s)).mean()]),
        ]
        if name != "all":
            values += [("pct", "%", e[:, 0]), ("claimed_sd_pct", "%", s[:, 0])]
        for metric, unit, value in values:
            row = Row.over_seeds(
                value, case=case, quantity=name, metric=metric, unit=unit, estimator="joint"
            )
            found.append(replace(row, seeds=len(error)))
    return found


def _draw(path: Path, groups: Mapping[str, Sequence[Case]], claims: Sequence[Any]) -> None:
    """Nominal against observed coverage of all that is claimed, valid or not."""
    with figure(path, title="Coverage of the joint observer's intervals on other cars") as axes:
        axes.plot([0, 1], [0, 1], color="0.6", linewidth=1.0)
        for name, (error, sd, _) in zip(groups, claims, strict=True):
            observed = [(np.abs(error) <= z * sd).mean() for z in _Z]
            axes.plot(LEVELS, observed, "o-", label=f"{name}, {len(error)} cars")
        axes.set(xlabel="claimed", ylabel="observed", xlim=(0.45, 1.0), ylim=(0.0, 1.02))
        axes.legend(loc="lower right")
