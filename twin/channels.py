"""Inputs, measurements and states of every vehicle with four wheels: one record per name.

ISO 8855 axes, SI units, wheels in the order front left, front right, rear left, rear right. The
tuples of names, the indices `U`, `Y`, `X` and the slices derive from the records.
"""

import math
from collections import namedtuple
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

WHEELS = ("fl", "fr", "rl", "rr")
# Of each kind of quantity
SI_UNITS = {
    "acceleration": "m/s2",
    "angle": "rad",
    "angular rate": "rad/s",
    "force": "N",
    "length": "m",
    "ratio": "1",
    "speed": "m/s",
    "torque": "N m",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """What is known of an input, measurement or state by its name.

    Attributes:
        name: unique; the same quantity has one name among inputs, measurements and states.
        quantity: its kind, a key of `SI_UNITS`.
        low, high: the range of any sound car: inputs beyond it are refused, measurements beyond it
            come from a faulty sensor.
        sensor: name of the MuJoCo sensor that measures it; empty where none does.
        sensor_kind: "accelerometer", "gyro" or "jointvel", MuJoCo's element; empty for no sensor.
        axis: which of the sensor's numbers it is.
        noise_floor: least standard deviation of a real sensor's white noise.
        noise_by_snr: whether the noise grows with the signal, TiL Eq. (10); else it is the floor.
        bias_sd: standard deviation of a real sensor's constant error; 0 where it has none.
    """

    name: str
    quantity: str
    low: float = -math.inf
    high: float = math.inf
    sensor: str = ""
    sensor_kind: str = ""
    axis: int = 0
    noise_floor: float = 0.0
    noise_by_snr: bool = True
    bias_sd: float = 0.0

    @property
    def unit(self) -> str:
        """Its SI unit."""
        return SI_UNITS[self.quantity]


def _channels(names: Iterable[str], quantity: str, **fields: Any) -> tuple[Channel, ...]:
    return tuple(Channel(name=name, quantity=quantity, **fields) for name in names)


def _sensor(names: Iterable[str], sensor: str, **fields: Any) -> tuple[Channel, ...]:
    """Channels that are the axes of one sensor of MuJoCo."""
    return tuple(
        channel
        for axis, name in enumerate(names)
        for channel in _channels([name], sensor=sensor, axis=axis, **fields)
    )


def _wheels(name: str) -> tuple[str, ...]:
    return tuple(f"{name}_{wheel}" for wheel in WHEELS)


# Inputs. Ranges: two and a half turns, road wheels below 60 degrees; far beyond any wheel's torque
_STEERING = _channels(["steering_wheel_angle"], "angle", low=-15.0, high=15.0)  # + to the left
_DRIVE = _channels(_wheels("drive_torque"), "torque", low=-1e5, high=1e5)  # wheel against chassis
_BRAKE = _channels(_wheels("brake_torque"), "torque", low=0.0, high=1e5)  # most a brake can hold
_ROAD = _channels(_wheels("road_height"), "length", low=-1e4, high=1e4)  # under each wheel

# Measurements, TiL Eq. (20): specific force and angular rate at the IMU, wheel speeds. Ranges
# chosen: 6 g, twice what a racing car does. Noise: a channel that a drive does not excite is not
# noise-free. Biases: a cheap IMU, chosen.
_ACCELERATIONS = _sensor(
    ("ax", "ay", "az"), "acceleration", sensor_kind="accelerometer", quantity="acceleration",
    low=-60.0, high=60.0, noise_floor=0.05, bias_sd=0.1,
)  # fmt: skip
_RATES = _sensor(
    ("roll_rate", "pitch_rate", "yaw_rate"), "rates", sensor_kind="gyro", quantity="angular rate",
    low=-10.0, high=10.0, noise_floor=0.003, bias_sd=0.005,
)  # fmt: skip
_WHEEL_SPEEDS = tuple(
    channel
    for name in _wheels("wheel_speed")
    for channel in _sensor(
        [name], name, sensor_kind="jointvel", quantity="angular rate",
        low=-500.0, high=500.0, noise_floor=0.05, noise_by_snr=False,
    )
)  # fmt: skip

# States: those of the IMU, position in the world, speeds and rates in the body frame
_POSITION = _channels(("x", "y", "z"), "length")
_ROTATION = _channels(("roll", "pitch", "yaw"), "angle")
_TRAVELS = _channels(_wheels("suspension_travel"), "length")  # positive when the wheel moves up
_WHEEL_ANGLES = _channels(_wheels("wheel_angle"), "angle")
_VELOCITY = _channels(("vx", "vy", "vz"), "speed")
_TRAVEL_RATES = _channels(_wheels("suspension_rate"), "speed")
_SIDESLIP = _channels(["sideslip"], "angle")
_PEDAL = _channels(["accelerator_pedal"], "ratio")  # of its travel; pressed, no foot brakes

_FORCES = _channels(("fx", "fy", "fz"), "force")
_MOMENTS = _channels(("mx", "my", "mz"), "torque")
_SLIPS = (*_channels(["slip_ratio"], "ratio"), *_channels(["slip_angle", "camber"], "angle"))

_INPUTS = (*_STEERING, *_DRIVE, *_BRAKE, *_ROAD)
_OUTPUTS = (*_ACCELERATIONS, *_RATES, *_WHEEL_SPEEDS)
_FURTHER_OUTPUTS = (*_VELOCITY[:2], *_SIDESLIP, *_ROTATION[:2], *_TRAVELS, *_PEDAL)
_STATES = (
    *(*_POSITION, *_ROTATION, *_TRAVELS, *_WHEEL_ANGLES),
    *(*_VELOCITY, *_RATES, *_TRAVEL_RATES, *_WHEEL_SPEEDS),
)
_TYRE_OUTPUTS = (*_FORCES, *_MOMENTS, *_SLIPS)


def _names(channels: Iterable[Channel]) -> tuple[str, ...]:
    return tuple(channel.name for channel in channels)


def span(names: Sequence[str], block: Sequence[str]) -> slice:
    """Where names that follow each other stand.

    Args:
        names: all of an array's columns.
        block: some of them, in the same order without a gap.
    """
    first = names.index(block[0])
    return slice(first, first + len(block))


INPUTS = _names(_INPUTS)
OUTPUTS = _names(_OUTPUTS)
# What a log may carry behind OUTPUTS
FURTHER_OUTPUTS = _names(_FURTHER_OUTPUTS)
STATES = _names(_STATES)
# What a wheel's tyre does, in the frame of its contact patch: forces and moments on the wheel,
# slips as the relaxed tyre feels them
TYRE_OUTPUTS = _names(_TYRE_OUTPUTS)
# The same of all four tyres: extended variables of TiL Eqs. (2)-(3)
EXTENDED = tuple(f"{name}_{wheel}" for wheel in WHEELS for name in TYRE_OUTPUTS)

CHANNEL: Mapping[str, Channel] = {
    channel.name: channel
    for channel in (*_INPUTS, *_OUTPUTS, *_FURTHER_OUTPUTS, *_STATES, *_TYRE_OUTPUTS)
}
"""The record of each name; compiled code knows channels by the indices below."""

# Indices by name, as in `y[Y.ax]`: of inputs, measurements, states and the outputs of a tyre
U = namedtuple("U", INPUTS)._make(range(len(INPUTS)))
Y = namedtuple("Y", OUTPUTS)._make(range(len(OUTPUTS)))
X = namedtuple("X", STATES)._make(range(len(STATES)))
TYRE = namedtuple("TYRE", TYRE_OUTPUTS)._make(range(len(TYRE_OUTPUTS)))

# Blocks of the inputs
DRIVE_TORQUES = span(INPUTS, _names(_DRIVE))
BRAKE_TORQUES = span(INPUTS, _names(_BRAKE))
TORQUES = slice(DRIVE_TORQUES.start, BRAKE_TORQUES.stop)
ROAD_HEIGHTS = span(INPUTS, _names(_ROAD))
# Blocks of the measurements
ACCELERATIONS = span(OUTPUTS, _names(_ACCELERATIONS))
RATES = span(OUTPUTS, _names(_RATES))
IMU = slice(ACCELERATIONS.start, RATES.stop)
WHEEL_SPEEDS = span(OUTPUTS, _names(_WHEEL_SPEEDS))
# Blocks of the states
POSITION = span(STATES, _names(_POSITION))
ROTATION = span(STATES, _names(_ROTATION))
TRAVELS = span(STATES, _names(_TRAVELS))
WHEEL_ANGLES = span(STATES, _names(_WHEEL_ANGLES))
VELOCITY = span(STATES, _names(_VELOCITY))
ANGULAR_VELOCITY = span(STATES, _names(_RATES))
TRAVEL_RATES = span(STATES, _names(_TRAVEL_RATES))
SPINS = span(STATES, _names(_WHEEL_SPEEDS))
