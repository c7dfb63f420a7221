"""The drivers of the cars of the project, and what each asks of his car."""

from scenarios.driving.driver import Driver
from scenarios.driving.speed_profile import Limits

# Mass, drag, wheelbase and steering ratio are those of the cars' files, understeer gradients those
# their twins show below half the grip; the rest is chosen.
DRIVERS = {
    "suv": Driver(),
    "sports_car": Driver(
        proportional=5000.0,
        largest_force=10000.0,
        pedal_rate=80000.0,
        wheel_radius=0.34,
        drive_front=0.0,
        brake_front=0.62,
        power=370e3,
        locking=150.0,
        locked_share=0.4,
        mass=1559.3,
        drag_area=0.75,
        wheelbase=2.65,
        steering_ratio=13.0,
        understeer=0.0010,
        look_ahead=0.45,
    ),
    "bmw_320i": Driver(
        largest_force=6000.0,
        wheel_radius=0.344,
        drive_front=0.0,
        brake_front=0.66,
        power=85e3,
        mass=1093.3,
        drag_area=0.0,
        wheelbase=2.5789,
        understeer=0.0,
    ),
}

LIMITS = {
    "suv": Limits(
        lateral=0.6, accelerating=0.3, braking=0.6, speed=50.0,
        power=180e3, mass=2337.8, drag_area=0.90,
    ),
    "sports_car": Limits(
        lateral=1.29, accelerating=0.62, braking=1.15, speed=64.0,
        power=350e3, mass=1559.3, drag_area=0.75, downforce_area=0.8,
    ),
    "bmw_320i": Limits(
        lateral=0.6, accelerating=0.4, braking=0.6, speed=45.0,
        power=80e3, mass=1093.3, drag_area=0.0,
    ),
}  # fmt: skip
