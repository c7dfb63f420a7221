"""A table in a text file: where its names, units and numbers stand, and what its cells mean.

Loggers put heads of key rows before the names, and rows of units and of sources behind them; names
may stand behind a #. Here only the first lines are looked at; `twin.logs.csv` reads the rest, and a
stream reads line by line.
"""

import csv
import re
from collections.abc import Collection, Sequence
from typing import NamedTuple

from twin.logs.log_time import is_called_time, text_as_seconds
from twin.logs.units import is_unit

WHITESPACE = " "  # the delimiter of tables whose columns are aligned by spaces
_DELIMITERS = (",", ";", "\t", "|", WHITESPACE)
MISSING = frozenset(("", "nan", "na", "n/a", "null", "none", "-", "--", "#n/a", "-nan", "nan(ind)"))
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?", re.ASCII)
_ROWS = 3  # of numbers that make a table, if the file has so many
_UNITS = 0.4  # of a row's cells that are known units make it a row of units
_SHARE = 0.5  # of a row's cells that are numbers or missing, at least


class Layout(NamedTuple):
    """How a table of text is written.

    Attributes:
        delimiter: between cells; `WHITESPACE` for any number of spaces and tabs.
        names: of the columns, unique; a name's second occurrence gets a number.
        repeated: names that occur more than once.
        units: by name, where the file has a row of them.
        first: index of the first line of numbers.
        names_line: index of the line of names.
        left_out: lines between names and numbers that are neither units nor blank.
        padded: whether the rows of numbers have one cell more than there are names.
    """

    delimiter: str
    names: tuple[str, ...]
    repeated: tuple[str, ...]
    units: dict[str, str]
    first: int
    names_line: int
    left_out: int
    padded: bool


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of a line, without quotes and spaces around them."""
    if delimiter == WHITESPACE:
        return line.split()
    try:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        cells = line.split(delimiter)
    return [cell.strip() for cell in cells]


def number_of(cell: str) -> float | None:
    """A cell's number, with a decimal point or comma; NaN if it is missing, None if it is text."""
    if _NUMBER.fullmatch(cell):
        return float(cell.replace(",", "."))
    lowered = cell.lower()
    if lowered in MISSING:
        return float("nan")
    if lowered in ("true", "false"):
        return float(lowered == "true")
    if lowered.lstrip("+-") in ("inf", "infinity", "1.#inf", "1.#qnan", "1.#ind"):
        return float("nan")
    return None


def find_table(
    lines: Sequence[str], wanted: Collection[str] = (), rows: int = _ROWS
) -> Layout | None:
    """The table in the first lines of a text; None if there is none.

    Args:
        lines: without line ends.
        wanted: names that the row of names has to have, as far as they are known.
        rows: of numbers, at least; fewer do where the lines end before.
    """
    best: tuple[float, Layout] | None = None
    for delimiter in _DELIMITERS:
        layout = _with_delimiter(lines, delimiter, wanted, rows)
        if layout is None:
            continue
        known = sum(name in layout.names for name in wanted)
        score = 1e3 * known + len(layout.names) - 0.5 * layout.padded
        if best is None or score > best[0]:
            best = score, layout
    return best[1] if best else None


def _with_delimiter(
    lines: Sequence[str], delimiter: str, wanted: Collection[str], rows: int
) -> Layout | None:
    first = 0
    while first < len(lines):
        cells = _plain_cells(lines[first], delimiter)
        if _is_data(cells) and _goes_on(lines, first, delimiter, len(cells), rows):
            found = _layout(lines, first, delimiter, wanted)
            if found is not None:
                return found
        first += 1
    return None


def _plain_cells(line: str, delimiter: str) -> list[str]:
    """Cells of a line; none of a comment or a blank line."""
    return [] if line.lstrip()[:1] in ("#", "") else cells_of(line, delimiter)


def _is_data(cells: list[str]) -> bool:
    there = [cell for cell in cells if cell.lower() not in MISSING]
    if len(cells) < 2 or not there:
        return False
    numbers = sum(_is_value(cell) for cell in there)
    return numbers >= _SHARE * len(there)


def _is_value(cell: str) -> bool:
    return number_of(cell) is not None or text_as_seconds([cell]) is not None


def _goes_on(lines: Sequence[str], first: int, delimiter: str, width: int, rows: int) -> bool:
    """Whether rows of numbers of the same width follow."""
    below = [line for line in lines[first : first + 4 * rows] if line.strip()]
    good = [
        len(cells) == width and _is_data(cells)
        for cells in (_plain_cells(line, delimiter) for line in below[: rows + 1])
    ]
    # one row may be damaged
    return sum(good) >= min(rows, max(len(below) // 2, 1))


def _layout(
    lines: Sequence[str], first: int, delimiter: str, wanted: Collection[str]
) -> Layout | None:
    """Names and units above the first line of numbers."""
    width = len(_plain_cells(lines[first], delimiter))
    block = _heads(lines, first, delimiter, width)
    if not block:
        return None
    at = _row_of_names(block, wanted)
    index, cells = block[at]
    names, repeated = _unique(cells, width)
    behind = [row for _, row in block[at + 1 :]]
    others = [row for row in behind if row != cells]
    rows_of_units = [row for row in others if _share_of_units(row) >= _UNITS] or others
    units: dict[str, str] = {}
    if rows_of_units:
        padded = [*rows_of_units[0], *[""] * (width - len(rows_of_units[0]))]
        units = {
            name: unit.strip("[]()<>{} ")
            for name, unit in zip(names, padded, strict=True)
            if unit.strip("[]()<>{} ")
        }
    return Layout(
        delimiter=delimiter,
        names=names,
        repeated=repeated,
        units=units,
        first=first,
        names_line=index,
        left_out=max(len(behind) - bool(units), 0),
        padded=len(cells) < width,
    )


def _share_of_units(cells: list[str]) -> float:
    filled = [cell for cell in cells if cell]
    return sum(is_unit(cell.strip("[]()<>{} ")) for cell in filled) / max(len(filled), 1)


def _heads(
    lines: Sequence[str], first: int, delimiter: str, width: int
) -> list[tuple[int, list[str]]]:
    """Rows of text of the table's width right above the numbers, from the top."""
    block: list[tuple[int, list[str]]] = []
    comments: list[tuple[int, list[str]]] = []
    for index in range(first - 1, max(first - 12, -1), -1):
        line = lines[index].strip()
        if not line:
            if block or comments:
                break
            continue
        rows = comments if line.startswith("#") else block
        if line.startswith("#") and block:
            break
        cells = cells_of(line.lstrip("# ") if rows is comments else lines[index], delimiter)
        if not _may_be_head(cells, width, delimiter):
            if rows is block:
                break
            continue
        rows.insert(0, (index, cells))
    return block or comments


def _may_be_head(cells: list[str], width: int, delimiter: str) -> bool:
    while len(cells) > width and not cells[-1]:
        cells.pop()
    filled = [cell for cell in cells if cell]
    texts = [cell for cell in filled if any(c.isalpha() or c in "#%°" for c in cell)]
    # a trailing delimiter behind the numbers makes them one wider than their names
    least = width if delimiter == WHITESPACE else width - 1
    return least <= len(cells) <= width and bool(texts) and len(texts) >= 0.5 * len(filled)


def _row_of_names(block: list[tuple[int, list[str]]], wanted: Collection[str]) -> int:
    """Index of the row of names in rows of text: the one with the map's names, or the first."""
    known = [sum(name in cells for name in wanted) for _, cells in block]
    if max(known) > 0:
        return known.index(max(known))
    for index, (_, cells) in enumerate(block):
        if any(is_called_time(cell) for cell in cells):
            return index
    full = [sum(bool(cell) for cell in cells) for _, cells in block]
    units = [sum(is_unit(cell) for cell in cells) > 0.5 * max(n, 1) for (_, cells), n in
             zip(block, full, strict=True)]  # fmt: skip
    for index, is_units in enumerate(units):
        if not is_units and full[index] >= 0.5 * len(block[index][1]):
            return index
    return 0


def _unique(cells: Sequence[str], width: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of all columns, each once, and those that occurred more than once."""
    names: list[str] = []
    padded = [*cells, *[""] * (width - len(cells))][:width]
    for place, cell in enumerate(padded, 1):
        name = cell or f"column {place}"
        number = 2
        unique = name
        while unique in names:
            unique, number = f"{name} ({number})", number + 1
        names.append(unique)
    repeated = tuple(sorted({cell for cell in padded if cell and padded.count(cell) > 1}))
    return tuple(names), repeated
