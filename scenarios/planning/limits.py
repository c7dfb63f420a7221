"""Within what a planned manoeuvre has to stay."""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin import STATES, Drive, TwinError, Vehicle, X

Array = NDArray[np.float64]

GRAVITY = 9.81
ROADS = {"straight": 10.0, "circuit": 8.0}  # [m], width of test tracks; chosen
_USABLE_GRIP = 0.85  # of the horizontal acceleration that the tyres can give; chosen
_FILTER = 0.05  # [s] over which accelerations are averaged before they are compared with limits
_SLOWEST = 3.0  # [m/s]: slower the observer has no use for the wheels


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanLimits:
    """What may be used.

    Attributes:
        slow, fast: range of the speed [m/s].
        lateral: acceleration [m/s2].
        braking, accelerating: [m/s2].
        jerk: of the horizontal acceleration [m/s3].
        steering_rate: of the hand wheel [rad/s].
        seconds: of driving.
        road: of `ROADS`: what is driven along; a straight one has no end.
        width: of the road or area [m].
        length: of the area, in which each pass starts and ends at a standstill [m]; inf: a road.
    """

    slow: float = 10.0
    fast: float = 25.0
    lateral: float = 5.0
    braking: float = 6.0
    accelerating: float = 3.0
    jerk: float = 100.0
    steering_rate: float = 10.0
    seconds: float = 60.0
    road: str = "straight"
    width: float = ROADS["straight"]
    length: float = np.inf

    def __post_init__(self) -> None:
        """Checks what a user may have written."""
        for name, low, high, unit in (
            ("max-ay", 0.2, 15.0, "m/s2"), ("max-braking", 0.5, 12.0, "m/s2"),
            ("max-jerk", 1.0, 1e4, "m/s3"), ("max-steering-rate", 0.2, 40.0, "rad/s"),
            ("max-time", 5.0, 600.0, "s"),
        ):  # fmt: skip
            value = {
                "max-ay": self.lateral, "max-braking": self.braking, "max-jerk": self.jerk,
                "max-steering-rate": self.steering_rate, "max-time": self.seconds,
            }[name]  # fmt: skip
            if not low <= value <= high:
                raise TwinError(f"--{name}: {value:g} {unit}; allowed: {low:g} to {high:g} {unit}")
        if not _SLOWEST <= self.slow <= self.fast <= 80.0:
            raise TwinError(
                f"--speed: {self.slow:g}..{self.fast:g} m/s; allowed: low..high between "
                f"{_SLOWEST:g} and 80 m/s"
            )

    def check(self, vehicle: Vehicle) -> None:
        """Whether this car can do anything within them.

        Raises:
            TwinError: the area is too narrow or too short.
        """
        least = 1.5 * max(vehicle.figures.track) + 0.5
        if self.width < least:
            raise TwinError(f"--area: {self.width:g} m wide; allowed: {least:.1f} m or more")
        needed = self.slow**2 * (0.6 / self.accelerating + 0.6 / self.braking) + self.slow
        if self.length < needed:
            raise TwinError(
                f"--area: {self.length:g} m long; allowed: {np.ceil(needed):g} m or more, to reach "
                f"{self.slow:g} m/s and to stop"
            )


def area(text: str) -> tuple[float, float]:
    """Length and width [m] of an area as in `200x30`.

    Raises:
        TwinError: it is none.
    """
    match = re.fullmatch(r"\s*([0-9.]+)\s*[x\N{MULTIPLICATION SIGN}*]\s*([0-9.]+)\s*m?\s*", text)
    try:
        length, width = (float(part) for part in match.groups()) if match else (0.0, 0.0)
    except ValueError:
        length = width = 0.0
    if not (length > 0.0 and width > 0.0):
        raise TwinError(f"--area: {text!r}; allowed: length x width in m, as in 200x30")
    return max(length, width), min(length, width)


def speeds(text: str) -> tuple[float, float]:
    """Range of speeds [m/s] as in `15..25`.

    Raises:
        TwinError: it is none.
    """
    match = re.fullmatch(r"\s*([0-9.]+)\s*\.\.\s*([0-9.]+)\s*(?:m/s)?\s*", text)
    try:
        if match is None:
            raise ValueError
        return float(match[1]), float(match[2])
    except ValueError:
        raise TwinError(
            f"--speed: {text!r}; allowed: lowest..highest in m/s, as in 15..25"
        ) from None


def strain(drive: Drive, left: Array, limits: PlanLimits, vehicle: Vehicle) -> dict[str, float]:
    """How much of each limit that depends on the steering a drive uses; 1: all of it.

    Args:
        drive: noise-free.
        left: (N,) of the middle of the road [m].
        limits: allowed.
        vehicle: that was driven.
    """
    dt = drive.dt
    ax, ay = (_smooth(_acceleration(drive, axis), round(_FILTER / dt)) for axis in (0, 1))
    grip = _USABLE_GRIP * GRAVITY * min(vehicle.grip.friction)
    room = max(0.5 * (limits.width - max(vehicle.figures.track) - 0.2), 0.1)
    turning = np.abs(np.diff(drive.channel("steering_wheel_angle"))).max() / dt
    jerk = np.hypot(np.gradient(ax, dt), np.gradient(ay, dt))
    return {
        "lateral acceleration": float(np.abs(ay).max()) / limits.lateral,
        "grip": float(np.hypot(ax, ay).max()) / grip,
        "jerk": float(jerk.max()) / limits.jerk,
        "steering rate": float(turning) / limits.steering_rate,
        "width": float(np.abs(left).max()) / room,
    }


def _acceleration(drive: Drive, axis: int) -> Array:
    """(N,) of the body along an axis of its own, in the plane of the road [m/s2]."""
    vx, vy, rate = (drive.truth[STATES[k]] for k in (X.vx, X.vy, X.yaw_rate))
    if axis == 0:
        return np.gradient(vx, drive.dt) - rate * vy
    return np.gradient(vy, drive.dt) + rate * vx


def _smooth(values: Array, size: int) -> Array:
    """(N,) mean over so many samples."""
    from scipy.ndimage import uniform_filter1d

    return uniform_filter1d(values, max(size, 1), mode="nearest")
