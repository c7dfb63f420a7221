"""Units that logs come in, and what each channel of ours is measured in."""

import math

from twin.channels import FURTHER_OUTPUTS, INPUTS, OUTPUTS

GRAVITY = 9.80665  # [m/s2], standard gravity, ISO 80000-3

# By kind of quantity: unit, and how much of ours (SI) one of it is
UNITS = {
    "angle": {"rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0},
    "angular rate": {
        "rad/s": 1.0,
        "deg/s": math.pi / 180.0,
        "°/s": math.pi / 180.0,
        "rpm": math.pi / 30.0,
        "1/min": math.pi / 30.0,
    },
    "speed": {"m/s": 1.0, "km/h": 1.0 / 3.6, "kph": 1.0 / 3.6, "mph": 0.44704},
    "acceleration": {"m/s2": 1.0, "m/s^2": 1.0, "m/s²": 1.0, "g": GRAVITY, "G": GRAVITY},
    "torque": {"N m": 1.0, "Nm": 1.0, "N*m": 1.0, "kN m": 1e3, "kNm": 1e3},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
}

# By what a channel's name starts with
_KINDS = {
    "steering_wheel_angle": "angle",
    "drive_torque": "torque",
    "brake_torque": "torque",
    "road_height": "length",
    **dict.fromkeys(("ax", "ay", "az"), "acceleration"),
    **dict.fromkeys(("roll_rate", "pitch_rate", "yaw_rate", "wheel_speed"), "angular rate"),
    **dict.fromkeys(("vx", "vy"), "speed"),
    **dict.fromkeys(("sideslip", "roll", "pitch"), "angle"),
    "suspension_travel": "length",
}

CHANNELS = (*INPUTS, *OUTPUTS, *FURTHER_OUTPUTS)


def kind_of(channel: str) -> str:
    """The kind of quantity of one of our channels; `UNITS` of it starts with our unit."""
    if channel in _KINDS:
        return _KINDS[channel]
    return _KINDS[channel.rpartition("_")[0]]


def our_unit(channel: str) -> str:
    """The unit of one of our channels."""
    return next(iter(UNITS[kind_of(channel)]))
