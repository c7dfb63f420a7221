"""Lines as they come become samples in our names and units: JSON, or a table as in a log's file.

The table may have what the files of loggers have: a head, rows of units, any delimiter, dates and
clocks. Rows and cells that are damaged are left out and counted, as in a file.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from twin import TwinError
from twin.logs.log_time import Column, TimeColumn, TimeWanted, find_time, text_as_seconds, unit_in
from twin.logs.map import LogMap, Source, unit_in_si
from twin.logs.text_table import Layout, cells_of, find_table, number_of

Numbers = dict[str, float]  # of one sample, in our names and units
_PREFIXES = ("input.", "measurement.")
_NAME = "standard input"
_ROWS = 2  # of numbers below a head, before the first sample goes on
_HEAD = 1000  # lines that may stand before the numbers
_DAY = 86400.0


class LineReader:
    """Samples from lines, by a map or by our names."""

    def __init__(self, log_map: LogMap | None) -> None:
        """Args: log_map: of the names and units; None: ours."""
        self._map = log_map
        self._layout: Layout | None = None
        self._time: TimeColumn | None = None
        self._scales: dict[str, float] = {}
        self._clock = math.nan  # the last one, and days that have passed since the first
        self._days = 0.0
        self._about_time: tuple[str, ...] = ()
        self._wrong = dict.fromkeys(("rows", "cells"), 0)

    def samples(self, lines: Iterable[str]) -> Iterator[Numbers]:
        """Samples of lines, as they come.

        Raises:
            TwinError: a line is no JSON, there is no table, or time or a channel is missing.
        """
        head: list[str] = []
        for number, raw in enumerate(lines, 1):
            line = raw.strip("\r\n\ufeff\0")
            if line.lstrip().startswith("{"):
                yield self._sample(*_of_json(line, number))
            elif self._layout is None:
                head.append(line)
                yield from self._begin(head, _ROWS)
                if len(head) > _HEAD:
                    break
            else:
                yield from self._row(line)
        if head and self._layout is None:
            yield from self._begin(head, 1)
            if self._layout is None:
                raise TwinError(
                    f"{_NAME}: has no row of names with rows of numbers below it; allowed: lines "
                    "of JSON, or a table of text"
                )

    def notes(self) -> list[str]:
        """What was decided and left out, in sentences."""
        said = [
            f"{n} {what} that are damaged are left out." for what, n in self._wrong.items() if n
        ]
        return [*(self._about_time if self._map else ()), *said]

    def _begin(self, head: list[str], rows: int) -> Iterator[Numbers]:
        wanted = () if self._map is None else self._map.wanted.names
        layout = find_table(head, wanted, rows)
        if layout is None or len([line for line in head[layout.first :] if line]) < rows:
            return
        self._layout = layout
        for line in head[layout.first :]:
            yield from self._row(line)

    def _row(self, line: str) -> Iterator[Numbers]:
        layout = self._layout
        if layout is None or not line.strip() or line.lstrip().startswith("#"):
            return
        cells = cells_of(line, layout.delimiter)
        if len(cells) != len(layout.names) or tuple(cells) == layout.names:
            self._wrong["rows"] += 1
            return
        found: Numbers = {}
        texts: dict[str, str] = {}
        for name, cell in zip(layout.names, cells, strict=True):
            value = number_of(cell)
            if value is None:
                texts[name] = cell
            found[name] = math.nan if value is None else value
        yield self._sample(found, texts)

    def _sample(self, row: Mapping[str, float], texts: Mapping[str, str]) -> Numbers:
        """A row in our names and units."""
        if self._time is None:
            self._time = self._find_time(row, texts)
        name = self._time.name
        found: Numbers = {}
        seconds = self._time.factor * row.get(name, math.nan)
        if name in texts:
            seconds = self._of_text(texts[name])
        if self._map is None:
            for key, value in row.items():
                if key != name:
                    self._wrong["cells"] += key in texts
                    found[_ours(key)] = value
        else:
            found = self._mapped(self._map, row, texts)
        found["time"] = seconds
        return found

    def _mapped(
        self, log_map: LogMap, row: Mapping[str, float], texts: Mapping[str, str]
    ) -> Numbers:
        found: Numbers = dict(log_map.constants)
        for name, source in log_map.channels.items():
            if source.name not in row:
                raise TwinError(f"{_NAME}: {source.name!r}, which the map names, is missing")
            if name not in self._scales:
                self._scales[name] = self._scale(log_map, name, source)
            self._wrong["cells"] += source.name in texts
            value = self._scales[name] * (row[source.name] - source.offset)
            found[name] = float(np.clip(value, -1e300, 1e300))
        return found

    def _find_time(self, row: Mapping[str, float], texts: Mapping[str, str]) -> TimeColumn:
        """The column of time, by what a file's would be."""
        wanted = TimeWanted() if self._map is None else self._map.wanted.time
        units = {} if self._layout is None else self._layout.units
        columns: dict[str, Column] = {}
        for name, value in row.items():
            declared = text_as_seconds([texts[name]]) if name in texts else None
            if declared is not None:
                columns[name] = Column(declared[0], declares=declared[1])
            elif name not in texts:
                columns[name] = Column(np.array([value]), units.get(name, ""))
        found = find_time(_NAME, columns, wanted, texts)
        self._about_time = found.notes
        return found

    def _of_text(self, cell: str) -> float:
        """A date or clock; a clock goes on behind midnight."""
        found = text_as_seconds([cell])
        if found is None:
            return math.nan
        seconds = float(found[0][0])
        if found[1] == "a clock":
            if seconds + self._days < self._clock - 0.5 * _DAY:
                self._days += _DAY
            seconds += self._days
            self._clock = seconds
        return seconds

    def _scale(self, log_map: LogMap, name: str, source: Source) -> float:
        """Ours per number of the lines."""
        units = {} if self._layout is None else self._layout.units
        unit = source.unit or units.get(source.name) or unit_in(source.name)
        if not unit:
            raise TwinError(
                f"{log_map.path}: channels.{name}.unit is missing and the lines give none; "
                "allowed: name it"
            )
        for key, value, only in (("delay", source.delay, 0.0), ("clock", source.clock, 1.0)):
            if value != only:
                raise TwinError(
                    f"{log_map.path}: channels.{name}.{key} is {value:g}; allowed in a stream: "
                    f"{only:g}"
                )
        try:
            return source.sign * unit_in_si(name, unit, source.radius) * source.factor
        except TwinError as error:
            raise TwinError(f"{log_map.path}: channels.{name}.unit {error}") from None


def _of_json(line: str, number: int) -> tuple[Numbers, dict[str, str]]:
    """Numbers of a line, and texts that are dates or clocks."""
    try:
        content = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise TwinError(f"{_NAME}: line {number} is no JSON: {error}") from None
    texts = {
        str(name): value
        for name, value in content.items()
        if isinstance(value, str)
        and number_of(value.strip()) is None
        and text_as_seconds([value]) is not None
    }
    numbers = {
        str(name): math.nan if name in texts else _number(value, name, number)
        for name, value in content.items()
    }
    return numbers, texts


def _number(value: object, name: str, line: int) -> float:
    found = math.nan if value is None else value
    if isinstance(value, str):
        found = number_of(value.strip())
    try:
        return float(found)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError, OverflowError):
        raise TwinError(
            f"{_NAME}: {name[:40]} is {str(value)[:20]!r} in line {line}; allowed: a number"
        ) from None


def _ours(name: str) -> str:
    for prefix in _PREFIXES:
        name = name.removeprefix(prefix)
    return name
