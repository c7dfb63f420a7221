"""Faults of one channel or group of a recorded drive: what breaks in cars and in their logs."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from twin import OUTPUTS, WHEELS, Drive

Array = NDArray[np.float64]
Fault = Callable[[Array, float, np.random.Generator], Array]
"""Takes (N, k) channels, the sample time [s] and a generator; returns them with the fault."""

BEGIN = 1.0 / 3.0  # of the drive: when a fault begins that is not there from the start

_WHEELS = tuple(f"wheel_speed_{wheel}" for wheel in WHEELS)
_DRIVE = tuple(f"drive_torque_{wheel}" for wheel in WHEELS)
_BRAKE = tuple(f"brake_torque_{wheel}" for wheel in WHEELS)
CHANNELS: Mapping[str, tuple[str, ...]] = {
    **{name: (name,) for name in OUTPUTS},
    "all wheel speeds": _WHEELS,
    "steering_wheel_angle": ("steering_wheel_angle",),
    "all drive torques": _DRIVE,
    "all brake torques": _BRAKE,
    "one drive torque": _DRIVE[:1],
    "one brake torque": _BRAKE[:1],
}


def with_fault(
    drive: Drive, names: tuple[str, ...], fault: Fault, rng: np.random.Generator
) -> Drive:
    """The drive with a fault in some channels, inputs or measurements.

    Args:
        drive: to break.
        names: of the channels.
        fault: what happens to them.
        rng: what it draws from.
    """
    inputs, measurements = drive.inputs.copy(), drive.measurements.copy()
    for table, known in ((inputs, drive.input_names), (measurements, drive.output_names)):
        columns = [known.index(name) for name in names if name in known]
        if columns:
            table[:, columns] = fault(table[:, columns], drive.dt, rng)
    for column in inputs.T:  # as a log's reader bridges them
        there = np.isfinite(column)
        column[:] = np.interp(drive.time, drive.time[there], column[there])
    return drive.replace(inputs=inputs, measurements=measurements)


def _spread(values: Array) -> Array:
    """(k,) what counts as a large change of each channel: its standard deviation."""
    return np.maximum(np.nanstd(values, axis=0), 1e-6)


def _later(values: Array) -> NDArray[np.bool_]:
    return np.arange(len(values))[:, None] >= BEGIN * len(values)


def _bias(share: float, *, later: bool) -> Fault:
    def fault(values: Array, dt: float, rng: np.random.Generator) -> Array:
        where = _later(values) if later else np.ones((len(values), 1), dtype=np.bool_)
        return values + where * share * _spread(values)

    return fault


def _scale(factor: float, *, later: bool = False) -> Fault:
    def fault(values: Array, dt: float, rng: np.random.Generator) -> Array:
        return np.where(_later(values), factor * values, values) if later else factor * values

    return fault


def _late(seconds: float) -> Fault:
    def fault(values: Array, dt: float, rng: np.random.Generator) -> Array:
        n = round(seconds / dt)
        return np.concatenate((np.repeat(values[:1], n, axis=0), values[: len(values) - n]))

    return fault


def _drift(values: Array, dt: float, rng: np.random.Generator) -> Array:
    return values + np.linspace(0.0, 1.0, len(values))[:, None] * _spread(values)


def _frozen(values: Array, dt: float, rng: np.random.Generator) -> Array:
    first = round(BEGIN * len(values))
    return np.where(_later(values), values[first], values)


def _frozen_but_for_its_last_digit(values: Array, dt: float, rng: np.random.Generator) -> Array:
    toggling = 1e-3 * _spread(values) * rng.integers(0, 2, values.shape)
    return _frozen(values, dt, rng) + _later(values) * toggling


def _frozen_for(seconds: float) -> Fault:
    def fault(values: Array, dt: float, rng: np.random.Generator) -> Array:
        first = round(BEGIN * len(values))
        at = np.arange(len(values))
        return values[np.where((at >= first) & (at < first + round(seconds / dt)), first, at)]

    return fault


def _zero(values: Array, dt: float, rng: np.random.Generator) -> Array:
    return np.where(_later(values), 0.0, values)


def _zero_but_noise(values: Array, dt: float, rng: np.random.Generator) -> Array:
    noise = 0.05 * _spread(values) * rng.standard_normal(values.shape)
    return np.where(_later(values), noise, values)


def _stuck_high(values: Array, dt: float, rng: np.random.Generator) -> Array:
    return np.where(_later(values), np.nanmax(values, axis=0), values)


def _noisy(values: Array, dt: float, rng: np.random.Generator) -> Array:
    return values + _spread(values) * rng.standard_normal(values.shape)


def _spikes(values: Array, dt: float, rng: np.random.Generator) -> Array:
    hit = rng.random(values.shape) < 0.01
    return values + hit * 10.0 * _spread(values) * rng.choice((-1.0, 1.0), values.shape)


def _coarse(values: Array, dt: float, rng: np.random.Generator) -> Array:
    step = 0.5 * _spread(values)
    return step * np.round(values / step)


def _clipped(values: Array, dt: float, rng: np.random.Generator) -> Array:
    middle = np.nanmean(values, axis=0)
    return np.clip(values, middle - _spread(values), middle + _spread(values))


def _slow(values: Array, dt: float, rng: np.random.Generator) -> Array:
    share = dt / (0.3 + dt)
    start = (1.0 - share) * values[:1]
    return lfilter([share], [1.0, share - 1.0], values, axis=0, zi=start)[0]


def _loose(values: Array, dt: float, rng: np.random.Generator) -> Array:
    out = np.repeat(rng.random(1 + int(len(values) * dt)) < 0.4, round(1.0 / dt))[: len(values)]
    return np.where(out[:, None] & _later(values), 0.0, values)


def _missing_often(values: Array, dt: float, rng: np.random.Generator) -> Array:
    return np.where(rng.random((len(values), 1)) < 0.3, np.nan, values)


def _wandering(values: Array, dt: float, rng: np.random.Generator) -> Array:
    share = dt / 5.0
    white = rng.standard_normal(values.shape) * np.sqrt(2.0 * share)
    return values + 0.5 * _spread(values) * lfilter([1.0], [1.0, share - 1.0], white, axis=0)


def _one_sided(values: Array, dt: float, rng: np.random.Generator) -> Array:
    return np.maximum(values, 0.0)


FAULTS: Mapping[str, Fault] = {
    "off from the start": _bias(0.7, later=False),
    "off from a third on": _bias(0.7, later=True),
    "far off from a third on": _bias(4.0, later=True),
    "times 0.8": _scale(0.8),
    "times 1.1": _scale(1.1),
    "times 1.5": _scale(1.5),
    "times 0.7 from a third on": _scale(0.7, later=True),
    "wrong sign": _scale(-1.0),
    "wrong sign from a third on": _scale(-1.0, later=True),
    "late by 0.1 s": _late(0.1),
    "late by 0.4 s": _late(0.4),
    "drifting": _drift,
    "wandering": _wandering,
    "frozen from a third on": _frozen,
    "frozen but for its last digit": _frozen_but_for_its_last_digit,
    "frozen for 5 s": _frozen_for(5.0),
    "zero from a third on": _zero,
    "noise about zero from a third on": _zero_but_noise,
    "stuck at its largest": _stuck_high,
    "noisy": _noisy,
    "spikes": _spikes,
    "coarse": _coarse,
    "clipped": _clipped,
    "slow": _slow,
    "loose contact": _loose,
    "often missing": _missing_often,
    "without its negative half": _one_sided,
}
