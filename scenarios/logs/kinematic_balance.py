"""Do wheels, yaw rate and accelerations describe one motion, in every part of a drive?

The equations of `scenarios.logs.checks` are fitted to a whole drive, where the parts that are right
outweigh a channel that breaks on the way. Here each is held to windows of some seconds: every wheel
against the other three, a_y against v r, a_x against the change of speed. All of it holds near the
limits, too, where wheels slip for a moment only and the body's lateral motion averages out.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from scenarios.logs.signals import WHEEL_SPEEDS, CarFacts, Signals

Array = NDArray[np.float64]

WINDOW = 10.0  # [s], each half over the next
_SLOWEST = 5.0  # [m/s]; slower, a wheel's speed is coarse
_ALIKE = 0.05  # of the speed, median of a window; laps and lane changes at the limits: 0.025
_SMOOTH = 2.0  # [s] over which the body's lateral motion averages out
_LATERAL = (0.8, 1.3)  # a_y over v r in a window; limits and drawn real cars: 0.91 to 1.17
_LEAST_LATERAL = 0.8  # [m/s2] standard deviation of v r that tells it
_LEAST_LONGITUDINAL = 0.5  # [m/s2] standard deviation of a_x, or of the change of speed
_FOLLOWS = 0.6  # least correlation of these; limits and drawn real cars: 0.94
_STEADY = 0.5  # of one's standard deviation the other has at least; the same: 0.63


class Mismatch(NamedTuple):
    """What does not belong together.

    Attributes:
        channels: among which one is wrong.
        words: how it shows.
    """

    channels: tuple[str, ...]
    words: str


def mismatches(signals: Signals, car: CarFacts | None) -> Iterator[Mismatch]:
    """The first window of every equation that does not hold."""
    if not signals.has("speed"):
        return
    yield from _wheels(signals, car)
    speed = WHEEL_SPEEDS if signals.speed_name == "wheels" else (signals.speed_name,)
    if signals.speed_name == "wheels" and car is None:
        return
    yield from _lateral(signals, speed)
    yield from _longitudinal(signals, speed)


def _windows(signals: Signals, *names: str) -> Iterator[tuple[slice, NDArray[np.bool_]]]:
    """Windows with enough good samples of channels in motion, and which of them are good."""
    good = signals.where(*names) & (signals.known["speed"] > _SLOWEST)
    size = round(WINDOW / signals.dt)
    for first in range(0, max(good.size - size, 0) + 1, max(size // 2, 1)):
        window = slice(first, first + size)
        if good[window].sum() > 0.5 * size:
            yield window, good[window]


def _wheels(signals: Signals, car: CarFacts | None) -> Iterator[Mismatch]:
    """Every wheel against the median of the other three, carried to its corner."""
    if not signals.has(*WHEEL_SPEEDS) or car is None:
        return
    rolling = _rolling(signals, car)
    for wheel, name in enumerate(WHEEL_SPEEDS):
        others = np.median(np.delete(rolling, wheel, axis=0), axis=0)
        off = (rolling[wheel] - others) / np.maximum(others, _SLOWEST)
        for window, good in _windows(signals, *WHEEL_SPEEDS):
            if np.median(np.abs(off[window][good])) > _ALIKE:
                share = float(np.median(off[window][good]))
                yield Mismatch(
                    (name,),
                    f"{name} is {100.0 * abs(share):.2g} % {'above' if share > 0.0 else 'below'} "
                    f"the other wheels {_when(signals, window)}",
                )
                break


def _rolling(signals: Signals, car: CarFacts) -> Array:
    """(4, N) speed of the middle of the rear axle by each wheel [m/s]."""
    zero = np.zeros(signals.time.size)
    across = 0.5 * car.track * signals.known.get("yaw_rate", zero)
    angle = signals.known.get("steering_wheel_angle", zero) / car.steering_ratio
    path = angle  # of the front axle
    if signals.has("yaw_rate"):
        speed = np.maximum(signals.known["speed"], _SLOWEST)
        path = np.arctan2(signals.known["yaw_rate"] * car.wheelbase, speed)
    turned = np.cos(path) / np.maximum(np.cos(angle - path), 0.5)
    fl, fr, rl, rr = (car.radius * signals.known[name] for name in WHEEL_SPEEDS)
    return np.array([fl * turned + across, fr * turned - across, rl + across, rr - across])


def _lateral(signals: Signals, speed: tuple[str, ...]) -> Iterator[Mismatch]:
    if not signals.has("ay", "yaw_rate"):
        return
    size = max(round(_SMOOTH / signals.dt), 1)
    turning = uniform_filter1d(signals.known["speed"] * signals.known["yaw_rate"], size)
    ay = uniform_filter1d(signals.known["ay"], size)
    for window, good in _windows(signals, "ay", "yaw_rate", "speed"):
        a, b = ay[window][good], turning[window][good]
        if max(a.std(), b.std()) < _LEAST_LATERAL:
            continue
        slope = float(np.cov(a, b)[0, 1] / max(b.var(), 1e-9))
        if not _LATERAL[0] <= slope <= _LATERAL[1]:
            yield Mismatch(
                ("ay", "yaw_rate", *speed),
                f"ay is {slope:.2g} times the speed times the yaw rate {_when(signals, window)}",
            )
            return


def _longitudinal(signals: Signals, speed: tuple[str, ...]) -> Iterator[Mismatch]:
    if not signals.has("ax"):
        return
    rate = signals.rate("speed")
    for window, good in _windows(signals, "ax", "speed"):
        a, b = signals.known["ax"][window][good], rate[window][good]
        more, less = max(a.std(), b.std()), min(a.std(), b.std())
        if more < _LEAST_LONGITUDINAL:
            continue
        if less < _STEADY * more or float(np.corrcoef(a, b)[0, 1]) < _FOLLOWS:
            yield Mismatch(
                ("ax", *speed),
                f"ax does not follow the change of speed {_when(signals, window)}",
            )
            return


def _when(signals: Signals, window: slice) -> str:
    last = min(window.stop, signals.time.size) - 1
    return f"from {signals.time[window.start]:.0f} to {signals.time[last]:.0f} s"
