"""Time of a log: which column it is, what its numbers count, and stamps that samples share.

Nothing is guessed: a column is time if the map names it, if it is called time, or if the file
itself declares it to be (a timestamp, the index of a pandas table). A running number is no time. A
unit that is not known is refused.
"""

import datetime
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError
from twin.logs.units import UNITS, in_si, is_unit

Array = NDArray[np.float64]

# Names of time, in lower case, without brackets, single spaces between words
_NAMES = {
    "time", "t", "times", "timestamp", "time stamp", "stamp", "datetime", "date time", "timecode",
    "zeit", "zeitstempel", "temps", "tempo", "tiempo", "seconds", "time since start",
}  # fmt: skip
_KINDS_OF_TIME = {
    "elapsed", "session", "log", "run", "recording", "utc", "gps", "device", "unix", "epoch",
    "sample", "rel", "relative", "abs", "absolute", "system", "ros",
}  # fmt: skip
_NAMES |= {f"{kind} time" for kind in _KINDS_OF_TIME}
_INDEX_NAMES = {
    "", "#", "index", "idx", "i", "n", "no", "nr", "row", "rows", "sample", "samples", "counter",
    "sample no", "sample number", "count", "frame", "frames", "id", "line", "record", "number",
    "level 0", "point", "step",
}  # fmt: skip
_UNIT_IN_NAME = re.compile(r".*[\[(<{]([^\[\]()<>{}]+)[\])>}]\s*$", re.DOTALL)
# A clock, with a date in the way of some country before it, which does not count
_CLOCK = re.compile(
    r"\s*(?:\d{1,4}[./-]\w{1,9}[./-]\d{1,4},?[ T]+)?"
    r"(?:(\d{1,3}):)?(\d{1,3}):(\d{1,2}(?:[.,]\d+)?)\s*([aApP][mM])?\s*",
    re.ASCII,
)
_EPOCH = 1e11  # numbers of no unit beyond this are no seconds: since 1970 they count ms, us or ns
_COARSE = 0.1  # of the samples share a stamp: the clock is coarser than the samples; chosen


class Column(NamedTuple):
    """A numeric column of a table.

    Attributes:
        values: (N,) in the log's unit, NaN where nothing is.
        unit: as the log gives it; empty if it gives none.
        declares: "" for numbers; "a timestamp", "a duration" or "a clock": values are seconds then.
        is_index: whether the file declares it to be the table's index.
    """

    values: Array
    unit: str = ""
    declares: str = ""
    is_index: bool = False


class TimeWanted(NamedTuple):
    """What a map says of time.

    Attributes:
        name: of the column; None: the log's own.
        unit: [s] that one of its numbers is; None: as the log says.
    """

    name: str | None = None
    unit: float | None = None


def unit_in(name: str) -> str:
    """The unit in brackets at the end of a name, as in "Speed [km/h]"; or nothing."""
    match = _UNIT_IN_NAME.match(name)
    return match.group(1).strip() if match else ""


def bare(name: str) -> str:
    """A name without brackets, case and punctuation."""
    text = re.sub(r"[\[(<{].*", "", name).replace("_", " ").replace(".", " ").replace("-", " ")
    return " ".join(text.lower().split())


def is_called_time(name: str) -> bool:
    """Whether a name is one of time, a unit behind it allowed ("time_ms")."""
    words = bare(name)
    head, _, tail = words.rpartition(" ")
    return words in _NAMES or (head in _NAMES and in_si("time", tail) is not None)


class TimeColumn(NamedTuple):
    """The time of a table.

    Attributes:
        name: of its column.
        factor: seconds that one of its numbers is.
        notes: sentences about the choice.
    """

    name: str
    factor: float
    notes: tuple[str, ...] = ()


def find_time(
    path: str | Path, columns: Mapping[str, Column], wanted: TimeWanted, text: Mapping[str, str]
) -> TimeColumn:
    """The column of time of a table.

    Raises:
        TwinError: there is none, more than one, or its unit is not known.
    """
    if wanted.name is not None:
        if wanted.name not in columns:
            kind = f"is no number but {text[wanted.name]}" if wanted.name in text else "is missing"
            raise TwinError(
                f"{path}: time column {wanted.name[:40]!r} {kind}; {_candidates(columns)}"
            )
        return _time(path, wanted.name, columns[wanted.name], wanted.unit)
    found = [name for name, column in columns.items() if column.is_index and _is_time(name, column)]
    found = found or [name for name in columns if is_called_time(name)]
    found = found or [name for name, column in columns.items() if column.declares]
    if not found:
        raise TwinError(f"{path}: no column is called time; {_candidates(columns)}")
    times = [_time(path, name, columns[name], wanted.unit) for name in found]
    first = times[0].factor * columns[found[0]].values
    for name, time in zip(found[1:], times[1:], strict=True):
        if not _agree(first, time.factor * columns[name].values):
            raise TwinError(
                f"{path}: time may be {found[0][:40]!r} or {name[:40]!r}, which differ; allowed: "
                "time.name in the map says which"
            )
    said = times[0].notes or (f"Time is taken from {found[0]!r}.",)
    return times[0]._replace(notes=said)


def _is_time(name: str, column: Column) -> bool:
    """Whether a declared index is time, not a running number."""
    if column.declares or is_called_time(name):
        return True
    return not _is_running_number(column.values) and bool((column.values % 1.0 != 0.0).any())


def _is_running_number(values: Array) -> bool:
    return values.size > 1 and bool((np.diff(values) == 1.0).all())


def _candidates(columns: Mapping[str, Column]) -> str:
    names = [
        name
        for name, column in columns.items()
        if column.values.size > 1
        and np.isfinite(column.values).all()
        and (np.diff(column.values) >= 0.0).all()
        and np.ptp(column.values) > 0.0
        and not _is_running_number(column.values)
    ]
    rising = f"; these rise: {', '.join(repr(name[:40]) for name in names[:6])}" if names else ""
    return f"allowed: [time] with its name and unit in the map{rising}"


def _agree(first: Array, second: Array) -> bool:
    if not (np.isfinite(first).all() and np.isfinite(second).all()):
        return False
    a, b = first - first[0], second - second[0]
    step = np.ptp(a) / max(a.size - 1, 1)
    return bool(np.abs(a - b).max() <= max(1.5 * step, 1e-3 * np.ptp(a)))


def _time(path: str | Path, name: str, column: Column, unit: float | None) -> TimeColumn:
    """A column as the time of its table."""
    if column.declares:
        if unit is not None:
            raise TwinError(
                f"{path}: time {name[:40]!r} is {column.declares}, which has no other unit; "
                "allowed: no time.unit in the map"
            )
        return TimeColumn(name, 1.0)
    if bare(name) in _INDEX_NAMES and unit is None and _is_running_number(column.values):
        raise TwinError(
            f"{path}: time {name[:40]!r} is a running number, not a time; allowed: a column of "
            "time, or time.unit in the map says what one of it lasts"
        )
    if unit is not None:
        return TimeColumn(name, unit)
    given = column.unit or unit_in(name)
    if not given:
        _, _, given = bare(name).rpartition(" ")
        given = given if " " in bare(name) and is_unit(given) else ""
    if bare(name) == "seconds":
        given = given or "s"
    factor = in_si("time", given) if given else 1.0
    if factor is None:
        raise TwinError(
            f"{path}: time {name[:40]!r} is in {given[:20]!r}, an unknown unit of time; allowed: "
            f"{', '.join(UNITS['time'])}, or time.unit in the map"
        )
    largest = factor * np.nanmax(np.abs(column.values), initial=0.0)
    if largest > _EPOCH:
        has = f"in {given[:20]!r}" if given else "without a unit"
        raise TwinError(
            f"{path}: time {name[:40]!r} {has} is up to {largest:.4g}, too much for seconds; "
            f"allowed: time.unit in the map: {', '.join(UNITS['time'])}"
        )
    if not given:
        said = f"Time is taken from {name!r}, which has no unit: as s."
    else:
        said = f"Time is taken from {name!r} in {given}."
    return TimeColumn(name, factor, (said,))


def text_as_seconds(cells: list[str]) -> tuple[Array, str] | None:
    """ISO dates or clock times as seconds, and what they are; None if they are neither.

    A cell that cannot be read is NaN; half of them must be readable. A clock that passes midnight
    goes on.
    """
    values = np.array([_one_text(cell) for cell in cells])
    if np.isfinite(values).sum() * 2 <= len(cells):
        return None
    is_clock = not any(_iso(cell) is not None for cell in cells[:20])
    if is_clock:
        good = np.flatnonzero(np.isfinite(values))
        back = np.flatnonzero(np.diff(values[good]) < -43200.0) + 1
        for start in good[back]:
            values[start:] += 86400.0
    return values, "a clock" if is_clock else "a timestamp"


def _one_text(cell: str) -> float:
    moment = _iso(cell)
    if moment is None:
        return _clock(cell)
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=datetime.UTC)
    since = moment - datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
    return since.days * 86400.0 + since.seconds + since.microseconds * 1e-6


def _iso(cell: str) -> datetime.datetime | None:
    try:
        return datetime.datetime.fromisoformat(cell.strip())
    except ValueError:
        return None


def _clock(cell: str) -> float:
    found = _CLOCK.fullmatch(cell)
    if not found:
        return np.nan
    hours, minutes, seconds, half = found.groups()
    of_day = int(hours or 0)
    if half:
        of_day = of_day % 12 + 12 * (half.lower() == "pm")
    return 3600.0 * of_day + 60.0 * int(minutes) + float(seconds.replace(",", "."))


def spread(time: Array) -> tuple[Array, list[str]]:
    """Times of samples that share stamps: spread evenly if the stamps are coarse, else as they are.

    Args:
        time: (N,) never falling [s].

    Returns:
        (N,) times, and a sentence about what was found, if anything.
    """
    shared = np.flatnonzero(np.diff(time) == 0.0)
    if not shared.size:
        return time, []
    starts = np.concatenate([[0], np.flatnonzero(np.diff(time) > 0.0) + 1])
    if shared.size < _COARSE * time.size or starts.size < 3:
        return time, [f"{shared.size} samples share a time stamp with another: the first counts."]
    counts = np.diff([*starts, time.size])
    ticks = np.diff(time[starts])
    tick = float(np.median(ticks))
    steps = np.minimum(np.append(ticks, tick), 1.5 * tick) / counts  # a gap is not filled
    within = np.arange(time.size) - np.repeat(starts, counts)
    if counts[0] < counts[1]:  # the recording starts within a tick
        steps[0] = steps[1]
        within[: counts[0]] += counts[1] - counts[0]
    steps[-1] = steps[-2] if counts[-1] < counts[-2] else steps[-1]  # and ends within one
    result = np.repeat(time[starts], counts) + np.repeat(steps, counts) * within
    return result, [
        f"{shared.size} of {time.size} samples share a time stamp: the stamps are coarse "
        f"({tick:.4g} s), the samples between them are spread evenly."
    ]
