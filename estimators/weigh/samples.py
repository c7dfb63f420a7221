"""The samples of a trip from which its mass may be learnt, prepared for regression.

A sample counts where no friction brake can act. A driver does not press both pedals, so a pressed
accelerator is proof, even while the motor regenerates; without a pedal in the log the motor must
drive. Acceleration comes from two signals: the measured speed, differentiated, has no scale or
offset of its own but does not see the slope, and the accelerometer does. Above `CROSSOVER` their
blend is the former, below it the latter.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from estimators.weigh.trip import Trip

Array = NDArray[np.float64]

# All chosen; none of them moves the mass of a trip by more than its own standard deviation
BLOCK = 0.5  # [s], of the means that are used
GUARD = 0.3  # [s] left out before and after a moment in which a brake may act
SHORTEST = 2.0  # [s] of a stretch that is used
LEAST_SPEED = 3.0  # [m/s]; creeping and manoeuvring below
LEAST_PEDAL = 0.02  # of the whole travel; sensors' noise below
LEAST_FORCE = 30.0  # [N] with which the motor drives, where the log has no pedal
CROSSOVER = 0.1  # [Hz]
AGREEMENT_BAND = (0.05, 0.5)  # [Hz], where both accelerations see the car rather than the road
LARGEST_DELAY = 1.0  # [s] of speed and accelerometer against each other
WARMING = 10e6  # [J] through motor and gears in which most of the warming-up happens


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """Block means over `BLOCK` of what may be used, and what was seen on the way.

    Attributes:
        time: (n,) from the start of the trip [s].
        first: (n,) bool, the first sample of a stretch without a gap.
        force, speed, speed_squared, acceleration: (n,) means [N, m/s, m2/s2, m/s2].
        cold: (n,) 1 at the start of the trip, towards 0 as the driveline warms up.
        step: of the blocks [s].
        agreement: correlation of the two accelerations within `AGREEMENT_BAND`.
        delay: by which the speed is later than the accelerometer [s]; already made up for.
    """

    time: Array
    first: NDArray[np.bool_]
    force: Array
    speed: Array
    speed_squared: Array
    acceleration: Array
    cold: Array
    step: float
    agreement: float
    delay: float

    @property
    def seconds(self) -> float:
        """Used driving [s]."""
        return self.time.size * self.step


def samples_of(trip: Trip) -> Samples:
    """Selects and prepares the samples of a trip."""
    force, speed, measured = map(_without_gaps, (trip.force, trip.speed, trip.acceleration))
    agreement, delay = _agreement(speed, measured, trip.dt)
    shifted = np.interp(trip.time + delay, trip.time, speed)
    acceleration = _blend(np.gradient(shifted, trip.dt), measured, trip.dt)
    cold = coldness(force, speed, trip.dt)
    size = max(1, round(BLOCK * trip.rate))
    allowed = usable(trip)

    def means(values: Array) -> Array:
        return _blocks(values, size).mean(axis=1)

    block = np.flatnonzero(_blocks(allowed, size).all(axis=1))
    block = block[_long_enough(block, SHORTEST / (size * trip.dt))]
    return Samples(
        time=means(trip.time - trip.time[0])[block],
        first=np.diff(block, prepend=-2) > 1,
        force=means(force)[block],
        speed=means(speed)[block],
        speed_squared=means(speed**2)[block],
        acceleration=means(acceleration)[block],
        cold=means(cold)[block],
        step=size * trip.dt,
        agreement=agreement,
        delay=delay,
    )


def coldness(force: Array, speed: Array, dt: float) -> Array:
    """(N,) 1 at the start, towards 0 with the energy that went through motor and gears."""
    return np.exp(-np.cumsum(np.abs(force * speed)) * dt / WARMING)


def usable(trip: Trip) -> NDArray[np.bool_]:
    """(N,) where no friction brake can act, the car rolls and every signal is there."""
    if trip.pedal is not None:
        allowed = np.nan_to_num(trip.pedal) > LEAST_PEDAL
    else:
        allowed = np.nan_to_num(trip.force) > LEAST_FORCE
    if trip.brake is not None:
        allowed &= np.nan_to_num(trip.brake, nan=np.inf) <= 0.0
    allowed &= np.nan_to_num(trip.speed) > LEAST_SPEED
    for values in (trip.force, trip.speed, trip.acceleration):
        allowed &= np.isfinite(values)
    reach = round(GUARD * trip.rate)
    forbidden = np.convolve(~allowed, np.ones(2 * reach + 1), "same")
    return forbidden < 0.5


def _long_enough(block: NDArray[np.int64], least: float) -> NDArray[np.bool_]:
    """(n,) which blocks belong to a run of consecutive ones that is long enough."""
    stretch = np.cumsum(np.diff(block, prepend=-2) > 1) - 1
    return np.bincount(stretch)[stretch] >= least if block.size else np.zeros(0, dtype=bool)


def _blocks(values: NDArray, size: int) -> NDArray:
    whole = values.size // size * size
    return values[:whole].reshape(-1, size)


def _without_gaps(values: Array) -> Array:
    """The signal with NaN bridged by straight lines, for filters only."""
    there = np.isfinite(values)
    if there.all() or not there.any():
        return np.nan_to_num(values)
    index = np.arange(values.size)
    return np.interp(index, index[there], values[there])


def _blend(derivative: Array, measured: Array, dt: float) -> Array:
    sos = np.asarray(butter(1, min(2.0 * CROSSOVER * dt, 0.9), output="sos"))
    return derivative + _filtered(sos, measured - derivative)


def _agreement(speed: Array, measured: Array, dt: float) -> tuple[float, float]:
    """Correlation of both accelerations, and the delay of the speed at which it is largest [s]."""
    low, high = (min(2.0 * f * dt, 0.9) for f in AGREEMENT_BAND)
    sos = np.asarray(butter(2, (low, high), "band", output="sos"))
    derived, measured = _filtered(sos, np.gradient(speed, dt)), _filtered(sos, measured)
    reach = round(LARGEST_DELAY / dt)
    if speed.size < 20 * reach:
        return np.nan, 0.0
    middle = slice(reach, -reach)
    shifts = range(-reach, reach + 1)
    found = [_correlation(np.roll(derived, -shift)[middle], measured[middle]) for shift in shifts]
    if not np.isfinite(found).all():
        return np.nan, 0.0
    best = int(np.argmax(found))
    return found[best], shifts[best] * dt


def _correlation(a: Array, b: Array) -> float:
    a, b = a - a.mean(), b - b.mean()
    norm = np.sqrt((a @ a) * (b @ b))
    return float(a @ b / norm) if norm > 0.0 else np.nan


def _filtered(sos: Array, values: Array) -> Array:
    """Filtered forwards and backwards; a signal too short for the filter's start is left alone."""
    length = min(values.size - 1, 100)
    return sosfiltfilt(sos, values, padlen=length) if length > 1 else values
