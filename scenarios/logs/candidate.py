"""A candidate of a calibration: a twin with some numbers changed, and its run over a drive."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from estimators.base import Estimate
from estimators.speed_follower import SpeedFollower
from estimators.til.observer import Observer
from estimators.til.scheduled import ScheduledObserver
from scenarios.logs.follower import driven
from scenarios.logs.free_parameters import FREE, GAINS, SIDESLIP_SD, Kind, noise_of
from scenarios.logs.pieces import start_speed
from twin import Drive, Twin, Vehicle

Array = NDArray[np.float64]

SLOWEST = 1.0  # [m/s]; slower, sideslip is reckoned as at this speed, as its angle means nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A vehicle with numbers of `FREE`.

    Attributes:
        vehicle: its files.
        values: what is changed, by name.
        gains: of the observer that the twin runs in; none: it runs free.
        follower: for drives without torques.
        scheduled: whether gains follow from a covariance instead.
    """

    vehicle: Vehicle
    values: Mapping[str, float] = field(default_factory=dict)
    gains: Mapping[tuple[str, str], float] = field(default_factory=dict)
    follower: SpeedFollower | None = None
    scheduled: bool = False

    def of(self, kind: Kind) -> dict[str, float]:
        """The values of one kind."""
        return {name: value for name, value in self.values.items() if FREE[name].kind == kind}

    def run(self, drive: Drive) -> Estimate:
        """Observes the drive, from the speed and the load it starts with.

        Raises:
            TwinError: the twin has blown up, or the drive has not what it needs.
        """
        follower = self.follower and self.follower._replace(**self.of("follower"))
        twin = Twin(self.vehicle.scaled(**self.of("scale")))
        if self.scheduled:
            observer = ScheduledObserver(twin, follower, noise_of(self.values))
        else:
            gains = {**self.gains, **{FREE[n].of: value for n, value in self.of("gain").items()}}
            observer = Observer(twin, (), gains, follower=follower)
        radius = float(np.mean(self.vehicle.figures.wheel_radius))
        observer.reset(_first_speed(drive, radius), self.of("load"))
        found = observer.run(self.shifted(drive))
        if not self.scheduled and SIDESLIP_SD in self.values:
            found = replace(found, sideslip_sd=np.full(len(drive), self.values[SIDESLIP_SD]))
        return found

    def observe(self, drive: Drive) -> Estimate:
        """The same, with the sideslip of the point where it is measured among the outputs.

        Raises:
            TwinError: see `run`.
        """
        found = self.run(drive)
        return replace(
            found,
            outputs=np.column_stack([found.outputs, self.sideslip(found)]),
            output_names=(*found.output_names, "sideslip"),
        )

    def sideslip(self, estimate: Estimate) -> Array:
        """(N,) of the point where it is measured, with the offset of that measurement [rad]."""
        lever = self.values.get("sideslip_lever", 0.0)
        vy = estimate["vy"] + lever * estimate["yaw_rate"]
        angle = np.arctan2(vy, np.maximum(estimate["vx"], SLOWEST))
        return angle + self.values.get("sideslip_offset", 0.0)

    def shifted(self, drive: Drive) -> Drive:
        """The drive less the offsets of its sensors."""
        inputs, measurements = drive.inputs.copy(), drive.measurements.copy()
        steering = drive.input_names.index("steering_wheel_angle")
        inputs[:, steering] += self.values.get("steering_offset", 0.0)
        for k, name in enumerate(drive.output_names):
            measurements[:, k] -= self.values.get(f"{name}_offset", 0.0)
        return drive.replace(inputs=inputs, measurements=measurements)


def candidate_of(vehicle: Vehicle) -> Candidate:
    """What `til estimate` observes a log without torques with, by what the car's calibration holds.

    Gains of the calibration are constant, as those of the paper; without any they are scheduled.
    """
    values = {name: value for name, value in vehicle.calibration if name in FREE}
    return Candidate(
        vehicle=vehicle,
        values=values,
        follower=driven(vehicle),
        scheduled=not set(GAINS) & set(values),
    )


def _first_speed(drive: Drive, radius: float) -> float:
    """Measured, by wheels of that radius [m] if need be; true where nobody measured it [m/s]."""
    if "vx" not in drive.output_names and "vx" in drive.truth:
        return max(float(drive.truth["vx"][0]), 0.0)
    if "vx" in drive.output_names and np.isfinite(drive.channel("vx")[0]):
        return max(float(drive.channel("vx")[0]), 0.0)
    return start_speed(drive, radius)
