"""The joint observer that logs are given to: load, tyres, and what cars of one type differ in."""

from pathlib import Path

from estimators.joint.noise import noise_of_record
from estimators.joint.observer import JointObserver, JointSettings
from estimators.joint.real_car import REAL_CAR
from twin import OUTPUTS, Drive, Vehicle


def joint_observer(
    car: str | Path | Vehicle, drive: Drive, settings: JointSettings | None = None
) -> JointObserver:
    """The observer of all parameters at once, with their standard deviations.

    Args:
        car: its name or file, or a `Vehicle`.
        drive: whose noise is taken, from its own high frequencies; measurements of `twin.OUTPUTS`.
        settings: what is estimated, and how; None: load, scales and
            what cars of one type differ in.

    Raises:
        TwinError: the car's files are missing or broken, or the drive lacks a channel.
    """
    vehicle = car if isinstance(car, Vehicle) else Vehicle.load(car)
    columns = [drive.output_names.index(name) for name in OUTPUTS]
    noise = noise_of_record(drive.measurements[:, columns])
    return JointObserver(vehicle, noise, settings or JointSettings(parameters=REAL_CAR))
