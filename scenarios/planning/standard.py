"""Standard manoeuvres within the same limits, to hold a plan against."""

from collections.abc import Callable, Mapping

import numpy as np

from scenarios.driving.manoeuvres import swept_steer, urban
from scenarios.planning.design import DT, hand_wheel_of
from scenarios.planning.drive import Motion
from scenarios.planning.limits import PlanLimits
from twin import Vehicle

_STEP = 4.0  # [s] to one side
_TURN = (3.0, 3.0)  # [s] of a turn at constant speed, and between turns


def swept_steer_within(vehicle: Vehicle, limits: PlanLimits, seconds: float) -> Motion:
    """Sweeps of the hand wheel from 0 to 4 Hz at the highest speed."""
    amplitude = limits.lateral * float(hand_wheel_of(vehicle, np.array([limits.fast]))[0])
    swept = swept_steer(DT, seconds, speed=limits.fast, amplitude=amplitude)
    return Motion(name="swept steer", speed=swept.speed, steering=swept.steering, free=True)


def step_steer(vehicle: Vehicle, limits: PlanLimits, seconds: float) -> Motion:
    """Steps of the hand wheel to the left and to the right at the highest speed, each 0.2 s."""
    n = round(seconds / DT)
    time = np.arange(n) * DT
    side = np.clip(13.0 * np.sin(np.pi * time / _STEP), -1.0, 1.0)  # over in 0.2 s
    hand_wheel = limits.lateral * float(hand_wheel_of(vehicle, np.array([limits.fast]))[0])
    return Motion(
        name="step steer", speed=np.full(n, limits.fast), steering=hand_wheel * side, free=True
    )


def urban_within(vehicle: Vehicle, limits: PlanLimits, seconds: float) -> Motion:
    """Straight urban driving with stops; slower than the limits allow, as traffic is."""
    del vehicle
    drive = urban(DT, seconds)
    speed = np.where(drive.speed > limits.fast, limits.fast, drive.speed)
    return Motion(name="urban", speed=speed, steering=drive.steering)


def brake_in_turn(vehicle: Vehicle, limits: PlanLimits, seconds: float) -> Motion:
    """Turns to either side, each with braking to the lowest speed, and speeding up between them."""
    steady, between = _TURN
    change = limits.fast - limits.slow
    down = 0.5 * np.pi * change / limits.braking
    up = max(0.5 * np.pi * change / limits.accelerating, between)
    cycle = steady + down + up
    time = np.arange(round(seconds / DT)) * DT
    phase = time % cycle
    braking = np.clip((phase - steady) / max(down, DT), 0.0, 1.0)
    rising = np.clip((phase - steady - down) / up, 0.0, 1.0)
    speed = limits.fast - 0.5 * change * (np.cos(np.pi * rising) - np.cos(np.pi * braking))
    into, out = np.clip(phase / 0.5, 0.0, 1.0), np.clip((cycle - up - phase) / 0.5 + 1.0, 0.0, 1.0)
    side = np.where(time % (2.0 * cycle) < cycle, 1.0, -1.0)
    hand_wheel = 0.7 * limits.lateral * float(hand_wheel_of(vehicle, np.array([limits.fast]))[0])
    steering = side * into * out * hand_wheel
    return Motion(name="brake in turn", speed=speed, steering=steering, free=True)


STANDARD: Mapping[str, Callable[[Vehicle, PlanLimits, float], Motion]] = {
    "swept steer": swept_steer_within,
    "step steer": step_steer,
    "urban": urban_within,
    "brake in turn": brake_in_turn,
}
