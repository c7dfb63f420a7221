"""Logs of RaceLogic's loggers, .vbo: sections of text, columns between spaces.

Time is a clock of UTC, HHMMSS.SS. Units of the standard channels stand in the section [header],
those of the others in [channel units].
"""

from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import TwinError
from twin.logs.log_time import Column
from twin.logs.raw_log import Numbers, RawLog, Wanted, check_file_size, check_size, log_of_table
from twin.logs.text_file import encoding_of, without_nulls
from twin.logs.text_table import number_of
from twin.logs.units import is_unit
from twin.toml_file import reason

_DAY = 86400.0
_KMH = ("km/h", "kmh")


def read_log(path: Path, wanted: Wanted) -> RawLog:
    """A log of anybody.

    Raises:
        TwinError: the file cannot be read.
    """
    check_file_size(path)
    try:
        body, notes = without_nulls(path.read_bytes())
    except (OSError, ValueError) as error:
        raise TwinError(f"{path}: cannot be read: {reason(error)}") from error
    sections = _sections(body.decode(encoding_of(body[:65536]), "replace"))
    names = tuple(" ".join(sections.get("column names", [])).split())
    rows = sections.get("data", [])
    if not names or len(rows) < 2:
        raise TwinError(f"{path}: is no .vbo: it has no [column names] or no [data]")
    check_size(path, len(names) * len(rows), "has")
    cells = [row.split() for row in rows]
    good = [row for row in cells if len(row) == len(names)]
    said = list(notes)
    if len(good) < len(cells):
        said.append(f"{len(cells) - len(good)} rows that have not {len(names)} cells are left out.")
    numbers = [[number_of(cell) for cell in row] for row in good]
    table = np.array(
        [[np.nan if value is None else value for value in row] for row in numbers], dtype=np.float64
    ).reshape(-1, len(names))
    repeated = tuple(sorted({name for name in names if names.count(name) > 1}))
    units = _units(sections, names)
    columns: dict[str, Column] = {}
    for place, name in enumerate(names):
        values = table[:, place]
        if name == "time":
            columns[name] = Column(_of_clock(values), declares="a clock")
        elif name not in columns:
            columns[name] = Column(values, units[place])
    return log_of_table(path, Numbers(columns, {}, {}, repeated, tuple(said)), wanted.time)


def _sections(text: str) -> dict[str, list[str]]:
    """Lines by section, in lower case."""
    sections: dict[str, list[str]] = {}
    lines: list[str] = []
    for raw in text.splitlines():
        line = raw.strip()
        if line.startswith("[") and line.endswith("]"):
            lines = sections.setdefault(line[1:-1].lower(), [])
        elif line:
            lines.append(line)
    return sections


def _units(sections: dict[str, list[str]], names: tuple[str, ...]) -> list[str]:
    """A unit for each column; empty where none is given."""
    units = [""] * len(names)
    header = sections.get("header", [])
    if len(header) == len(names):
        for place, line in enumerate(header):
            last = line.split()[-1]
            if len(line.split()) > 1 and is_unit(last):
                units[place] = "km/h" if last.lower() in _KMH else last
    others = sections.get("channel units", [])
    for place, unit in enumerate(others, len(names) - len(others)):
        if 0 <= place < len(names):
            units[place] = unit.strip("() ")
    return units


def _of_clock(values: np.ndarray) -> np.ndarray:
    """Seconds of HHMMSS.SS, going on behind midnight."""
    hours, rest = np.divmod(values, 10_000.0)
    minutes, seconds = np.divmod(rest, 100.0)
    time = 3600.0 * hours + 60.0 * minutes + seconds
    steps = np.diff(time, prepend=time[:1])
    return time + _DAY * np.cumsum(np.nan_to_num(steps) < -0.5 * _DAY)


def read_columns(path: Path) -> tuple[dict[str, Any], str | None]:
    """Nothing: a drive of ours is not kept as .vbo."""
    check_file_size(path)
    return {}, None


def write(path: Path, columns: dict[str, Any], metadata: str) -> None:
    """Refuses: a drive of ours is not kept as .vbo."""
    raise TwinError(f"{path}: drives are not written as .vbo; allowed: Parquet, CSV, MDF 4")
