"""The follower of the measured speed for a car of which nothing is known but its files."""

from estimators.speed_follower import SpeedFollower
from twin import Twin, Vehicle


def driven(vehicle: Vehicle) -> SpeedFollower:
    """A follower of the measured speed, by what the car's files say of its drivetrain."""
    twin = Twin(vehicle)
    twin.reset(0.0)
    model, radius = twin.model, twin.data.xpos[twin.car.wheel_body, 2]
    return SpeedFollower(
        mass=float(model.body_subtreemass[0]),
        drag_area=float(twin.car.drag_area),
        radius_front=float(radius[:2].mean()),
        radius_rear=float(radius[2:].mean()),
        drive_front=vehicle.figures.drive_front,
        brake_front=vehicle.figures.brake_front,
    )
