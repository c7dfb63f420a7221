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
from twin.logs.mdf_check import check_mdf
from twin.logs.raw_log import Array, Channel, RawLog, check_time
from twin.logs.units import CHANNELS, our_unit
from twin.toml_file import reason

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


def read_log(path: Path, time: tuple[str | None, float | None]) -> RawLog:
    """A log of anybody, each channel with the time of its group.

    Raises:
        TwinError: the file cannot be read, or the map names a channel of time.
    """
    if time != (None, None):
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
        raise TwinError(f"{path}: has no numeric channels; allowed: at least one")
    for name, channel in channels.items():
        check_time(path, f"time of {name[:40]!r}", channel.time)
    return RawLog(path=path, channels=channels, text=text), comment


def _channels(file: Any) -> tuple[dict[str, Channel], dict[str, str]]:
    """The numeric channels, and what else there is; a name's second occurrence gets a number."""
    channels: dict[str, Channel] = {}
    text: dict[str, str] = {}
    count: Counter[str] = Counter()
    for group, index, name in _places(file):
        count[name] += 1
        unique = name if count[name] == 1 else f"{name}.{count[name]}"
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
            time = np.asarray(signal.timestamps, dtype=np.float64)
            channels[unique] = Channel(time=time, values=values, unit=signal.unit)
    return channels, text


def _places(file: Any) -> Iterator[tuple[int, int, str]]:
    """Group, index and name of every channel with samples that is no group's time."""
    for group, content in enumerate(file.groups):
        master = file.masters_db.get(group)
        for index, channel in enumerate(content.channels):
            if index != master and content.channel_group.cycles_nr > 0:
                yield group, index, channel.name
