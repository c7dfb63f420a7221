"""Manoeuvres by a few numbers: speeds that rise and fall, and a steering of three sines.

Each number of a `Design` lies between 0 and 1, so that any optimiser can take it. The steering is
laid out as a lateral acceleration, which a bicycle's steady turn makes an angle of the hand wheel.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenarios.driving.drivers import driver_of
from scenarios.planning.drive import Motion
from scenarios.planning.limits import PlanLimits
from twin import Vehicle

Array = NDArray[np.float64]

DT = 0.001
# What is chosen: its least and largest value; "log" where decades count
VARIABLES: Mapping[str, tuple[float, float, str]] = {
    "fast": (0.0, 1.0, ""),  # share of the range of speeds
    "drop": (0.0, 1.0, ""),  # share of what is above the slowest speed
    "braking": (0.2, 1.0, ""),  # share of what is allowed
    "accelerating": (0.3, 1.0, ""),
    "hold_fast": (0.0, 3.0, ""),  # [s]
    "hold_slow": (0.0, 3.0, ""),
    "slow_sine": (0.06, 0.5, "log"),  # [Hz]
    "middle_sine": (0.4, 1.6, "log"),
    "quick_sine": (1.2, 4.0, "log"),
    "slow_weight": (0.0, 1.0, ""),
    "middle_weight": (0.0, 1.0, ""),
    "quick_weight": (0.0, 1.0, ""),
    "level": (0.3, 1.0, ""),  # share of the lateral acceleration that is allowed
    "while_braking": (0.0, 1.0, ""),  # share of the steering while the car brakes
}
# Where a search begins: the mixed drive's idea
FIRST = {
    "fast": 0.9, "drop": 0.9, "braking": 0.9, "accelerating": 0.9, "hold_fast": 0.1,
    "hold_slow": 0.1, "slow_sine": 0.5, "middle_sine": 0.5, "quick_sine": 0.5,
    "slow_weight": 0.4, "middle_weight": 0.6, "quick_weight": 0.6, "level": 1.0,
    "while_braking": 0.6,
}  # fmt: skip
_FADE = 0.5  # [s] over which the steering begins, and ends before a stop
_PEDAL = 200  # samples over which a foot goes to the brake
_PEAK = 0.5 * np.pi  # of the acceleration of a raised cosine, over its mean


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A manoeuvre in the units of people; see `VARIABLES`.

    Attributes:
        fast, slow: speeds between which the car goes to and fro [m/s].
        braking, accelerating: peak [m/s2].
        hold_fast, hold_slow: seconds at each.
        frequencies: (3,) of the steering's sines [Hz].
        accelerations: (3,) amplitudes, as lateral acceleration [m/s2].
        while_braking: share of the steering while the car brakes.
    """

    fast: float
    slow: float
    braking: float
    accelerating: float
    hold_fast: float
    hold_slow: float
    frequencies: tuple[float, ...]
    accelerations: tuple[float, ...]
    while_braking: float

    def times(self) -> tuple[float, float, float, float]:
        """Seconds of a cycle: speeding up, holding, braking, holding."""
        change = self.fast - self.slow
        up, down = _PEAK * change / self.accelerating, _PEAK * change / self.braking
        rest = max(2.0 - up - down - self.hold_fast - self.hold_slow, 0.0)
        return up, self.hold_fast + rest, down, self.hold_slow


def design_of(shares: Mapping[str, float], limits: PlanLimits) -> Design:
    """The design of numbers between 0 and 1, within the limits.

    Args:
        shares: by name of `VARIABLES`.
        limits: what is allowed.
    """
    value = {name: _value(name, shares[name]) for name in VARIABLES}
    fastest = limits.fast
    if np.isfinite(limits.length):  # a pass reaches its speed on the first half of the area
        run_up = _PEAK / limits.accelerating + _PEAK / limits.braking
        fastest = min(fastest, max(np.sqrt(limits.length / run_up), limits.slow))
    fast = limits.slow + value["fast"] * (fastest - limits.slow)
    weights = np.array([value[f"{name}_weight"] for name in ("slow", "middle", "quick")])
    accelerations = value["level"] * limits.lateral * weights / max(float(weights.sum()), 1e-3)
    return Design(
        fast=fast,
        slow=fast - value["drop"] * (fast - limits.slow),
        braking=value["braking"] * limits.braking,
        accelerating=value["accelerating"] * limits.accelerating,
        hold_fast=value["hold_fast"],
        hold_slow=value["hold_slow"],
        frequencies=tuple(value[f"{name}_sine"] for name in ("slow", "middle", "quick")),
        accelerations=tuple(accelerations.tolist()),
        while_braking=value["while_braking"],
    )


def _value(name: str, share: float) -> float:
    low, high, kind = VARIABLES[name]
    if kind == "log":
        return float(low * (high / low) ** share)
    return float(low + share * (high - low))


def motion_of(design: Design, vehicle: Vehicle, limits: PlanLimits, seconds: float) -> Motion:
    """What is to be driven: on a road for some seconds, in an area one pass.

    Args:
        design: of the manoeuvre.
        vehicle: the car, whose steering is known from its files.
        limits: whether the road has an end.
        seconds: on a road.
    """
    area = np.isfinite(limits.length)
    speed, braking = cycles(design, 3.0 * limits.length / design.slow if area else seconds)
    if area:
        speed, braking = _one_pass(design, speed, braking, limits.length)
    time = np.arange(speed.size) * DT
    lateral = np.zeros(speed.size)
    for frequency, amplitude in zip(design.frequencies, design.accelerations, strict=True):
        lateral += amplitude * np.sin(2.0 * np.pi * frequency * time)
    fade = np.clip(time / _FADE, 0.0, 1.0)
    if area:
        fade *= np.clip((time[-1] - time) / (2.0 * _FADE), 0.0, 1.0)
    smooth = np.convolve(braking, np.full(_PEDAL, 1.0 / _PEDAL), mode="same")
    weight = fade * (1.0 + (design.while_braking - 1.0) * smooth)
    return Motion(
        name="plan",
        speed=speed,
        steering=weight * lateral * hand_wheel_of(vehicle, np.maximum(speed, design.slow)),
        repeats=area,
    )


def hand_wheel_of(vehicle: Vehicle, speed: Array) -> Array:
    """(N,) angle of the hand wheel over the lateral acceleration of a steady turn [rad s2/m]."""
    driver = driver_of(vehicle)
    return driver.steering_ratio * (
        driver.wheelbase / np.maximum(speed, 5.0) ** 2 + driver.understeer
    )


def cycles(design: Design, seconds: float) -> tuple[Array, Array]:
    """(N,) speeds [m/s] from the slow one on, and (N,) how much the car brakes, 0 to 1."""
    up, fast, down, slow = design.times()
    parts = ((up, design.fast, 0.0), (fast, design.fast, 0.0),
             (down, design.slow, 1.0), (slow, design.slow, 0.0))  # fmt: skip
    speeds, brakes, before = [], [], design.slow
    for duration, after, braking in parts:
        share = np.arange(round(duration / DT)) / max(round(duration / DT), 1)
        speeds.append(before + (after - before) * 0.5 * (1.0 - np.cos(np.pi * share)))
        brakes.append(braking * np.clip(5.0 * np.sin(np.pi * share), 0.0, 1.0))
        before = after
    n = round(seconds / DT)
    return _repeated(speeds, n), _repeated(brakes, n)


def _repeated(parts: Sequence[Array], n: int) -> Array:
    one = np.concatenate(parts)
    return np.resize(one, n)


def _one_pass(design: Design, speed: Array, braking: Array, length: float) -> tuple[Array, Array]:
    """From a standstill through the cycles to a standstill, within a length [m]."""
    start = _ramp(0.0, float(speed[0]), design.accelerating)
    speed = np.concatenate([start, speed])
    braking = np.concatenate([np.zeros(start.size), braking])
    gone = np.cumsum(speed) * DT
    stopping = 0.5 * _PEAK * speed**2 / design.braking + 0.3 * speed  # a little late at the pedal
    end = int(np.argmax(gone + stopping >= length - 2.0))
    stop = _ramp(float(speed[end - 1]), 0.0, design.braking)
    rest = np.zeros(round(0.5 / DT))
    return (
        np.concatenate([speed[:end], stop, rest]),
        np.concatenate([braking[:end], np.ones(stop.size), np.ones(rest.size)]),
    )


def _ramp(before: float, after: float, peak: float) -> Array:
    n = max(round(_PEAK * abs(after - before) / peak / DT), 1)
    return before + (after - before) * 0.5 * (1.0 - np.cos(np.pi * np.arange(n) / n))
