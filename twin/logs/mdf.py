"""Logs and drives in ASAM MDF 4, by asammdf (extra `mdf`)."""

import gc
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from twin.errors import TwinError
from twin.logs.log_time import spread
from twin.logs.mdf_check import check_mdf
from twin.logs.raw_log import Array, Channel, RawLog, Wanted, check_time
from twin.logs.units import CHANNELS, in_si, our_unit
from twin.toml_file import reason

_TIME = 1  # type of synchronisation of a master, ASAM MDF 4.1, section 5.17
_SYNC = {0: "no kind", 2: "angle", 3: "distance", 4: "index"}
_MARK = "twin_drive "  # what the comment of a drive's header starts with; its metadata follow


def _asammdf(path: Path) -> ModuleType:
    try:
        import asammdf
    except ImportError as error:
        raise TwinError(
            f"{path}: MDF needs asammdf: pip install 'twin-in-the-loop[mdf]'"
        ) from error
    return asammdf


def write(path: Path, columns: dict[str, Array], metadata: str) -> None:
    """Writes a drive's columns with their units, and its metadata as the header's comment."""
    asammdf = _asammdf(path)
    time = columns["time"]
    with asammdf.MDF(version="4.10") as file:
        signals = [
            asammdf.Signal(samples=values, timestamps=time, name=name, unit=_unit(name))
            for name, values in columns.items()
            if name != "time"
        ]
        file.append(signals, common_timebase=True)
        file.header.description = _MARK + metadata
        # asammdf puts its own ending on other names
        saved = file.save(path.with_name(path.name + ".mf4"), overwrite=True)
    saved.replace(path)


def _unit(column: str) -> str:
    name = column.partition(".")[2]
    return our_unit(name) if name in CHANNELS else ""


def read_columns(path: Path) -> tuple[dict[str, Array], str | None]:
    """A drive's columns by name, and its metadata; None if the file is no drive.

    Raises:
        TwinError: the file cannot be read.
    """
    log, comment = _read(path)
    if not comment.startswith(_MARK):
        return {}, None
    columns: dict[str, Array] = {}
    for name, channel in log.channels.items():
        columns.setdefault("time", channel.time)
        if channel.time.size != columns["time"].size:
            raise TwinError(f"{path}: channels of a drive must share their time; {name} does not")
        columns[name] = channel.values
    return columns, comment.removeprefix(_MARK)


def read_log(path: Path, wanted: Wanted) -> RawLog:
    """A log of anybody, each channel with the time of its group.

    Only a master of time is time: channels of a group without a master, or with one of angle,
    distance or index, are set aside with that reason.

    Raises:
        TwinError: the file cannot be read, or the map names a channel of time.
    """
    if any(given is not None for given in wanted.time):
        raise TwinError(f"{path}: MDF has times of its own; allowed: a map without [time]")
    return _read(path)[0]


def _read(path: Path) -> tuple[RawLog, str]:
    check_mdf(path)
    asammdf = _asammdf(path)
    fault, comment, channels, text = "", "", {}, {}
    # On a damaged file asammdf leaves a half-made object behind, whose end is noisy
    noise, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        with asammdf.MDF(path) as file:
            comment = str(file.header.description)
            channels, text = _channels(file)
    except Exception as error:  # of every kind
        fault = reason(error)[:200]
    finally:
        if fault:
            gc.collect()
        sys.unraisablehook = noise
    if fault:
        raise TwinError(f"{path}: cannot be read as MDF: {fault}")
    if not channels:
        why = next((text[name] for name in text if "no time" in text[name]), "no numeric channels")
        raise TwinError(f"{path}: has {why}; allowed: channels with a master of time")
    notes: dict[str, None] = {}
    for name, channel in channels.items():
        check_time(path, f"time of {name[:40]!r}", channel.time)
        time, about = spread(channel.time)
        channels[name] = Channel(time=time, values=channel.values, unit=channel.unit)
        notes |= dict.fromkeys(about)
    return RawLog(path=path, channels=channels, text=text, notes=tuple(notes)), comment


def _channels(file: Any) -> tuple[dict[str, Channel], dict[str, str]]:
    """The numeric channels, and what else there is; a name's second occurrence gets a number."""
    channels: dict[str, Channel] = {}
    text: dict[str, str] = {}
    count: Counter[str] = Counter()
    for group, index, name in _places(file):
        count[name] += 1
        unique = name if count[name] == 1 else f"{name}.{count[name]}"
        seconds, why = _time_unit(file, group)
        if why:
            text[unique] = why
            continue
        signal = file.get(group=group, index=index)
        values = np.asarray(signal.samples)
        if values.ndim != 1 or values.dtype.kind not in "iufb":
            text[unique] = str(values.dtype)
        elif values.size < 2:
            text[unique] = "a single sample"
        else:
            values = values.astype(np.float64)
            if signal.invalidation_bits is not None:
                values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
            time = seconds * np.asarray(signal.timestamps, dtype=np.float64)
            channels[unique] = Channel(time=time, values=values, unit=signal.unit)
    return channels, text


def _time_unit(file: Any, group: int) -> tuple[float, str]:
    """Seconds that one of a group's master is, and why it is no time, if it is none."""
    content = file.groups[group]
    called = f"channel group {group}"
    name = str(getattr(content.channel_group, "acq_name", "") or "")
    called += f" ({name[:40]})" if name else ""
    master = file.masters_db.get(group)
    if master is None:
        return 0.0, f"no time: {called} has no master channel"
    channel = content.channels[master]
    if channel.sync_type != _TIME:
        kind = _SYNC.get(channel.sync_type, f"kind {channel.sync_type}")
        return 0.0, f"no time: the master {channel.name[:40]!r} of {called} is one of {kind}"
    unit = str(channel.unit or "").strip() or str(getattr(channel.conversion, "unit", "") or "")
    factor = in_si("time", unit) if unit else 1.0
    if factor is None:
        return 0.0, f"no time: the master of {called} is in {unit[:20]!r}, an unknown unit of time"
    return factor, ""


def _places(file: Any) -> Iterator[tuple[int, int, str]]:
    """Group, index and name of every channel with samples that is no group's master."""
    for group, content in enumerate(file.groups):
        master = file.masters_db.get(group)
        for index, channel in enumerate(content.channels):
            if index != master and content.channel_group.cycles_nr > 0:
                yield group, index, channel.name
