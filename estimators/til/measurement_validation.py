"""Watches the measurements: what no sensor of a sound car shows counts as not measured.

A channel's sample is rejected, it becomes NaN, while

* it is not finite or beyond what any car does (a spike of 50 g);
* it is frozen: the same to the bit while the twin's own output moves. Digits and sensors at rest
  hold a value too: the first quarter of a second does not count, nor does a car that stands. Once
  found, a frozen channel stays so until it shows something else. In doubt, from a twentieth of a
  second on, a value that only repeats itself corrects nothing, which no verdict needs;
* its innovation is far outside of what it was lately. The innovation's mean square grows by what is
  rejected, if slowly: after a second or so a gate that was wrong is open again, and nothing is
  locked out for good.

The estimates are trustworthy as long as no channel in use is rejected or missing, and has not been
for a while.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from twin import ACCELERATIONS, CHANNEL, OUTPUTS, RATES, WHEEL_SPEEDS

Array = NDArray[np.float64]

# By channel: by how much the twin's output moves clearly, and the least half width of the gate.
# Chosen: several digits of a coarse sensor; more than a twin of another load is off by. The largest
# plausible value is that of the channel's record. Units: m/s2, rad/s.
_WHEELS = OUTPUTS[WHEEL_SPEEDS]
_LIMITS = {
    **dict.fromkeys(OUTPUTS[ACCELERATIONS], (0.4, 4.0)),
    **dict.fromkeys(OUTPUTS[RATES], (0.04, 0.4)),
    **dict.fromkeys(_WHEELS, (1.0, 6.0)),
}

SETTLING = 1.0  # [s] without a fault before estimates count as trustworthy again; chosen
GRACE = 0.25  # [s] that a value may stay the same before it is watched; chosen
REPEATED = 0.05  # [s] after which a value that stays the same tells nothing new; chosen
FREEZE = 0.4  # [s] that a value stays the same at least before it counts as frozen; chosen
GATE = 8.0  # innovations beyond so many times their root mean square are rejected; chosen
GROWTH = 3.0  # a rejected one counts as so many of them
MEMORY = 5.0  # [s] of the mean square; chosen
STANDING = 0.5  # [rad/s], wheel speeds of a car that stands; chosen

# Columns of the watch, a row per channel: settings, then what is remembered
LARGEST, MOVED, FLOOR, USED, IS_WHEEL = range(5)
LAST, HELD, LOW, HIGH, FROZEN, MEAN_SQUARE, REJECTED = range(5, 12)
COLUMNS = 12


def new_watch(outputs: tuple[str, ...], used: set[str]) -> Array:
    """The memory that a guard starts with, a row for each output.

    Outputs that are none of a car's are only watched for values that are not finite.

    Args:
        outputs: of the black box.
        used: those that a law or gain takes.
    """
    watch = np.zeros((len(outputs), COLUMNS))
    for row, name in zip(watch, outputs, strict=True):
        row[LARGEST] = CHANNEL[name].high if name in _LIMITS else np.inf
        row[MOVED], row[FLOOR] = _LIMITS.get(name, (np.inf, np.inf))
        row[USED] = name in used
        row[IS_WHEEL] = name in _WHEELS
    renew(watch)
    return watch


def renew(watch: Array) -> None:
    """Forgets all that was seen."""
    watch[:, LAST:] = 0.0
    watch[:, LAST] = np.nan
    watch[:, MEAN_SQUARE] = (watch[:, FLOOR] / GATE) ** 2


@njit(cache=True, nogil=True)
def guard(watch, y, twin_y, dt):
    """One sample: turns what is rejected into NaN.

    Args:
        watch: of `new_watch`.
        y: (ny,) measurements, changed in place.
        twin_y: (ny,) outputs of the twin.
        dt: sample time [s].

    Returns:
        Whether all channels in use are there and sound.
    """
    standing = _stands(watch, y)
    sound = True
    for j in range(y.size):
        row = watch[j]
        row[REJECTED] = 0.0
        if not np.isnan(y[j]) and _is_implausible(row, y[j], twin_y[j], standing, dt):
            row[REJECTED] = 1.0
            y[j] = np.nan
        if np.isnan(y[j]) and row[USED] > 0.0:
            sound = False
        if row[HELD] > REPEATED and not standing:
            y[j] = np.nan
    return sound


@njit(cache=True)
def _stands(watch, y):
    """Whether there are wheel speeds and all of them are those of a car that stands."""
    found = False
    for j in range(y.size):
        if watch[j, IS_WHEEL] > 0.0 and not np.isnan(y[j]):
            if abs(y[j]) > STANDING:
                return False
            found = True
    return found


@njit(cache=True)
def _is_implausible(row, value, twin_value, standing, dt):
    if np.isinf(value) or abs(value) > row[LARGEST]:
        return True
    frozen = _is_frozen(row, value, twin_value, standing, dt)
    innovation = abs(value - twin_value)
    spread = np.sqrt(row[MEAN_SQUARE])
    least = row[FLOOR] / GATE
    if not frozen and row[FLOOR] < np.inf:
        counted = min(innovation, GROWTH * max(spread, least))
        row[MEAN_SQUARE] += min(dt / MEMORY, 1.0) * (counted * counted - row[MEAN_SQUARE])
    return frozen or innovation > max(row[FLOOR], GATE * spread)


@njit(cache=True)
def _is_frozen(row, value, twin_value, standing, dt):
    if value != row[LAST]:
        row[LAST], row[FROZEN] = value, 0.0
        row[HELD] = 0.0
        return False
    if standing:
        row[HELD] = 0.0
    row[HELD] += dt
    if row[HELD] <= GRACE:
        row[LOW], row[HIGH] = twin_value, twin_value
    row[LOW], row[HIGH] = min(row[LOW], twin_value), max(row[HIGH], twin_value)
    if row[HELD] >= FREEZE and row[HIGH] - row[LOW] > row[MOVED]:
        row[FROZEN] = 1.0
    return row[FROZEN] > 0.0
