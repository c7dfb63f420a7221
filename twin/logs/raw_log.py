"""A log as its file has it: channels of any name, unit and rate, before they become a `Drive`."""

import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError
from twin.logs.log_time import Column, TimeWanted, find_time, spread, unit_in

Array = NDArray[np.float64]

# What a log may hold, in bytes and in values of 8 bytes each; chosen: what a PC has room for
LARGEST_FILE = 2**31
LARGEST_LOG = 45_000_000

_MOST_WITHOUT_TIME = 0.5  # of the rows of a table; more are no log


class Wanted(NamedTuple):
    """What a map asks of a log.

    Attributes:
        time: of tables; files whose channels have times of their own take none.
        names: of the channels that are mapped; empty: all are wanted.
        database: of a raw CAN log's messages; None: the log is none.
    """

    time: TimeWanted = TimeWanted()
    names: frozenset[str] = frozenset()
    database: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Channel:
    """One channel of a log.

    Attributes:
        time: (N,) never falling [s].
        values: (N,) in the log's unit; NaN where a sample is missing.
        unit: as the log gives it; empty if it gives none.
    """

    time: Array
    values: Array
    unit: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RawLog:
    """A log as its file has it.

    Attributes:
        path: the file.
        channels: the numeric channels by name.
        text: names of channels that cannot be used, with the reason: their kind or first entry.
        repeated: names that occur more than once, which a map cannot name.
        notes: what the reader decided on its own, in sentences.
    """

    path: Path
    channels: dict[str, Channel]
    text: dict[str, str] = field(default_factory=dict)
    repeated: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def check_size(path: str | Path, values: int, what: str) -> None:
    """Raises TwinError if a log declares more values than fit."""
    if values > LARGEST_LOG:
        raise TwinError(
            f"{path}: {what} {values:,} values ({8 * values / 2**30:.3g} GiB); "
            f"allowed: {LARGEST_LOG:,}"
        )


def check_file_size(path: str | Path) -> None:
    """Raises TwinError if there is no such file, it is none to read from, or it is too large."""
    try:
        found = Path(path).stat()
    except (OSError, ValueError) as error:
        text = getattr(error, "strerror", None) or str(error)
        raise TwinError(f"{path}: cannot be read: {text}") from error
    if not stat.S_ISREG(found.st_mode):
        raise TwinError(f"{path}: is a folder, pipe or device; allowed: a file")
    if not os.access(path, os.R_OK):
        raise TwinError(f"{path}: cannot be read: Permission denied")
    if found.st_size > LARGEST_FILE:
        raise TwinError(f"{path}: has {found.st_size:,} bytes; allowed: {LARGEST_FILE:,}")


def check_time(path: str | Path, name: str, time: Array) -> None:
    """Raises TwinError unless a log's time is finite and never falls."""
    if time.size < 2:
        raise TwinError(f"{path}: {name} has {time.size} samples; allowed: at least 2")
    finite = np.isfinite(time)
    if not finite.all():
        row = int(np.argmin(finite))
        raise TwinError(f"{path}: {name} is {time[row]} at sample {row}; allowed: finite times")
    backwards = np.diff(time) < 0.0
    if backwards.any():
        row = int(np.argmax(backwards))
        raise TwinError(
            f"{path}: {name} runs backwards, from {time[row]:.9g} to {time[row + 1]:.9g} s at "
            f"sample {row + 1}; allowed: rising times"
        )


class Numbers(NamedTuple):
    """A table's columns, read and cleaned.

    Attributes:
        columns: the numeric ones, of one length.
        text: of the others, as in `RawLog`.
        bad: cells that were no number in columns that are, by name and row.
        repeated: as in `RawLog`.
        notes: sentences of the reader.
    """

    columns: dict[str, Column]
    text: dict[str, str]
    bad: dict[str, NDArray[np.bool_]]
    repeated: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def log_of_table(path: Path, table: Numbers, wanted: TimeWanted) -> RawLog:
    """A log whose channels share one column of time.

    Rows of text among the numbers, as a logger writes its names again, and rows without a time are
    left out and counted.

    Raises:
        TwinError: there is no column of time, or its times do not rise.
    """
    notes = list(table.notes)
    columns = _without_text_rows(table, notes)
    if not columns:
        raise TwinError(f"{path}: has no numeric channels; allowed: a column of time and others")
    name, factor, about = find_time(path, columns, wanted, table.text)
    time = factor * columns[name].values
    there = np.isfinite(time)
    if 0 < there.size - there.sum() <= _MOST_WITHOUT_TIME * there.size:
        notes.append(f"{there.size - there.sum()} rows without a time are left out.")
        columns = {key: c._replace(values=c.values[there]) for key, c in columns.items()}
        time = time[there]
    check_time(path, f"time {name!r}", time)
    time, shared = spread(time)
    channels = {
        key: Channel(time=time, values=column.values, unit=column.unit or unit_in(key))
        for key, column in columns.items()
        if key != name
    }
    return RawLog(
        path=path,
        channels=channels,
        text=table.text,
        repeated=table.repeated,
        notes=(*notes, *about, *shared),
    )


def _without_text_rows(table: Numbers, notes: list[str]) -> Mapping[str, Column]:
    """The columns without rows that are mostly text; sentences about bad cells."""
    if not table.bad:
        return table.columns
    count = np.sum([mask for mask in table.bad.values()], axis=0)
    rows = count >= max(2, 0.5 * len(table.columns))
    if rows.any():
        notes.append(f"{rows.sum()} rows of text among the numbers are left out.")
    for name, mask in table.bad.items():
        cells = int((mask & ~rows).sum())
        if cells:
            notes.append(f"{name}: {cells} cells that are no number count as missing.")
    kept = ~rows
    return {name: c._replace(values=c.values[kept]) for name, c in table.columns.items()}


def listed(names: object, most: int = 12) -> str:
    """Names in a message, not too many of them."""
    names = [str(name)[:40] for name in names]  # pyright: ignore[reportGeneralTypeIssues]
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
