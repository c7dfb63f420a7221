"""A log as its file has it: channels of any name, unit and rate, before they become a `Drive`."""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError

Array = NDArray[np.float64]

# What a log may hold, in bytes and in values of 8 bytes each; chosen: what a PC has room for
LARGEST_FILE = 2**31
LARGEST_LOG = 2**28

_UNIT_IN_NAME = re.compile(r".*[\[(]([^\[\]()]+)[\])]\s*$")


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
        text: names of channels that are not numbers, with their kind or first entry.
        notes: what the reader decided on its own, in sentences.
    """

    path: Path
    channels: dict[str, Channel]
    text: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def unit_in(name: str) -> str:
    """The unit in brackets at the end of a channel's name, as in "Speed [km/h]"; or nothing."""
    match = _UNIT_IN_NAME.match(name)
    return match.group(1).strip() if match else ""


def check_size(path: str | Path, values: int, what: str) -> None:
    """Raises TwinError if a log declares more values than fit."""
    if values > LARGEST_LOG:
        raise TwinError(
            f"{path}: {what} {values:,} values ({8 * values / 2**30:.3g} GiB); "
            f"allowed: {LARGEST_LOG:,}"
        )


def check_file_size(path: str | Path) -> None:
    """Raises TwinError if there is no such file, or it is too large."""
    try:
        size = Path(path).stat().st_size
    except (OSError, ValueError) as error:
        text = getattr(error, "strerror", None) or str(error)
        raise TwinError(f"{path}: cannot be read: {text}") from error
    if size > LARGEST_FILE:
        raise TwinError(f"{path}: has {size:,} bytes; allowed: {LARGEST_FILE:,}")


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
            f"{path}: {name} runs backwards, from {time[row]:.9g} to {time[row + 1]:.9g} at "
            f"sample {row + 1}; allowed: rising times"
        )


def guess_time(path: str | Path, names: list[str]) -> tuple[str, str]:
    """The name of the time column that nobody named, and a sentence about it."""
    for name in names:
        bare = re.sub(r"[\[(].*", "", name).strip().lower()
        if bare in ("time", "t", "timestamp", "time_s"):
            return name, f"time is taken from {name!r}."
    if not names:
        raise TwinError(f"{path}: has no numeric channels; allowed: a column of time and others")
    return names[0], f"time is taken from the first column, {names[0]!r}."


def log_of_table(
    path: Path,
    columns: dict[str, Array],
    units: dict[str, str],
    text: dict[str, str],
    time: tuple[str | None, float | None],
) -> RawLog:
    """A log whose channels share one column of time.

    Args:
        path: the file.
        columns: the numeric columns by name, of one length.
        units: of columns, where the file has them.
        text: see `RawLog`.
        time: name of the time's column and its unit [s]; None where the map does not say.

    Raises:
        TwinError: no such column, or its times do not rise.
    """
    from twin.logs.units import UNITS

    name, seconds = time
    notes: tuple[str, ...] = ()
    if name is None:
        name, note = guess_time(path, list(columns))
        notes = (note,)
    if name not in columns:
        raise TwinError(
            f"{path}: has no numeric column {name!r} for time; it has {listed(columns)}"
        )
    if seconds is None:
        seconds = UNITS["time"].get(units.get(name) or unit_in(name), 1.0)
    check_time(path, f"time {name!r}", columns[name])
    stamps = columns[name] * seconds
    channels = {
        column: Channel(time=stamps, values=values, unit=units.get(column) or unit_in(column))
        for column, values in columns.items()
        if column != name
    }
    return RawLog(path=path, channels=channels, text=text, notes=notes)


def listed(names: object, most: int = 12) -> str:
    """Names in a message, not too many of them."""
    names = [str(name)[:40] for name in names]  # pyright: ignore[reportGeneralTypeIssues]
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
