"""What weighing needs of a log: force at the wheels, one speed, one acceleration, perhaps a pedal.

The law is that of the car along its own x axis. An accelerometer shows specific force f, the
acceleration less gravity along that axis, so the slope of the road cancels:

    (m + m_rot) f = F - friction brakes - rolling resistance - air drag

(m_rot goes with dv/dt rather than f, which on a slope of 5 % is an error of 0.2 % of the mass). m
is the mass of the car with everything in it, m_rot = sum(J / R^2) that of its rotating parts, F
the torques of the motor at the wheels over the rolling radius.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from twin import WHEELS, Drive, TwinError

Array = NDArray[np.float64]

PEDAL = "accelerator_pedal"
SLOWEST_RATE = 2.0  # [Hz]; acceleration changes within half a second
_NEEDS = "weighing needs ax, vx and the drive torques"
_MOST_CUT = 100  # a trip lasts at most so many times what it has samples for
_UNIFORMITY = 0.02  # of the sample time; clocks of loggers


@dataclass(frozen=True, slots=True, kw_only=True)
class Trip:
    """One trip. NaN marks samples in which a signal is missing.

    Attributes:
        name: of the log.
        time: (N,) uniform [s].
        force: (N,) of the motor at the wheels as the log's torques say: torque over radius [N].
        speed: (N,) [m/s].
        acceleration: (N,) specific force along x [m/s2].
        pedal: (N,) of the accelerator, from 0 to 1; None: the log has none.
        brake: (N,) greater than 0 where the log knows that a friction brake acts; None: it does
            not know.
    """

    name: str
    time: Array
    force: Array
    speed: Array
    acceleration: Array
    pedal: Array | None = None
    brake: Array | None = None

    def __post_init__(self) -> None:
        """Checks shapes and times."""
        shape = self.time.shape
        for field in ("force", "speed", "acceleration", "pedal", "brake"):
            values = getattr(self, field)
            if values is not None and values.shape != shape:
                raise TwinError(
                    f"{self.name}: {field} has shape {values.shape}; allowed: that of time, {shape}"
                )
        if self.time.ndim != 1 or self.time.size < 2:
            raise TwinError(f"{self.name}: time has shape {shape}; allowed: (N,), N at least 2")
        steps = np.diff(self.time)
        if not np.abs(steps - steps.mean()).max() <= _UNIFORMITY * steps.mean():
            raise TwinError(
                f"{self.name}: time has steps of {steps.min():.6g} to {steps.max():.6g} s; "
                "allowed: uniform steps"
            )
        if self.rate < SLOWEST_RATE:
            raise TwinError(
                f"{self.name}: has {self.rate:.3g} samples per second; allowed: at least "
                f"{SLOWEST_RATE:g}"
            )

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return float(self.time[-1] - self.time[0]) / (self.time.size - 1)

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return 1.0 / self.dt

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]."""
        return float(self.time[-1] - self.time[0])

    def until(self, seconds: float) -> Self:
        """The first seconds of the trip."""
        kept = self.time <= self.time[0] + seconds
        return replace(
            self,
            time=self.time[kept],
            force=self.force[kept],
            speed=self.speed[kept],
            acceleration=self.acceleration[kept],
            pedal=None if self.pedal is None else self.pedal[kept],
            brake=None if self.brake is None else self.brake[kept],
        )

    @classmethod
    def of_drive(cls, drive: Drive, radius: float, name: str) -> Self:
        """The trip of a drive with drive torques, `vx` and `ax`.

        Args:
            drive: its inputs have the drive torques of four wheels; brake torques that are all zero
                count as unknown, as a log of a car whose brakes nobody measures declares them.
            radius: of the driven wheels, rolling [m].
            name: for messages.

        Raises:
            TwinError: a channel is missing.
        """
        for channel in ("ax", "vx"):
            if channel not in drive.output_names or np.isnan(drive.channel(channel)).all():
                raise TwinError(
                    f"{name}: has no {channel}; weighing needs ax, vx and drive torques"
                )
        missing = [w for w in WHEELS if f"drive_torque_{w}" not in drive.input_names]
        if missing:
            raise TwinError(
                f"{name}: has no drive_torque_{missing[0]}; weighing needs ax, vx and drive torques"
            )
        torque, brake = (
            np.sum([drive.channel(n) for n in drive.input_names if n.startswith(kind)], axis=0)
            for kind in ("drive_torque", "brake_torque")
        )
        time, at = _with_cuts(drive.time)

        def spread(values: Array) -> Array:
            whole = np.full(time.size, np.nan)
            whole[at] = values
            return whole

        return cls(
            name=name,
            time=time,
            force=spread(torque / radius),
            speed=spread(drive.channel("vx")),
            acceleration=spread(drive.channel("ax")),
            pedal=spread(drive.channel(PEDAL)) if PEDAL in drive.output_names else None,
            brake=spread(brake) if np.any(brake) else None,
        )


def _with_cuts(time: Array) -> tuple[Array, NDArray[np.int64]]:
    """Uniform times over the gaps that were cut out of a drive, and where its samples are in them.

    Args:
        time: (N,) [s]; samples that are not uniform by themselves stay as they are.
    """
    step = float(np.median(np.diff(time)))
    at = np.round((time - time[0]) / step).astype(np.int64)
    cut = at[-1] >= time.size and (np.diff(at) > 0).all() and at[-1] < _MOST_CUT * time.size
    if not cut or np.abs(time - time[0] - step * at).max() > _UNIFORMITY * step * at[-1]:
        return time, np.arange(time.size)
    return time[0] + step * np.arange(at[-1] + 1), at
