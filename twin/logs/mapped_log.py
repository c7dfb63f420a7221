"""The channels of a `Drive` from a log of anybody, by its map; and what was done to it."""

from collections.abc import Mapping, Set
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.channels import FURTHER_OUTPUTS, OUTPUTS, WHEELS
from twin.errors import TwinError
from twin.logs import can
from twin.logs.brake_noise import without_noise_below_zero
from twin.logs.car_signals import GIVES, CarSignals, derive
from twin.logs.formats import format_of
from twin.logs.input_gaps import WithoutGaps, as_settings, runs, sentences, without_gaps
from twin.logs.map import TORQUES, LogMap, Source, unit_in_si
from twin.logs.raw_log import Array, Channel, RawLog, check_size, listed
from twin.logs.resampling import FASTER, resample
from twin.logs.spikes import without_spikes
from twin.logs.units import kind_of, our_unit

STEERING = "steering_wheel_angle"
_SPEED = "vx or the wheel speeds"
_MOST_BETWEEN = 100_000  # samples of a drive between two of its log; chosen: one in 100 s
# What an estimate needs at least; a constant input tells nothing. Chosen after what the laws of
# the studies compare, and what moves it.
NEEDS = {
    "mass": ("ax", *TORQUES),
    "Jxx": ("roll_rate", "steering_wheel_angle"),
    "Jyy": ("pitch_rate",),
    "Jzz": ("yaw_rate", "steering_wheel_angle"),
    "tyre_friction": ("ay", "yaw_rate", "steering_wheel_angle", _SPEED),
    "cornering_stiffness": ("ay", "yaw_rate", "steering_wheel_angle", _SPEED),
    "sideslip": ("ay", "yaw_rate", "steering_wheel_angle", _SPEED),
}


def read_by_map(
    path: str | Path, map_path: str | Path, car: CarSignals | None = None
) -> dict[str, Any]:
    """The attributes of a drive, from a log.

    Inputs are those of `twin.INPUTS`, less the torques where the twin is to follow the speed.
    Measurements are `twin.OUTPUTS`, NaN where the log has none, and behind them what it has of
    `twin.FURTHER_OUTPUTS`. `settings["log"]` holds the file, the map, whether to follow the speed,
    the inputs that the map declares constant and, under "done", sentences that say what was done
    and what cannot be estimated.

    Args:
        path: of any format of `twin.logs.formats`.
        map_path: see `twin.logs.map`.
        car: what the car makes of its signals; the map's table [car] comes first.

    Raises:
        TwinError: the log or the map is missing or broken, they do not fit, or an input is nowhere
            beside the others.
    """
    log_map = LogMap.load(map_path)
    reader = can if log_map.database else format_of(path)
    log = reader.read_log(Path(path), log_map.wanted)
    return by_map(log, log_map, car)


def by_map(log: RawLog, log_map: LogMap, car: CarSignals | None = None) -> dict[str, Any]:
    """The attributes of a drive, from a log that was read; see `read_by_map`."""
    ours = {name: _in_si(log, log_map, name, s) for name, s in log_map.channels.items()}
    truth = {name: _in_si(log, log_map, name, s) for name, s in log_map.truth.items()}
    grid = _grid(log, log_map, ours)
    done = [*log.notes, *_about_time(grid, log_map)]
    columns = {}
    for name, channel in ours.items():
        if name == STEERING or STEERING in GIVES.get(name, ()):
            channel, spikes = _without_spikes(channel, name)
            done += spikes
        columns[name] = resample(channel.time, channel.values, grid, log_map.longest_gap)
        done.append(_about_channel(name, log_map, channel, columns[name]))
    kept = {
        name: resample(channel.time, channel.values, grid, log_map.longest_gap)
        for name, channel in truth.items()
    }
    done += [f"{name}: truth, from {log_map.truth[name].name!r}." for name in truth]
    for name, value in log_map.constants.items():
        columns[name] = np.full(grid.size, value)
        done.append(f"{name}: {value:g} {our_unit(name)} throughout, as the map declares.")
    meant = car or CarSignals()
    if log_map.car is not None:
        meant = CarSignals.of(log_map.car, meant)
    try:
        done += derive(columns, 1.0 / log_map.rate, meant, log_map.free_of_gravity)
    except TwinError as error:
        raise TwinError(f"{log_map.path}: {error}") from None
    done += without_noise_below_zero(columns)
    if log_map.follow_speed:
        done.append("The log has no torques: the twin is to follow the measured vx.")
    inputs = _inputs(log, log_map, grid, columns)
    columns |= inputs.columns
    done += sentences(inputs.gaps)
    names = (*OUTPUTS, *(name for name in FURTHER_OUTPUTS if name in columns))
    missing = np.full(grid.size, np.nan)
    done += _about_missing(columns)
    done += _about_estimates(columns, log_map)
    measurements = np.column_stack([columns.get(name, missing) for name in names])
    measurements[inputs.bridged] = np.nan
    there = inputs.kept
    return {
        "time": grid[there],
        "inputs": np.column_stack([columns[name][there] for name in log_map.input_names]),
        "input_names": log_map.input_names,
        "measurements": measurements[there],
        "output_names": names,
        "truth": {name: values[there] for name, values in kept.items()},
        "settings": {
            "log": {
                "file": log.path.name,
                "map": log_map.path.name,
                "rate": _rate(ours),
                "follow_speed": log_map.follow_speed,
                "constants": list(log_map.constants),
                "input_gaps": as_settings(inputs.gaps),
                "done": done,
            }
        },
    }


def _in_si(log: RawLog, log_map: LogMap, name: str, source: Source) -> Channel:
    """A channel of the log in our unit, sign and time."""
    if source.name in log.repeated:
        raise TwinError(
            f"{log.path}: channel {source.name[:40]!r}, mapped to {name}, occurs twice; allowed: "
            "a name that occurs once"
        )
    if source.name not in log.channels:
        if source.name in log.text:
            has = f"cannot be used: it is {log.text[source.name]}"
        else:
            has = f"is not there; it has {listed(log.channels)}"
        raise TwinError(f"{log.path}: channel {source.name[:40]!r}, mapped to {name}, {has}")
    channel = log.channels[source.name]
    unit = source.unit or channel.unit
    if kind_of(name) == "number":
        unit = "1"
    if not unit:
        raise TwinError(
            f"{log_map.path}: channels.{name}.unit is missing and {log.path} gives none; allowed: "
            "name it"
        )
    try:
        scale = unit_in_si(name, unit, source.radius)
    except TwinError as error:
        raise TwinError(f"{log_map.path}: channels.{name}.unit {error}") from None
    with np.errstate(over="ignore", invalid="ignore"):
        values = source.sign * scale * source.factor * (channel.values - source.offset)
    start = channel.time[0]
    time = start + source.clock * (channel.time - start) - source.delay
    return Channel(time=time, values=values, unit=unit)


def _without_spikes(channel: Channel, name: str) -> tuple[Channel, list[str]]:
    """The channel without single samples that stand out, and a sentence about them."""
    values, count = without_spikes(channel.time, channel.values)
    if not count:
        return channel, []
    sentence = f"{name}: {count} single samples that stand out are left out."
    return replace(channel, values=values), [sentence]


def _grid(log: RawLog, log_map: LogMap, ours: Mapping[str, Channel]) -> Array:
    """Sample times over which there are all inputs, or anything at all if all are declared."""
    inputs = [
        channel.time
        for name, channel in ours.items()
        if name in log_map.input_names or set(GIVES.get(name, ())) & set(log_map.input_names)
    ]
    times = inputs or [channel.time for channel in ours.values()]
    if not times:
        raise TwinError(f"{log_map.path}: channels is empty; allowed: map at least one")
    starts, ends = [t[0] for t in times], [t[-1] for t in times]
    start, end = (max(starts), min(ends)) if inputs else (min(starts), max(ends))
    steps = np.floor((end - start) * log_map.rate + 1e-3)
    if steps < 1.0:
        raise TwinError(
            f"{log.path}: all inputs are there from {start:g} to {end:g} s only; allowed: at least "
            f"two samples at {log_map.rate:g} Hz"
        )
    samples = sum(channel.time.size for channel in ours.values()) / len(ours)
    if steps > _MOST_BETWEEN * samples:
        raise TwinError(
            f"{log.path}: has {samples:.0f} samples a channel in {end - start:.6g} s, too few for "
            f"a drive of {log_map.rate:g} Hz; is the unit of time right? allowed: one in "
            f"{_MOST_BETWEEN / log_map.rate:g} s, or another rate in the map"
        )
    columns = len(OUTPUTS) + len(log_map.channels) + len(log_map.truth) + len(log_map.constants)
    check_size(log.path, int(min(steps, 1e18)) * columns, f"makes at {log_map.rate:g} Hz")
    return start + np.arange(int(steps) + 1) / log_map.rate


def _inputs(log: RawLog, log_map: LogMap, grid: Array, columns: Mapping[str, Array]) -> WithoutGaps:
    """The inputs, their gaps bridged or to be cut out.

    Raises:
        TwinError: no two samples have all of them.
    """
    found = without_gaps(grid, {name: columns[name] for name in log_map.input_names})
    if found is not None:
        return found
    missing = {name: int(np.isnan(columns[name]).sum()) for name in log_map.input_names}
    name = max(missing, key=lambda name: missing[name])
    raise TwinError(
        f"{log.path}: input {name} is missing in {missing[name]} of {grid.size} samples, and no "
        "two samples have all inputs; allowed: all inputs at the same time, or a longer longest_gap"
    )


def _rate(ours: Mapping[str, Channel]) -> float:
    """Samples a second of the fastest channel that is mapped [Hz]."""
    spans = [
        (channel.time.size - 1, channel.time[-1] - channel.time[0]) for channel in ours.values()
    ]
    return max((float(steps / span) for steps, span in spans if span > 0.0), default=1.0)


def _about_time(grid: Array, log_map: LogMap) -> list[str]:
    return [
        f"The drive lasts from {grid[0]:.6g} to {grid[-1]:.6g} s: {grid.size} samples at "
        f"{log_map.rate:g} Hz, linear between those of the log."
    ]


def _about_channel(name: str, log_map: LogMap, channel: Channel, values: Array) -> str:
    source = log_map.channels[name]
    rate = (channel.time.size - 1) / max(channel.time[-1] - channel.time[0], 1e-12)
    parts = [f"{name}: from {source.name!r} in {channel.unit} at {rate:.4g} Hz"]
    if source.sign < 0.0:
        parts.append("sign turned")
    if source.factor != 1.0:
        parts.append(f"times {source.factor:g}")
    if source.offset:
        parts.append(f"less {source.offset:g}")
    if source.radius:
        parts.append(f"over a radius of {source.radius:g} m")
    if source.clock != 1.0:
        parts.append(f"its clock stretched by {source.clock:g}")
    if source.delay:
        parts.append(f"brought forward by {source.delay:g} s")
    if rate > FASTER * log_map.rate:
        parts.append("averaged over each sample of the drive")
    if np.isnan(values).any():
        parts.append(_about_gaps(np.isnan(values)))
    return ", ".join(parts) + "."


def _about_gaps(missing: NDArray[np.bool_]) -> str:
    """Where samples (N,) of the drive are missing, some of them."""
    found = runs(missing)
    ends = [place for place, there in (("start", missing[0]), ("end", missing[-1])) if there]
    inside = len(found) - len(ends)
    where = [f"in {inside} gap{'s' if inside != 1 else ''}"] if inside > 0 else []
    where += [f"at the {place}" for place in ends]
    if missing.all():
        return "all samples missing"
    return f"{np.count_nonzero(missing)} samples missing {' and '.join(where)}"


def _about_missing(columns: Mapping[str, Array]) -> list[str]:
    missing = [name for name in OUTPUTS if name not in columns]
    return [f"Not in the log, hence NaN: {', '.join(missing)}."] if missing else []


def _about_estimates(columns: Mapping[str, Array], log_map: LogMap) -> list[str]:
    """What cannot be estimated, and which channel it wants."""
    known = {name for name, values in columns.items() if np.isfinite(values).any()}
    known = with_all_wheels(known - set(log_map.constants))
    if "vx" in known or all(name in known for name in OUTPUTS if name.startswith("wheel_speed")):
        known.add(_SPEED)
    sentences = []
    for quantity, needed in NEEDS.items():
        lacking = dict.fromkeys(_of_all_wheels(name) for name in needed if name not in known)
        if lacking:
            weigh = " `til weigh` needs no brakes." if list(lacking) == ["brake_torque_*"] else ""
            sentences.append(f"{quantity} cannot be estimated without {', '.join(lacking)}.{weigh}")
    return sentences


def with_all_wheels(names: Set[str]) -> set[str]:
    """The names, and those of the axles that are not driven or not braked.

    One axle's torques are all there are where the others' are declared zero. Brake torques that are
    all declared are not known: a car that nobody saw brake has brakes all the same.
    """
    found = set(names)
    for kind in ("drive_torque", "brake_torque"):
        if any(name.startswith(kind) for name in names):
            found |= {name for name in TORQUES if name.startswith(kind)}
    return found


def _of_all_wheels(name: str) -> str:
    """The name of a wheel's channel as that of all four."""
    stem, _, wheel = name.rpartition("_")
    return f"{stem}_*" if wheel in WHEELS else name
