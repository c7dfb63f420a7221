"""Do torques, accelerations and wheel speeds belong to one car, all through a drive?

Manoeuvres are stretches of driving or braking. In each the torques' force over a_x is a mass; all
of them must be alike, whoever is on board: a load changes both kinds alike, a wrong scale of the
brakes, a dead motor's torque or a fading brake does not. a_x over the change of the wheels' speed
must stay the same, too, a little above 1: gravity on the pitching body adds some percent.

a_x feels gravity on slopes, as the torques do, so hills cancel.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from scenarios.logs.signals import BRAKE_TORQUES, DRIVE_TORQUES, CarFacts, Signals

Array = NDArray[np.float64]

LEAST = 0.5  # [m/s2] of a manoeuvre's acceleration
_SHORTEST = 0.4  # [s] of a manoeuvre
_BENT = np.radians(8.0)  # [rad/s]; in sharper bends the tyres' drag counts
_UNCERTAIN = 0.005  # of a mean over manoeuvres at least: what pitching and slip make of it
_SURE = 3.0  # standard errors
_FEW = 2  # manoeuvres that tell a mean from a chance
_FORCE_TOLERANCE = 0.06  # of driving against braking; drawn real cars: 0.02
_SPREAD_TOLERANCE = 0.09  # of manoeuvres of one kind; drawn real cars: 0.03
_SPEED_SLOPES = (0.955, 1.11)  # a_x over the change of speed; drawn real cars: 0.99 to 1.06
_HALF_SLOPES = (0.92, 1.15)  # of half a drive, where hills weigh more; drawn real cars: from 0.96
_SMOOTH = 4.0  # [s] over which hills are told from bumps
_FLAT = 0.15  # [m/s2] of the same on a flat road: pitching and noise
_HILL = 12.0  # [s] that a slope stays alike; chosen
_LEAST_RATE = 0.3  # [m/s2] standard deviation of the change of speed that tells a slope


class Masses(NamedTuple):
    """Masses of the manoeuvres of one kind, in those of the car's file.

    Attributes:
        mean: weighted by the square of the acceleration.
        spread: standard deviation, weighted alike.
        number: of manoeuvres.
    """

    mean: float
    spread: float
    number: int

    @property
    def error(self) -> float:
        """Standard error of the mean."""
        return float(np.hypot(_UNCERTAIN, self.spread / np.sqrt(max(self.number, 1))))


class Balance(NamedTuple):
    """What a part of a drive says.

    Attributes:
        start, end: [s].
        drive, brake: by driving and by braking.
        speed_slope: of a_x over the change of speed; NaN where speed hardly changes.
        slope_error: its standard error, hills included.
    """

    start: float
    end: float
    drive: Masses
    brake: Masses
    speed_slope: float
    slope_error: float


def balances(signals: Signals, car: CarFacts) -> list[Balance]:
    """The whole drive first, then its halves and thirds; empty without a_x and all torques."""
    if not signals.has("ax", "speed", *DRIVE_TORQUES, *BRAKE_TORQUES):
        return []
    n = signals.time.size
    parts = [(0, n), (0, n // 2), (n // 2, n), (0, n // 3), (n // 3, 2 * n // 3), (2 * n // 3, n)]
    return [_balance(signals, car, slice(a, b)) for a, b in parts]


def mass_of(balance: Balance, car: CarFacts) -> float | None:
    """The car's mass by its torques and its wheels [kg]; None if the drive does not tell it.

    The wheels stand in for the scale of a_x, which feels the pitching body.
    """
    known = [part for part in (balance.drive, balance.brake) if part.number >= _FEW]
    if not known or not np.isfinite(balance.speed_slope):
        return None
    mean = float(np.mean([part.mean for part in known]))
    return mean * balance.speed_slope * (car.mass + car.spin_mass) - car.spin_mass


def contradictions(found: list[Balance], mass: float) -> Iterator[tuple[str, str]]:
    """What does not belong together: which channels, "torques" or "ax", and words.

    Args:
        found: of `balances`.
        mass: in the car's file, with what its wheels add [kg].
    """
    for part in found:
        drive, brake = part.drive, part.brake
        when = _when(part, found[0])
        if min(drive.number, brake.number) >= _FEW:
            off = drive.mean / brake.mean - 1.0
            sure = _FORCE_TOLERANCE + _SURE * (drive.error + brake.error)
            if not abs(off) <= sure:
                yield (
                    "torques",
                    f"{when}driving belongs to a car of {drive.mean * mass:.0f} kg, braking to one "
                    f"of {brake.mean * mass:.0f} kg: torques of one kind have another scale",
                )
                break
    for name, masses in (("driving", found[0].drive), ("braking", found[0].brake)):
        if masses.number > _FEW and not masses.spread <= _SPREAD_TOLERANCE * masses.mean:
            yield (
                "torques",
                f"{name} belongs to cars of masses that differ by "
                f"{100.0 * masses.spread / masses.mean:.0f} % from one manoeuvre to the next: a "
                "torque comes late or is dead at times, or ax is",
            )
    for part, (low, high) in zip(found[:3], (_SPEED_SLOPES, *(2 * [_HALF_SLOPES])), strict=True):
        more = 2.0 * part.slope_error
        if np.isfinite(part.speed_slope) and not low - more <= part.speed_slope <= high + more:
            yield (
                "ax",
                f"{_when(part, found[0])}ax is {part.speed_slope:.3g} times the change of the "
                "wheels' speed: one of them has another scale",
            )
            break


def _when(part: Balance, whole: Balance) -> str:
    if part[:2] == whole[:2]:
        return ""
    return f"from {part.start:.0f} to {part.end:.0f} s "


def _balance(signals: Signals, car: CarFacts, part: slice) -> Balance:
    ax, speed = signals.known["ax"][part], signals.known["speed"][part]
    good = signals.where("ax", "speed")[part]
    time = signals.time[part]
    slope, error = _speed_slope(ax, np.gradient(speed, signals.dt), good, signals.dt)
    if signals.has("yaw_rate"):
        good = good & (np.abs(signals.known["yaw_rate"][part]) < _BENT)
    force = (
        sum(
            sign * signals.known[name][part]
            for names, sign in ((DRIVE_TORQUES, 1.0), (BRAKE_TORQUES, -1.0))
            for name in names
        )
        / car.radius
        - car.drag * speed**2
    )
    force = np.asarray(force) / (car.mass + car.spin_mass)
    drive, brake = _masses(force, ax, good, signals.dt)
    return Balance(float(time[0]), float(time[-1]), drive, brake, slope, error)


def _speed_slope(ax: Array, rate: Array, good: NDArray[np.bool_], dt: float) -> tuple[float, float]:
    """The slope and what hills make its standard error: a slope stays alike for seconds."""
    duration = good.sum() * dt
    spread = float(rate[good].std()) if good.any() else 0.0
    if good.sum() < 50 or spread < _LEAST_RATE:
        return float("nan"), 0.0
    slope, offset = np.polyfit(rate[good], ax[good], 1)
    rest = np.where(good, ax - slope * rate - offset, 0.0)
    hills = float(uniform_filter1d(rest, max(round(_SMOOTH / dt), 1))[good].std())
    hills = float(np.sqrt(max(hills**2 - _FLAT**2, 0.0)))
    return float(slope), hills / spread * float(np.sqrt(min(1.0, _HILL / duration)))


def _masses(force: Array, ax: Array, good: NDArray[np.bool_], dt: float) -> tuple[Masses, Masses]:
    """Of driving and of braking: force and acceleration through one offset of both."""
    nothing = Masses(float("nan"), 0.0, 0)
    if good.sum() < 50:
        return nothing, nothing
    a = ax[good]
    both = np.column_stack([np.maximum(a, 0.0), np.minimum(a, 0.0), np.ones(a.size)])
    offset = float(np.linalg.lstsq(both, force[good], rcond=None)[0][2])
    kind = np.where(good & (ax > LEAST), 1, np.where(good & (ax < -LEAST), -1, 0))
    edges = [0, *(np.flatnonzero(np.diff(kind)) + 1).tolist(), kind.size]
    means: dict[int, list[tuple[float, float]]] = {1: [], -1: []}
    for first, last in pairwise(edges):
        if kind[first] and (last - first) * dt >= _SHORTEST:
            run = slice(first, last)
            weight = float(ax[run] @ ax[run])
            means[int(kind[first])].append(
                (float((force[run] - offset) @ ax[run]) / weight, weight)
            )
    return _mean(means[1]), _mean(means[-1])


def _mean(found: list[tuple[float, float]]) -> Masses:
    if not found:
        return Masses(float("nan"), 0.0, 0)
    values, weights = np.array(found).T
    mean = float(np.average(values, weights=weights))
    spread = float(np.sqrt(np.average((values - mean) ** 2, weights=weights)))
    return Masses(mean, spread, len(found))
