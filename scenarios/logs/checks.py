"""Checks of a drive against kinematics: a wrong sign, unit or delay shows before anything is
estimated.

Both sides of an equation pass the same low-pass filter; then the measured side is fitted to the
other. Gravity on a rolling or pitching body and slopes of the road are left out: a slope of the fit
between 0.8 and 1.25 is no fault.
"""  # noqa: D205

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from twin import Drive

Array = NDArray[np.float64]

CUTOFF = 2.0  # [Hz], of the filter; chosen: above the driver, below wheel hop and engine
MOVING = 3.0  # [m/s], or [rad/s] of the wheels over 3; slower samples do not count; chosen
LARGEST_LAG = 0.5  # [s] that is searched
LEAST_CORRELATION = 0.5
SLOPES = (0.8, 1.25)
WHEEL_SPEEDS = tuple(f"wheel_speed_{wheel}" for wheel in ("fl", "fr", "rl", "rr"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One equation and what the drive says of it.

    Attributes:
        name: the equation.
        correlation: of both sides; NaN where it could not be checked.
        slope: of the fit of the left side to the right one.
        unit: of the slope.
        lag: [s] by which the left side comes late.
        verdict: in words.
    """

    name: str
    correlation: float
    slope: float
    unit: str
    lag: float
    verdict: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _Equation:
    name: str
    needs: tuple[str, ...]
    sides: Callable[..., tuple[Array, Array]]
    least: float  # standard deviation of the right side that counts as excited
    slopes: tuple[float, float] = SLOPES
    unit: str = "1"


def checks(drive: Drive) -> list[Check]:
    """All checks, those that lack a channel included.

    A channel that is not measured is taken from the truth, where that has it.

    Raises:
        TwinError: the drive's samples are not uniform.
    """
    known = {name: drive.channel(name) for name in (*drive.input_names, *drive.output_names)}
    known = {name: values for name, values in known.items() if np.isfinite(values).any()}
    known = {**drive.truth, **known}
    if all(name in known for name in WHEEL_SPEEDS):
        known["wheels"] = np.mean([known[name] for name in WHEEL_SPEEDS], axis=0)
    return [_check(equation, known, drive.dt) for equation in _equations(known)]


def _equations(known: dict[str, Array]) -> list[_Equation]:
    """What can be asked of these channels, at best."""
    speed, unit, slopes = "vx", "1", SLOPES
    if "vx" not in known and "wheels" in known:
        speed, unit, slopes = "wheels", "m", (0.2, 0.6)  # the slope is the rolling radius
    with_vy = "vy" in known
    ay_needs = ("ay", "yaw_rate", speed, *(["vy"] if with_vy else []))
    ax_needs = ("ax", speed, *(["yaw_rate", "vy"] if with_vy and speed == "vx" else []))
    return [
        _Equation(
            name=f"ay = {speed} yaw_rate" + (" + dvy/dt" if with_vy else ""),
            needs=ay_needs,
            sides=lambda dt, ay, r, v, vy=0.0: (
                (ay - _rate(vy, dt), v * r) if unit == "m" else (ay, v * r + _rate(vy, dt))
            ),
            least=0.1,
            slopes=slopes,
            unit=unit,
        ),
        _Equation(
            name=f"ax = d{speed}/dt" + (" - vy yaw_rate" if len(ax_needs) == 4 else ""),
            needs=ax_needs,
            sides=lambda dt, ax, v, r=0.0, vy=0.0: (ax, _rate(v, dt) - vy * r),
            least=0.1,
            slopes=slopes,
            unit=unit,
        ),
        _Equation(
            name=f"yaw_rate ~ {speed} steering_wheel_angle",
            needs=("yaw_rate", speed, "steering_wheel_angle"),
            sides=lambda dt, r, v, angle: (r, v * angle),
            least=0.05,
            slopes=(1e-4, 1.0),  # 1/(wheelbase times ratio), radius aside: 0.02/m
            unit="1/m" if speed == "vx" else "1",
        ),
        _Equation(
            name="roll_rate ~ day/dt",
            needs=("roll_rate", "ay"),
            sides=lambda dt, rate, ay: (rate, _rate(ay, dt)),
            least=0.1,
            slopes=(1e-4, 0.1),  # rad per m/s2: a car rolls by some 0.5 degrees
            unit="s2/m",
        ),
        _Equation(
            name="pitch_rate ~ -dax/dt",
            needs=("pitch_rate", "ax"),
            sides=lambda dt, rate, ax: (rate, -_rate(ax, dt)),
            least=0.1,
            slopes=(1e-4, 0.1),
            unit="s2/m",
        ),
        _Equation(
            name="vx = radius wheel speed",
            needs=("vx", "wheels"),
            sides=lambda dt, v, wheels: (v, wheels),
            least=1.0,
            slopes=(0.2, 0.6),  # rolling radii of cars
            unit="m",
        ),
        _Equation(
            name="az = 9.81 m/s2 at the mean",
            needs=("az",),
            sides=lambda dt, az: (az, np.full(az.size, 9.81)),
            least=0.0,
        ),
    ]


def _check(equation: _Equation, known: dict[str, Array], dt: float) -> Check:
    lacking = [
        "vx or the wheel speeds" if name == "vx" else name
        for name in equation.needs
        if name not in known
    ]
    if lacking:
        return _unmade(equation, f"cannot be made without {', '.join(lacking)}")
    moving = _moving(known)
    good = moving & np.all([np.isfinite(known[name]) for name in equation.needs], axis=0)
    if good.sum() * dt < 2.0:
        return _unmade(equation, "cannot be made: less than 2 s of it in motion")
    channels = [_low_pass(_filled(known[name]), dt) for name in equation.needs]
    left, right = equation.sides(dt, *channels)
    left, right = left[good], right[good]
    if equation.name.startswith("az"):
        return _mean_check(equation, left, right)
    left, right = left - left.mean(), right - right.mean()
    if right.std() < equation.least:
        return _unmade(equation, "cannot be made: the drive hardly excites it")
    slope = float(left @ right / (right @ right))
    correlation = float(left @ right / max(np.sqrt((left @ left) * (right @ right)), 1e-300))
    lag = _lag(left, right, dt)
    return Check(
        name=equation.name,
        correlation=correlation,
        slope=slope,
        unit=equation.unit,
        lag=lag,
        verdict=_verdict(equation, correlation, slope),
    )


def _verdict(equation: _Equation, correlation: float, slope: float) -> str:
    if correlation <= -LEAST_CORRELATION:
        return f"WRONG SIGN of {' or '.join(equation.needs)}"
    if correlation < LEAST_CORRELATION:
        return "does not fit: a wrong channel, or a delay (see the lag)?"
    if not equation.slopes[0] <= slope <= equation.slopes[1]:
        return f"wrong unit or scale: the slope should be {equation.slopes[0]:g} to " + (
            f"{equation.slopes[1]:g} {equation.unit}"
        )
    return "good"


def _mean_check(equation: _Equation, left: Array, right: Array) -> Check:
    slope = float(left.mean() / right.mean())
    if slope < -SLOPES[0]:
        verdict = "WRONG SIGN of az"
    elif abs(slope) < 0.2:
        verdict = "az is without gravity: give its offset as minus 9.81 m/s2 in its unit and axes"
    else:
        verdict = "good" if SLOPES[0] <= slope <= SLOPES[1] else "wrong unit or scale"
    return Check(
        name=equation.name,
        correlation=np.nan,
        slope=slope,
        unit=equation.unit,
        lag=np.nan,
        verdict=verdict,
    )


def _unmade(equation: _Equation, why: str) -> Check:
    return Check(
        name=equation.name,
        correlation=np.nan,
        slope=np.nan,
        unit=equation.unit,
        lag=np.nan,
        verdict=why,
    )


def _moving(known: dict[str, Array]) -> NDArray[np.bool_]:
    if "vx" in known:
        return np.nan_to_num(known["vx"]) > MOVING
    if "wheels" in known:
        return np.nan_to_num(known["wheels"]) > 3.0 * MOVING
    return np.ones(next(iter(known.values())).size, dtype=bool)


def _rate(values: Array | float, dt: float) -> Any:
    return np.gradient(values, dt) if isinstance(values, np.ndarray) else 0.0


def _filled(values: Array) -> Array:
    good = np.isfinite(values)
    index = np.arange(values.size)
    return np.interp(index, index[good], values[good])


def _low_pass(values: Array, dt: float) -> Array:
    if CUTOFF * dt > 0.4:
        return values
    sos = signal.butter(2, CUTOFF, fs=1.0 / dt, output="sos")
    return signal.sosfiltfilt(sos, values, padlen=min(values.size - 1, round(0.5 / dt)))


def _lag(left: Array, right: Array, dt: float) -> float:
    """How late the left side comes [s], where both are most alike, or most opposite."""
    steps = max(1, round(0.01 / dt))  # 10 ms are fine enough, and quick
    left, right, dt = left[::steps], right[::steps], dt * steps
    most = min(round(LARGEST_LAG / dt), left.size // 4)
    alike = signal.correlate(left, right, mode="full", method="fft")
    middle = right.size - 1
    window = np.abs(alike[middle - most : middle + most + 1])
    return (int(np.argmax(window)) - most) * dt
