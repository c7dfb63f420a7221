"""Who drives a car, and what he asks of it: from what the car tells of itself.

A driver knows his car as its files have it, not what is on board or worn. For the cars of the
project some of it is chosen, so that their drives stay as published.
"""

from typing import Any

import models
from scenarios.driving.driver import Driver
from scenarios.driving.speed_profile import GRAVITY, Limits
from twin import Vehicle

# Chosen, or (understeer) as their twins show it below half the grip
DRIVERS: dict[str, dict[str, Any]] = {
    "suv": {
        "proportional": 4000.0, "integral": 600.0, "largest_force": 9000.0,
        "pedal_rate": 20000.0, "holding_torque": 500.0, "wheel_radius": 0.36,
        "understeer": 0.0013, "steering_rate": 15.0,
    },
    "sports_car": {
        "proportional": 5000.0, "integral": 600.0, "largest_force": 10000.0,
        "pedal_rate": 80000.0, "holding_torque": 500.0, "wheel_radius": 0.34,
        "understeer": 0.0010, "steering_rate": 15.0,
        "locking": 150.0, "locked_share": 0.4, "look_ahead": 0.45,
    },
    "bmw_320i": {
        "proportional": 4000.0, "integral": 600.0, "largest_force": 6000.0,
        "pedal_rate": 20000.0, "holding_torque": 500.0, "wheel_radius": 0.344,
        "understeer": 0.0, "steering_rate": 15.0,
    },
}  # fmt: skip
DRIVERS["suv_loaded"] = DRIVERS["suv"]
LIMITS: dict[str, dict[str, float]] = {
    "suv": {
        "lateral": 0.6, "accelerating": 0.3, "braking": 0.6, "speed": 50.0, "power": 180e3
    },
    "sports_car": {
        "lateral": 1.29, "accelerating": 0.62, "braking": 1.15, "speed": 64.0, "power": 350e3
    },
    "bmw_320i": {
        "lateral": 0.6, "accelerating": 0.4, "braking": 0.6, "speed": 45.0, "power": 80e3
    },
}  # fmt: skip

# Of the grip of the tyres under their static loads, and of what makes a car roll over; chosen
LATERAL_SHARE, BRAKING_SHARE, ACCELERATING_SHARE, ROLL_OVER_SHARE = 0.65, 0.6, 0.5, 0.7
FASTEST = 50.0  # [m/s]; chosen


def driver_of(vehicle: Vehicle) -> Driver:
    """Who drives this car.

    Args:
        vehicle: loads and scales are not known to him.

    Raises:
        TwinError: the vehicle's files are missing or broken.
    """
    nominal = Vehicle(source=vehicle.source)
    car, chosen = nominal.figures, _chosen(nominal, DRIVERS)
    if not chosen:
        grip = nominal.grip
        loads = [load / GRAVITY for load in car.axle_load]
        front, rear = (m / c for m, c in zip(loads, grip.cornering_stiffness, strict=True))
        chosen = {
            "proportional": 2.0 * car.mass,
            "integral": 0.3 * car.mass,
            "largest_force": 0.8 * _traction(nominal),
            "pedal_rate": 10.0 * car.mass,
            "holding_torque": 0.2 * car.mass,
            "wheel_radius": 0.5 * sum(car.wheel_radius),
            "understeer": max(front - rear, 0.0),
            "steering_rate": 0.9 * car.steering_ratio,
        }
    return Driver(
        mass=car.mass,
        drag_area=car.drag_area,
        wheelbase=car.wheelbase,
        steering_ratio=car.steering_ratio,
        drive_front=car.drive_front,
        brake_front=car.brake_front,
        power=car.power,
        **chosen,
    )


def limits_of(vehicle: Vehicle) -> Limits:
    """What is asked of this car at most.

    Args:
        vehicle: its loads and scales are not known to the driver.

    Raises:
        TwinError: the vehicle's files are missing or broken.
    """
    nominal = Vehicle(source=vehicle.source)
    car, chosen = nominal.figures, _chosen(nominal, LIMITS)
    if not chosen:
        friction = min(nominal.grip.friction)
        roll_over = 0.5 * min(car.track) / car.cm_height
        chosen = {
            "lateral": min(LATERAL_SHARE * friction, ROLL_OVER_SHARE * roll_over),
            "accelerating": ACCELERATING_SHARE * _traction(nominal) / (car.mass * GRAVITY),
            "braking": BRAKING_SHARE * friction,
            "speed": FASTEST,
            "power": 0.8 * car.power,
        }
    return Limits(
        mass=car.mass, drag_area=car.drag_area, downforce_area=sum(car.lift_area), **chosen
    )


def _chosen(vehicle: Vehicle, table: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """What is chosen for a car of the project; nothing for a user's own."""
    ours = vehicle.source.parent == models.FOLDER
    return table.get(vehicle.source.stem, {}) if ours else {}


def _traction(vehicle: Vehicle) -> float:
    """The largest force [N] of the engine before the wheels of an axle spin."""
    car, grip = vehicle.figures, vehicle.grip
    shares = (car.drive_front, 1.0 - car.drive_front)
    axles = zip(grip.friction, car.axle_load, shares, strict=True)
    return min(mu * load / share for mu, load, share in axles if share > 0.0)
