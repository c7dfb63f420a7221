"""Checks of a drive against kinematics and its car: a wrong sign, unit or delay shows before
anything is estimated.

Both sides of an equation pass the same low-pass filter; then the left side is fitted to the right
one, with the lag at which both are most alike. Gravity on a rolling or pitching body and slopes of
the road are left out, hence the wide limits.
"""  # noqa: D205

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.logs.fits import Fit, fit
from scenarios.logs.signals import (
    BRAKE_TORQUES,
    DRIVE_TORQUES,
    TYPICAL_RADIUS,
    WHEEL_SPEEDS,
    CarFacts,
    Signals,
    facts_of,
    signals_of,
)
from twin import Drive, Vehicle

Array = NDArray[np.float64]

LEAST_CORRELATION = 0.5
SLOPES = (0.8, 1.25)
LAGS = (-0.1, 0.1)  # [s]
_GRIP = {"ax": 2.0, "ay": 4.0}  # [m/s2] below which tyres of any car hardly slip; chosen
# The outer wheel is loaded and turns faster: what that adds to the slope of the wheels' difference,
# for each (m/s)2 of speed; 0.0024 in the SUV, 0.0013 in a low car
_LOADED_WHEELS = 0.004
_GRIP_DRIVE = 0.8  # [m/s2] that an axle drives with
_BEND = 0.06  # [1/m] of curvature, some 8 degrees of the road wheels
_REAR_COMPLIANCE = 0.008  # [s2/m] of sideslip behind per lateral acceleration: 4.5 degrees per g
_AX_SLOPES = (0.9, 1.25)  # gravity on the pitching body adds some 5 %
_TYPICAL_TRACK = 1.55  # [m]
TORQUES = "torques"  # stands for all of them where a name is shown


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One equation and what the drive says of it.

    Attributes:
        name: the equation.
        channels: that stand in it.
        correlation: of both sides as they come; NaN where it could not be checked.
        slope: of the fit of the left side to the right one.
        unit: of the slope.
        lag: [s] by which the left side comes late.
        verdict: in words; "good" if nothing is wrong.
        fault: "sign", "scale", "lag", "clock", "gravity" or "unlike"; empty if there is none or
            nothing was checked.
        fit: all of it.
    """

    name: str
    channels: tuple[str, ...]
    correlation: float
    slope: float
    unit: str
    lag: float
    verdict: str
    fault: str = ""
    fit: Fit | None = None


class Equation(NamedTuple):
    """Two sides that must be alike.

    Attributes:
        name: as it is shown.
        channels: that it needs, for messages and for blame.
        left, right: (N,) each, of `good` samples.
        good: (N,) where it holds.
        least: standard deviation of the right side that counts as excited.
        slopes: allowed.
        lags: of the left side that are no fault [s].
        unit: of the slope.
        alike: least correlation.
        either: whether the left side may show that it is excited, too.
        drift: of the lag over the drive that is a fault [s]; a lag that depends on speed grows.
    """

    name: str
    channels: tuple[str, ...]
    left: Array
    right: Array
    good: NDArray[np.bool_]
    least: float
    slopes: tuple[float, float] = SLOPES
    lags: tuple[float, float] = LAGS
    unit: str = "1"
    alike: float = LEAST_CORRELATION
    either: bool = False
    drift: float = np.inf


def checks(drive: Drive, vehicle: Vehicle | None = None) -> list[Check]:
    """All checks, those that lack a channel included.

    A channel that is not measured is taken from the truth, where that has it.

    Args:
        drive: a log.
        vehicle: the car that drove; with it steering, torques and radii are checked as well.

    Raises:
        TwinError: the drive's samples are not uniform, or the car's files are broken.
    """
    car = facts_of(vehicle) if vehicle is not None else None
    return checks_of(signals_of(drive, car), car)


def checks_of(signals: Signals, car: CarFacts | None, *, lags: bool = True) -> list[Check]:
    """The same of signals; without lags a delay is not looked for, which is quick."""
    made = {equation.name: _check(equation, signals, lags) for equation in equations(signals, car)}
    if signals.has("az"):
        made[_AZ] = _mean_check(signals)
    found = list(made.values())
    for name, needs in _NEEDS.items():
        if not any(check.name.startswith(name) for check in found):
            found.append(_unmade(name, needs, signals))
    return found


_AZ = "az = 9.81 m/s2 at the mean"
# What a check needs at least, for those that cannot be made; by the start of their name
_NEEDS = {
    "ay = ": ("ay", "yaw_rate", "vx"),
    "ax = ": ("ax", "vx"),
    "yaw_rate ~ ": ("yaw_rate", "vx", "steering_wheel_angle"),
    "roll_rate ~ day/dt": ("roll_rate", "ay"),
    "pitch_rate ~ -dax/dt": ("pitch_rate", "ax"),
    "vx = radius wheel speed": ("vx", *WHEEL_SPEEDS),
    _AZ: ("az",),
}


def equations(signals: Signals, car: CarFacts | None) -> Iterator[Equation]:
    """What can be asked of these channels."""
    speed = signals.speed_name
    if speed:
        yield from _of_accelerations(signals, speed, car)
        yield from _of_steering(signals, speed, car)
        yield from _of_torques(signals, speed, car)
    for name, left, right, sign in (
        ("roll_rate ~ day/dt", "roll_rate", "ay", 1.0),
        ("pitch_rate ~ -dax/dt", "pitch_rate", "ax", -1.0),
    ):
        if signals.has(left, right):
            yield Equation(
                name=name,
                channels=(left, right),
                left=signals.known[left],
                right=sign * signals.rate(right),
                good=signals.where(left, right),
                least=0.3,
                slopes=(1e-4, 0.1),  # rad per m/s2: a car rolls by some 0.5 degrees
                lags=(-0.25, 0.35),
                unit="s2/m",
                alike=0.4,
            )
    if signals.has("vx", "wheels"):
        slopes = (0.85 * car.radius, 1.15 * car.radius) if car else (0.2, 0.6)
        yield Equation(
            name="vx = radius wheel speed",
            channels=("vx", *WHEEL_SPEEDS),
            left=signals.known["vx"],
            right=signals.known["wheels"],
            good=signals.where("vx", "wheels") & _hardly_bent(signals),
            least=1.0,
            slopes=slopes,
            lags=(-0.12, 0.12),
            unit="m",
        )


def _hardly_bent(signals: Signals) -> NDArray[np.bool_]:
    """(N,) where wheels go as far as the car: front wheels go further in a sharp bend."""
    if not signals.has("yaw_rate"):
        return np.ones(signals.time.size, dtype=np.bool_)
    return np.abs(signals.known["yaw_rate"]) < _BEND * np.abs(signals.known["speed"])


def _with_grip(signals: Signals, left: str, right: str, car: CarFacts | None) -> NDArray[np.bool_]:
    """(N,) where two wheels roll: slip makes more of their difference than the bend, near limits.

    Args:
        signals: of the drive.
        left: wheel speed of one axle.
        right: the other one of it.
        car: that drove, if it is known.
    """
    grip = np.ones(signals.time.size, dtype=np.bool_)
    torques = [name.replace("wheel_speed", "drive_torque") for name in (left, right)]
    if car is not None and signals.has(*torques):
        drive = np.sum([signals.known[name] for name in torques], axis=0)
        grip &= np.abs(drive) < _GRIP_DRIVE * car.mass * car.radius
    for name, most in _GRIP.items():
        if signals.has(name):
            grip &= np.abs(signals.known[name]) < most
    if not signals.has("ay") and signals.has("yaw_rate", "speed"):
        grip &= np.abs(signals.known["yaw_rate"] * signals.known["speed"]) < _GRIP["ay"]
    return grip


def _speed_channels(speed: str) -> tuple[str, ...]:
    return WHEEL_SPEEDS if speed == "wheels" else (speed,)


def _of_accelerations(signals: Signals, speed: str, car: CarFacts | None) -> Iterator[Equation]:
    """What an IMU at the body shows of its motion."""
    unit, slopes = "1", SLOPES
    v = signals.known["speed"]
    if speed == "wheels" and car is None:
        v, unit, slopes = signals.known["wheels"], "m", (0.2, 0.6)  # the slope is the radius
    scale = 1.0 if unit == "1" else TYPICAL_RADIUS
    with_vy = signals.has("vy", "yaw_rate")
    if signals.has("ay", "yaw_rate"):
        side = signals.rate("vy") if with_vy else np.zeros(v.size)
        right = v * signals.known["yaw_rate"]
        left = signals.known["ay"]
        left, right = (left, right + side) if unit == "1" else (left - side, right)
        names = ("ay", "yaw_rate", *(["vy"] if with_vy else []))
        yield Equation(
            name=f"ay = {speed} yaw_rate" + (" + dvy/dt" if with_vy else ""),
            channels=(*names, *_speed_channels(speed)),
            left=left,
            right=right,
            good=signals.where(*names, "speed"),
            least=0.2 / scale,
            # without vy a quick steer lessens ay by the lateral motion of the body, and ay comes
            # later by the speed times what the rear tyres give way
            slopes=slopes if with_vy else (0.45 * slopes[0] / SLOPES[0], slopes[1]),
            lags=LAGS if with_vy else (LAGS[0], LAGS[1] + _late_by_tyres(signals)),
            unit=unit,
        )
    if signals.has("ax"):
        right = np.gradient(v, signals.dt)
        turning = with_vy and unit == "1"
        if turning:
            right = right - signals.known["vy"] * signals.known["yaw_rate"]
        yield Equation(
            name=f"ax = d{speed}/dt" + (" - vy yaw_rate" if turning else ""),
            channels=("ax", *_speed_channels(speed), *(["vy", "yaw_rate"] if turning else [])),
            left=signals.known["ax"],
            right=right,
            good=signals.where("ax", "speed"),
            least=0.2 / scale,
            slopes=slopes if unit == "m" else _AX_SLOPES,
            lags=(-0.1, 0.18),  # wheels under torque run ahead
            unit=unit,
        )


def _late_by_tyres(signals: Signals) -> float:
    """How late ay may be against v r, as the body's sideslip grows with it [s]."""
    speed = signals.known["speed"][signals.where("speed")]
    return _REAR_COMPLIANCE * float(np.median(speed)) if speed.size else 0.0


def _of_steering(signals: Signals, speed: str, car: CarFacts | None) -> Iterator[Equation]:
    """What turns a car, and what its wheels show of it."""
    radius, track = (car.radius, car.track) if car else (TYPICAL_RADIUS, _TYPICAL_TRACK)
    v = signals.known["speed"]
    angle = signals.known.get("steering_wheel_angle")
    turning, turns = None, 1.0  # the yaw rate at the road wheels' angle
    if angle is not None:
        turns = car.steering_ratio * car.wheelbase if car else 1.0
        turning = v * angle / turns
    if signals.has("yaw_rate") and turning is not None:
        yield Equation(
            name=f"yaw_rate ~ {speed} steering_wheel_angle",
            channels=("yaw_rate", "steering_wheel_angle", *_speed_channels(speed)),
            left=signals.known["yaw_rate"],
            right=turning,
            good=signals.where("yaw_rate", "speed", "steering_wheel_angle"),
            least=0.02 if car else 0.5,
            slopes=(0.2, 1.3) if car else (1e-4, 0.2),  # 1/(wheelbase times ratio): 0.02/m
            lags=(-0.08, 0.3),  # a car answers after some 0.1 s
            unit="1" if car else "1/m",
            either=car is not None,
            drift=0.12,
        )
    for axle, (left, right) in {"front": WHEEL_SPEEDS[:2], "rear": WHEEL_SPEEDS[2:]}.items():
        if not signals.has(left, right):
            continue
        if np.array_equal(signals.known[left], signals.known[right]):
            continue  # one speed for all wheels
        good = signals.where(left, right, "speed") & _with_grip(signals, left, right, car)
        difference = (signals.known[right] - signals.known[left]) * radius / track
        most = 1.8 + _LOADED_WHEELS * float(np.mean(v[good] ** 2)) if good.any() else 1.8
        if signals.has("yaw_rate"):
            yield Equation(
                name=f"{axle} wheels' difference ~ yaw_rate",
                channels=(left, right, "yaw_rate"),
                left=difference,
                right=signals.known["yaw_rate"],
                good=good & signals.where("yaw_rate"),
                least=0.03,
                slopes=(0.4, most),
                lags=(-0.25, 0.25),  # slip comes with the force, the yaw rate after it
                alike=0.4,
            )
        elif turning is not None:
            yield Equation(
                name=f"{axle} wheels' difference ~ {speed} steering_wheel_angle",
                channels=(left, right, "steering_wheel_angle"),
                left=difference,
                right=turning,
                good=good & signals.where("steering_wheel_angle"),
                least=0.03 if car else 0.75,
                slopes=(0.15, most) if car else (1e-4, 0.2),
                lags=(-0.1, 0.35),
                alike=0.4,
            )
    if not signals.has("yaw_rate") and signals.has("ay") and turning is not None:
        yield Equation(
            name=f"ay ~ {speed} squared steering_wheel_angle",
            channels=("ay", "steering_wheel_angle", *_speed_channels(speed)),
            left=signals.known["ay"],
            right=v * turning,
            good=signals.where("ay", "speed", "steering_wheel_angle"),
            least=0.3 if car else 10.0,
            slopes=(0.15, 1.5) if car else (1e-4, 0.2),
            lags=(-0.08, 0.35),
        )


def force_of(signals: Signals, car: CarFacts) -> Array | None:
    """(N,) what torques and drag make of force on a car [N]; None where torques are not known."""
    if not (signals.has(*DRIVE_TORQUES) or signals.has(*BRAKE_TORQUES)):
        return None
    zero = np.zeros(signals.time.size)
    drive = sum((signals.known.get(name, zero) for name in DRIVE_TORQUES), zero)
    brake = sum((signals.known.get(name, zero) for name in BRAKE_TORQUES), zero)
    v = signals.known["speed"]
    return (drive - brake) / car.radius - car.drag * v * v


def _of_torques(signals: Signals, speed: str, car: CarFacts | None) -> Iterator[Equation]:
    """The torques against the acceleration: the slope is the mass in terms of the car's."""
    if car is None:
        return
    force = force_of(signals, car)
    if force is None:
        return
    measured = "ax" if signals.has("ax") else speed
    right = signals.known["ax"] if measured == "ax" else signals.rate("speed")
    names = [n for n in (*DRIVE_TORQUES, *BRAKE_TORQUES) if signals.has(n)]
    yield Equation(
        name=f"torques ~ mass {'ax' if measured == 'ax' else f'd{speed}/dt'}",
        channels=(TORQUES, *(("ax",) if measured == "ax" else _speed_channels(speed))),
        left=force / (car.mass + car.spin_mass),
        right=right,
        good=signals.where(*names, "speed", *(("ax",) if measured == "ax" else ())),
        least=0.2,
        slopes=(0.82, 1.45),  # an empty car to one that carries half its mass
        lags=(-0.12, 0.12) if measured == "ax" else (-0.2, 0.12),
        drift=0.08,
    )


def _check(equation: Equation, signals: Signals, lags: bool) -> Check:
    if equation.good.sum() * signals.dt < 2.0:
        return _stands(equation, "cannot be made: less than 2 s of it in motion")
    spread = equation.right[equation.good].std()
    if equation.either:
        spread = max(spread, equation.left[equation.good].std())
    if spread < equation.least:
        return _stands(equation, "cannot be made: the drive hardly excites it")
    found = fit(equation.left, equation.right, equation.good, signals.dt, lags=lags)
    fault = _fault(equation, found, signals.dt)
    return Check(
        name=equation.name,
        channels=equation.channels,
        correlation=found.correlation,
        slope=found.slope,
        unit=equation.unit,
        lag=found.lag,
        verdict=_verdict(equation, fault),
        fault=fault,
        fit=found,
    )


def _fault(equation: Equation, found: Fit, dt: float) -> str:
    if abs(found.at_lag) < equation.alike:
        return "unlike"
    if found.slope < 0.0:
        return "sign"
    if not equation.slopes[0] <= found.slope <= equation.slopes[1]:
        return "scale"
    if not equation.lags[0] <= found.lag <= equation.lags[1]:
        return "lag"
    drift = abs(found.drift) * equation.left.size * dt
    return "clock" if drift > equation.drift else ""


def _verdict(equation: Equation, fault: str) -> str:
    names = " or ".join(_shown(equation.channels))
    if fault == "sign":
        return f"WRONG SIGN of {names}"
    if fault == "unlike":
        return f"does not fit: a wrong channel among {names}?"
    if fault == "scale":
        return (
            f"wrong unit or scale: the slope should be {equation.slopes[0]:.3g} to "
            f"{equation.slopes[1]:.3g} {equation.unit}"
        )
    if fault == "clock":
        return "two clocks: the lag grows along the drive"
    if fault == "lag":
        return f"delayed: the lag should be {equation.lags[0]:g} to {equation.lags[1]:g} s"
    return "good"


def _shown(channels: tuple[str, ...]) -> tuple[str, ...]:
    if all(name in channels for name in WHEEL_SPEEDS):
        return (*(name for name in channels if name not in WHEEL_SPEEDS), "the wheel speeds")
    return channels


def _mean_check(signals: Signals) -> Check:
    good = signals.where("az")
    slope = float(signals.known["az"][good].mean() / 9.81) if good.any() else np.nan
    fault, verdict = "", "good"
    if slope < -SLOPES[0]:
        fault, verdict = "sign", "WRONG SIGN of az"
    elif abs(slope) < 0.05:
        fault = "gravity"
        verdict = "az is without gravity: the map says free_of_gravity = true, or gives its offset"
    elif not SLOPES[0] <= slope <= SLOPES[1]:
        fault, verdict = "scale", "wrong unit or scale: the slope should be 0.8 to 1.25 1"
    return Check(
        name=_AZ,
        channels=("az",),
        correlation=np.nan,
        slope=slope,
        unit="1",
        lag=np.nan,
        verdict=verdict,
        fault=fault,
    )


def _stands(equation: Equation, why: str) -> Check:
    return _bare(equation.name, equation.channels, why)


def _unmade(name: str, needs: tuple[str, ...], signals: Signals) -> Check:
    has_speed = bool(signals.speed_name)
    lacking = [
        "vx or the wheel speeds" if need == "vx" and not name.startswith("vx") else need
        for need in needs
        if need not in signals.known and not (need == "vx" and has_speed and name[:2] != "vx")
    ]
    lacking = [
        "the wheel speeds" if need == WHEEL_SPEEDS[0] else need
        for need in lacking
        if need not in WHEEL_SPEEDS[1:]
    ]
    shown = {"ay = ": "ay = vx yaw_rate", "ax = ": "ax = dvx/dt"}.get(name, name)
    shown = "yaw_rate ~ vx steering_wheel_angle" if name == "yaw_rate ~ " else shown
    return _bare(shown, needs, f"cannot be made without {', '.join(lacking)}")


def _bare(name: str, channels: tuple[str, ...], why: str) -> Check:
    return Check(
        name=name,
        channels=channels,
        correlation=np.nan,
        slope=np.nan,
        unit="1",
        lag=np.nan,
        verdict=why,
    )
