"""Signals as cars have them become inputs and measurements of ours.

Hydraulic brake pressure, torque of an engine or motor, the angle of the road wheels, one speed of
the vehicle, the course over ground, and accelerations that are free of gravity. What turns them
into ours belongs to the car: its file's table [signals] or the map's table [car] says it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from twin.channels import WHEELS
from twin.errors import TwinError
from twin.logs.raw_log import Array
from twin.logs.units import GRAVITY
from twin.toml_file import Table

DRIVEN = ("front", "rear", "all")
_WHEEL_SPEEDS = tuple(f"wheel_speed_{wheel}" for wheel in WHEELS)
_LEFT, _RIGHT = "road_wheel_angle_left", "road_wheel_angle_right"
_ROAD_WHEELS = ("road_wheel_angle", _LEFT, _RIGHT)
_SLOWEST = 3.0  # [m/s] at which a course over ground tells a yaw rate

# Signals of cars, and which of our channels each gives
GIVES: dict[str, tuple[str, ...]] = {
    "speed": _WHEEL_SPEEDS,
    "motor_torque": tuple(f"drive_torque_{wheel}" for wheel in WHEELS),
    "motor_torque_front": ("drive_torque_fl", "drive_torque_fr"),
    "motor_torque_rear": ("drive_torque_rl", "drive_torque_rr"),
    "gear": (),
    "brake_pressure": tuple(f"brake_torque_{wheel}" for wheel in WHEELS),
    "brake_pressure_front": ("brake_torque_fl", "brake_torque_fr"),
    "brake_pressure_rear": ("brake_torque_rl", "brake_torque_rr"),
    "road_wheel_angle": ("steering_wheel_angle",),
    "road_wheel_angle_left": ("steering_wheel_angle",),
    "road_wheel_angle_right": ("steering_wheel_angle",),
    "course": ("yaw_rate",),
    "slope": (),
    "bank": (),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CarSignals:
    """What a car makes of its signals; None where nobody says.

    Attributes:
        brake_torque_per_bar_front, brake_torque_per_bar_rear: both wheels of the axle [N m/bar].
        driven: "front", "rear" or "all".
        front_share: of the torque, where all wheels are driven.
        final_drive: turns of the motor's shaft behind the gears per turn of a wheel.
        gear_ratios: of the gears from the first on; one for a fixed gear.
        efficiency: of gears and final drive.
        steering_ratio: hand wheel over road wheels.
        radius: rolling, of the wheels [m].
    """

    brake_torque_per_bar_front: float | None = None
    brake_torque_per_bar_rear: float | None = None
    driven: str | None = None
    front_share: float | None = None
    final_drive: float | None = None
    gear_ratios: tuple[float, ...] = (1.0,)
    efficiency: float = 1.0
    steering_ratio: float | None = None
    radius: float | None = None

    @classmethod
    def of(cls, table: Table, base: "CarSignals | None" = None) -> "CarSignals":
        """What a table says, over what is known already.

        Raises:
            TwinError: a field is unknown or out of range.
        """
        table.check_keys((*_BOUNDS, "driven", "gear_ratios"))
        changes: dict[str, Any] = {
            name: table.number(name, 0.0, *bounds)
            for name, bounds in _BOUNDS.items()
            if name in table
        }
        if "driven" in table:
            changes["driven"] = table.choice("driven", "rear", DRIVEN)
        if "gear_ratios" in table:
            ratios = table.values["gear_ratios"]
            good = isinstance(ratios, list) and 0 < len(ratios) <= 20
            if not (good and all(isinstance(r, int | float) and 0.0 < r < 100.0 for r in ratios)):
                table.refuse("gear_ratios", "up to 20 numbers above 0, from the first gear on")
            changes["gear_ratios"] = tuple(float(ratio) for ratio in ratios)
        return replace(base or cls(), **changes)


_BOUNDS = {
    "brake_torque_per_bar_front": (0.0, 1e4),
    "brake_torque_per_bar_rear": (0.0, 1e4),
    "front_share": (0.0, 1.0),
    "final_drive": (0.1, 100.0),
    "efficiency": (0.3, 1.0),
    "steering_ratio": (1.0, 100.0),
    "radius": (0.05, 2.0),
}


TEMPLATE = """
[signals]
# What turns signals as cars have them into wheel torques; needed for logs that have such signals.
# driven = "rear"                 # "front", "rear" or "all"
# front_share = 0.4               # of the torque, of a car with all wheels driven
# final_drive = 9.1               # turns of the motor behind the gears per turn of a wheel
# gear_ratios = [1.0]             # from the first gear on; one where there is one
# efficiency = 0.95               # 0.3 to 1; of gears and final drive
# brake_torque_per_bar_front = 60.0  # N m per bar of hydraulic pressure, both wheels of the axle
# brake_torque_per_bar_rear = 40.0
"""  # of a car's file


def derive(
    columns: dict[str, Array], dt: float, car: CarSignals, free_of_gravity: bool
) -> list[str]:
    """Adds our channels that a car's signals give, and takes those signals out.

    Args:
        columns: (N,) by name, in SI units and bar; changed in place.
        dt: sample time [s].
        car: what the signals mean.
        free_of_gravity: whether the accelerations are those of motion, not specific forces.

    Returns:
        Sentences about what was done.

    Raises:
        TwinError: the car does not say what a signal needs.
    """
    done: list[str] = []
    for names, function in (
        (("speed",), _of_speed),
        (("motor_torque", "motor_torque_front", "motor_torque_rear"), _of_motors),
        (("brake_pressure", "brake_pressure_front", "brake_pressure_rear"), _of_pressures),
        (_ROAD_WHEELS, _of_road_wheels),
    ):
        if any(name in columns for name in names):
            done += function(columns, car)
    if "course" in columns:
        done += _of_course(columns, dt)
    if free_of_gravity:
        done += _with_gravity(columns)
    for name in GIVES:
        columns.pop(name, None)
    return done


def _needed(car: CarSignals, field: str, signal: str) -> float:
    value = getattr(car, field)
    if value is None:
        raise TwinError(
            f"{signal} needs the car's {field}; allowed: {field} in [signals] of the car's file or "
            "[car] of the map"
        )
    return value


def _of_speed(columns: dict[str, Array], car: CarSignals) -> list[str]:
    if any(name in columns for name in _WHEEL_SPEEDS):
        raise TwinError("speed is given beside wheel speeds; allowed: one of them (or channels.vx)")
    radius = _needed(car, "radius", "speed")
    for name in _WHEEL_SPEEDS:
        columns[name] = columns["speed"] / radius
    return [f"wheel_speed_*: the vehicle's speed over a radius of {radius:g} m, all four alike."]


def _of_motors(columns: dict[str, Array], car: CarSignals) -> list[str]:
    final = _needed(car, "final_drive", "motor_torque")
    ratios = _ratios(columns, car)
    shares: dict[str, dict[str, float]] = {}
    if "motor_torque" in columns:
        if car.driven is None:
            raise TwinError(
                "motor_torque needs the car's driven axle; allowed: driven = "
                f"{', '.join(repr(name) for name in DRIVEN)} in [signals] of the car's file or "
                "[car] of the map"
            )
        front = {"front": 1.0, "rear": 0.0}.get(car.driven)
        front = _needed(car, "front_share", "driven = 'all'") if front is None else front
        shares["motor_torque"] = {"f": front, "r": 1.0 - front}
    for axle in ("front", "rear"):
        if f"motor_torque_{axle}" in columns:
            shares[f"motor_torque_{axle}"] = {axle[0]: 1.0}
    n = next(iter(columns.values())).size
    torques = {axle: np.zeros(n) for axle in "fr"}
    for signal, axles in shares.items():
        at_motor = columns[signal]
        lost = np.where(at_motor > 0.0, car.efficiency, 1.0 / car.efficiency)
        for axle, share in axles.items():
            torques[axle] = torques[axle] + share * ratios * final * lost * at_motor
    for wheel in WHEELS:
        columns[f"drive_torque_{wheel}"] = 0.5 * torques[wheel[0]]
    return [
        f"drive_torque_*: {', '.join(shares)} times gear and final drive of {final:g}, driven: "
        f"{car.driven or 'each axle by its motor'}."
    ]


def _ratios(columns: Mapping[str, Array], car: CarSignals) -> Array | float:
    """The gear's ratio at each sample; 0 out of gear."""
    if "gear" not in columns:
        if len(car.gear_ratios) > 1:
            raise TwinError(
                "motor_torque needs channels.gear, as the car has "
                f"{len(car.gear_ratios)} gears; allowed: map it, or one gear"
            )
        return float(np.array(car.gear_ratios)[0])
    gear = np.nan_to_num(np.rint(columns["gear"])).astype(int)
    if gear.max() > len(car.gear_ratios):
        raise TwinError(
            f"gear is {gear.max()}; allowed: up to {len(car.gear_ratios)}, as gear_ratios has them"
        )
    # reverse is geared like the first
    table = np.array([0.0, *car.gear_ratios])
    return np.where(gear >= 0, table[np.maximum(gear, 0)], -car.gear_ratios[0])


def _of_pressures(columns: dict[str, Array], car: CarSignals) -> list[str]:
    said = []
    for axle in ("front", "rear"):
        own = f"brake_pressure_{axle}"
        signal = own if own in columns else "brake_pressure"
        names = GIVES[own]
        if signal not in columns:
            if any(name not in columns for name in names):
                raise TwinError(
                    f"{own} is missing; allowed: [channels.{own}], or brake_pressure for both axles"
                )
            continue
        per_bar = _needed(car, f"brake_torque_per_bar_{axle}", signal)
        for name in names:
            columns[name] = 0.5 * per_bar * np.maximum(columns[signal], 0.0)
        said.append(f"{per_bar:g} N m/bar {axle}")
    return [f"brake_torque_*: by pressure, {', '.join(said)}."]


def _of_road_wheels(columns: dict[str, Array], car: CarSignals) -> list[str]:
    ratio = _needed(car, "steering_ratio", "road_wheel_angle")
    sides = [name for name in (_LEFT, _RIGHT) if name in columns]
    if sides and ("road_wheel_angle" in columns or len(sides) == 1):
        raise TwinError(
            f"{sides[0]} is given without the other wheel's or beside road_wheel_angle; allowed: "
            f"{_LEFT} and {_RIGHT}, or road_wheel_angle alone"
        )
    angle = 0.5 * (columns[_LEFT] + columns[_RIGHT]) if sides else columns["road_wheel_angle"]
    columns["steering_wheel_angle"] = ratio * angle
    of = "the mean of both road wheels" if sides else "that of the road wheels"
    return [f"steering_wheel_angle: {of} times {ratio:g}."]


def _of_course(columns: dict[str, Array], dt: float) -> list[str]:
    """The yaw rate by the course over ground, clockwise from north, where the car moves."""
    if "yaw_rate" in columns:
        return ["course: not used, as the log has a yaw rate."]
    course = columns["course"]
    good = np.isfinite(course)
    if good.sum() < 2:
        return []
    index = np.arange(course.size)
    unwrapped = np.interp(index, index[good], np.unwrap(course[good]))
    rate = -np.gradient(unwrapped, dt)
    speed = columns.get("vx", columns.get("speed"))
    slow = np.zeros(rate.size, bool) if speed is None else ~(speed > _SLOWEST)
    rate[~good | slow] = np.nan
    columns["yaw_rate"] = rate
    return ["yaw_rate: the change of the course over ground; sideslip that changes is left out."]


def _with_gravity(columns: dict[str, Array]) -> list[str]:
    """Accelerations of motion as the specific forces that an accelerometer shows."""
    zero = np.zeros(next(iter(columns.values())).size)
    slope, bank = columns.get("slope", zero), columns.get("bank", zero)
    parts: dict[str, Callable[[], Array]] = {
        "ax": lambda: GRAVITY * np.sin(slope),
        "ay": lambda: GRAVITY * np.sin(bank) * np.cos(slope),
        "az": lambda: GRAVITY * np.cos(bank) * np.cos(slope),
    }
    for name, part in parts.items():
        if name in columns:
            columns[name] = columns[name] + part()
    road = [name for name in ("slope", "bank") if name in columns]
    of = f"by {' and '.join(road)}" if road else "of a level road, as no slope is mapped"
    return [f"Accelerations are free of gravity, as the map says: its part {of} is added."]
