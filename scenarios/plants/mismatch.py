"""Real vehicles that differ from their twin, by name, whatever car it is."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from scenarios.plants.sensors import Sensors, measured
from twin import BRAKE_TORQUES, DRIVE_TORQUES, Drive, Vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class Mismatch:
    """How a real vehicle differs from what its twin believes.

    Attributes:
        summary: in words.
        scales: factors of `twin.Vehicle.scaled`.
        sensors: faults of its sensors.
        drive, brake: share of the known torque that reaches the wheels.
    """

    summary: str
    scales: Mapping[str, float] = field(default_factory=dict)
    sensors: Sensors = field(default_factory=Sensors)
    drive: float = 1.0
    brake: float = 1.0


def _scaled(name: str, factor: float) -> dict[str, Mismatch]:
    """The mismatch of one scale, named by its percentage."""
    percent = f"{100.0 * (factor - 1.0):+.0f}"
    return {f"{name}{percent}": Mismatch(summary=f"{name} {percent} %", scales={name: factor})}


# The prototype's "b"; what its sensors are off by is chosen: 5 mm, 0.05 m/s2, 0.1 deg/s
_POORLY_MOUNTED = Sensors(
    position=(0.005, 0.005, 0.005),
    acceleration_bias=(0.05, -0.05, 0.05),
    rate_bias=(0.0017, -0.0017, 0.0017),
    delay=0.015,
)
_ALL_SCALES = {
    "tyre_friction": 0.92,
    "cornering_stiffness": 1.1,
    "drag": 1.1,
    "spring": 1.1,
    "damper": 0.9,
}

MISMATCHES: Mapping[str, Mismatch] = {
    "same": Mismatch(summary="the twin's own model: an inverse crime"),
    "mismatched": Mismatch(
        summary="tyres, drag and springs other than the twin's, IMU displaced, biased and late",
        scales={
            "tyre_friction": 0.92,
            "cornering_stiffness": 1.1,
            "drag": 1.15,
            "spring": 1.1,
        },
        sensors=_POORLY_MOUNTED,
    ),
    **_scaled("tyre_friction", 0.9),
    **_scaled("tyre_friction", 1.1),
    **_scaled("cornering_stiffness", 0.9),
    **_scaled("cornering_stiffness", 1.1),
    **_scaled("drag", 0.9),
    **_scaled("drag", 1.1),
    **_scaled("spring", 0.9),
    **_scaled("spring", 1.1),
    **_scaled("damper", 0.9),
    **_scaled("damper", 1.1),
    **_scaled("relaxation", 0.7),
    **_scaled("relaxation", 1.3),
    "all-scales": Mismatch(
        summary="tyres, drag, springs and dampers about 10 % off at once", scales=_ALL_SCALES
    ),
    "drive-5": Mismatch(summary="5 % of the drive torque is lost", drive=0.95),
    "drive+5": Mismatch(summary="5 % more drive torque than known", drive=1.05),
    "brake-5": Mismatch(summary="5 % less brake torque than known", brake=0.95),
    "brake+5": Mismatch(summary="5 % more brake torque than known", brake=1.05),
    "imu-position": Mismatch(
        summary="IMU 10 cm off in each axis", sensors=Sensors(position=(0.1, 0.1, 0.1))
    ),
    "imu-bias": Mismatch(
        summary="IMU biased by 0.1 m/s2 and 0.3 deg/s",
        sensors=Sensors(acceleration_bias=(0.1, -0.1, 0.1), rate_bias=(0.005, -0.005, 0.005)),
    ),
    "delay": Mismatch(summary="measurements 20 ms late", sensors=Sensors(delay=0.02)),
    "coloured-noise": Mismatch(
        summary="noise of first order with 20 ms", sensors=Sensors(correlation_time=0.02)
    ),
    "quantised": Mismatch(
        summary="signals in digits of 0.05 m/s2, 0.25 deg/s and 0.1 rad/s",
        sensors=Sensors(acceleration_step=0.05, rate_step=0.0044, wheel_speed_step=0.1),
    ),
}


def real_vehicle(vehicle: Vehicle, mismatch: Mismatch) -> Vehicle:
    """The car that is driven, given the twin's (with the loads on board)."""
    return vehicle.scaled(**mismatch.scales)


def real_drive(clean: Drive, mismatch: Mismatch, snr: float, rng: np.random.Generator) -> Drive:
    """The drive of `real_vehicle` as its twin is told of it.

    Args:
        clean: recorded without noise, its inputs the torques that acted.
        mismatch: which.
        snr: of the sensors [dB]; inf: no noise.
        rng: of the noise.
    """
    inputs = clean.inputs.copy()
    inputs[:, DRIVE_TORQUES] /= mismatch.drive
    inputs[:, BRAKE_TORQUES] /= mismatch.brake
    shares = {"drive_torque": mismatch.drive, "brake_torque": mismatch.brake}
    truth = dict(clean.truth)
    truth |= {name: truth[name] * share for name, share in shares.items() if name in truth}
    return measured(clean.replace(inputs=inputs, truth=truth), mismatch.sensors, snr, rng)
