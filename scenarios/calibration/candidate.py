"""A candidate of a calibration: a twin with some numbers changed, and its run over a drive."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from estimators.base import Estimate
from estimators.speed_follower import SpeedFollower
from estimators.til.observer import Observer
from scenarios.calibration.free_parameters import FREE, Kind
from scenarios.logs.pieces import start_speed
from twin import Drive, Twin, Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A vehicle with numbers of `FREE`.

    Attributes:
        vehicle: its files.
        values: what is changed, by name.
        gains: of the observer that the twin runs in; none: it runs free.
        follower: for drives without torques.
    """

    vehicle: Vehicle
    values: Mapping[str, float] = field(default_factory=dict)
    gains: Mapping[tuple[str, str], float] = field(default_factory=dict)
    follower: SpeedFollower | None = None

    def of(self, kind: Kind) -> dict[str, float]:
        """The values of one kind."""
        return {name: value for name, value in self.values.items() if FREE[name].kind == kind}

    def run(self, drive: Drive) -> Estimate:
        """Observes the drive, from the speed and the load it starts with.

        Raises:
            TwinError: the twin has blown up, or the drive has not what it needs.
        """
        gains = {**self.gains, **{FREE[n].of: value for n, value in self.of("gain").items()}}
        follower = self.follower and self.follower._replace(**self.of("follower"))
        twin = Twin(self.vehicle.scaled(**self.of("scale")))
        observer = Observer(twin, (), gains, follower=follower)
        radius = float(np.mean(self.vehicle.figures.wheel_radius))
        observer.reset(_first_speed(drive, radius), self.of("load"))
        return observer.run(self._shifted(drive))

    def sideslip(self, estimate: Estimate) -> Array:
        """(N,) of the point where it is measured, with the offset of that measurement [rad]."""
        lever = self.values.get("sideslip_lever", 0.0)
        vy = estimate["vy"] + lever * estimate["yaw_rate"]
        angle = np.arctan2(vy, np.maximum(estimate["vx"], 1e-3))
        return angle + self.values.get("sideslip_offset", 0.0)

    def _shifted(self, drive: Drive) -> Drive:
        """The drive less the offsets of its sensors."""
        inputs, measurements = drive.inputs.copy(), drive.measurements.copy()
        steering = drive.input_names.index("steering_wheel_angle")
        inputs[:, steering] += self.values.get("steering_offset", 0.0)
        for k, name in enumerate(drive.output_names):
            measurements[:, k] -= self.values.get(f"{name}_offset", 0.0)
        return drive.replace(inputs=inputs, measurements=measurements)


def _first_speed(drive: Drive, radius: float) -> float:
    """Measured, by wheels of that radius [m] if need be; true where nobody measured it [m/s]."""
    if "vx" not in drive.output_names and "vx" in drive.truth:
        return max(float(drive.truth["vx"][0]), 0.0)
    if "vx" in drive.output_names and np.isfinite(drive.channel("vx")[0]):
        return max(float(drive.channel("vx")[0]), 0.0)
    return start_speed(drive, radius)
