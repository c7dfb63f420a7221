"""Logs and drives as tables of text: CSV, TSV and what loggers call so."""

import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import TwinError
from twin.logs.arrow_columns import cleaned
from twin.logs.raw_log import (
    Array,
    Numbers,
    RawLog,
    Wanted,
    check_size,
    log_of_table,
)
from twin.logs.text_file import HEAD, TextFile, open_text
from twin.logs.text_table import MISSING, WHITESPACE, Layout, cells_of, find_table
from twin.toml_file import reason

MARK = "# twin_drive "  # what a drive's first line starts with; its metadata follow
_HEAD_LINES = 1000  # that may stand before the numbers
_NULLS = sorted({f for word in MISSING for f in (word, word.upper(), word.capitalize(), "NaN")})


def write(path: Path, columns: dict[str, Array], metadata: str) -> None:
    """Writes a drive's columns, to the bit, and its metadata as the first line."""
    import pyarrow as pa
    from pyarrow import csv as pa_csv

    with path.open("wb") as file:
        file.write(f"{MARK}{metadata}\n".encode())
        pa_csv.write_csv(pa.table(columns), file, pa_csv.WriteOptions(quoting_style="none"))


def read_columns(path: Path) -> tuple[dict[str, Array], str | None]:
    """A drive's columns by name and its metadata; None if the file is no drive.

    Raises:
        TwinError: the file cannot be read.
    """
    file = open_text(path)
    if not (file.lines and file.lines[0].startswith(MARK)):
        return {}, None
    found = _numbers(path, file, _layout(path, file, frozenset()))
    for name, entry in found.text.items():
        raise TwinError(f"{path}: column {name} has the entry {entry}; allowed: numbers")
    for name, bad in found.bad.items():
        raise TwinError(f"{path}: column {name} has text in {bad.sum()} rows; allowed: numbers")
    for note in found.notes:
        raise TwinError(f"{path}: is a damaged drive: {note}")
    columns = {name: column.values for name, column in found.columns.items()}
    return columns, file.lines[0].removeprefix(MARK)


def read_log(path: Path, wanted: Wanted) -> RawLog:
    """A log of anybody.

    Commas, semicolons, tabs, bars or spaces may stand between the columns, and decimal commas where
    the columns are not separated by commas. `twin.logs.text_table` says what may stand before the
    numbers. Cells and rows that are damaged are left out and counted.

    Raises:
        TwinError: the file cannot be read.
    """
    file = open_text(path)
    layout = _layout(path, file, wanted.names | {wanted.time.name or ""})
    return log_of_table(path, _numbers(path, file, layout), wanted.time)


def read_table(path: Path) -> Numbers:
    """The columns of a table that need not be a log: it has no time.

    Raises:
        TwinError: the file cannot be read, or is no table.
    """
    file = open_text(path)
    return _numbers(path, file, _layout(path, file, frozenset()))


def _layout(path: Path, file: TextFile, names: frozenset[str]) -> Layout:
    found = find_table(file.lines[:_HEAD_LINES], names - {""})
    if found is None:
        raise TwinError(
            f"{path}: is no table of text: allowed: a row of names within the first {HEAD} bytes "
            "and rows of numbers below it"
        )
    return found


def _numbers(path: Path, file: TextFile, layout: Layout) -> Numbers:
    """All columns of the table, cleaned."""
    notes = list(file.notes)
    if layout.left_out:
        notes.append(f"{layout.left_out} rows between the names and the numbers are left out.")
    table, wrong = _table(path, file, layout)
    if wrong:
        if len(wrong) > max(table.num_rows, 1):
            raise TwinError(
                f"{path}: {len(wrong)} of {len(wrong) + table.num_rows} rows have not the "
                f"{len(layout.names)} cells of the row of names; allowed: a table"
            )
        notes.append(
            f"{len(wrong)} rows that have not {len(layout.names)} cells are left out, first "
            f"{wrong[0][:40]!r}."
        )
    columns, text, bad = {}, {}, {}
    for name, arrow in zip(layout.names, table.columns, strict=True):
        found = cleaned(arrow, commas=layout.delimiter != ",")
        if found.column is None:
            text[name] = found.text
        else:
            columns[name] = found.column._replace(unit=layout.units.get(name, ""))
        if found.bad is not None:
            bad[name] = found.bad
    _check_padding(path, layout, columns, text)
    return Numbers(columns, text, bad, layout.repeated, tuple(notes))


def _check_padding(
    path: Path, layout: Layout, columns: dict[str, Any], text: dict[str, str]
) -> None:
    """Refuses rows of numbers that have one cell more than there are names, unless it is empty."""
    if not layout.padded:
        return
    last = layout.names[-1]
    if text.pop(last, "empty") != "empty" or np.isfinite(columns[last].values).any():
        raise TwinError(
            f"{path}: the rows of numbers have {len(layout.names)} cells, the row of names "
            f"{len(layout.names) - 1}; allowed: as many"
        )
    columns.pop(last, None)


def _table(path: Path, file: TextFile, layout: Layout) -> tuple[Any, list[str]]:
    """The table as Arrow's, and the rows that have another number of cells."""
    import pyarrow as pa
    from pyarrow import csv as pa_csv

    wrong: list[str] = []

    def leave_out(row: Any) -> str:
        wrong.append(str(row.text))
        return "skip"

    for encoding in dict.fromkeys((file.encoding, "latin-1")):
        wrong.clear()
        try:
            with _from_first_row(path, file, layout) as content:
                table = pa_csv.read_csv(
                    content,
                    read_options=pa_csv.ReadOptions(
                        encoding=encoding, column_names=list(layout.names)
                    ),
                    parse_options=pa_csv.ParseOptions(
                        delimiter=_delimiter(layout), invalid_row_handler=leave_out
                    ),
                    convert_options=pa_csv.ConvertOptions(null_values=_NULLS),
                )
            check_size(path, table.num_rows * table.num_columns, "has")
            return table, wrong
        except OSError as error:
            raise TwinError(f"{path}: cannot be read: {reason(error)[:200]}") from error
        except (ValueError, pa.ArrowException):
            continue
    return _line_by_line(path, file, layout)


def _delimiter(layout: Layout) -> str:
    return "\t" if layout.delimiter == WHITESPACE else layout.delimiter


def _from_first_row(path: Path, file: TextFile, layout: Layout) -> Any:
    """A binary file that starts at the first row of numbers."""
    start = file.offsets[layout.first]
    if file.body is None and layout.delimiter != WHITESPACE:
        content = path.open("rb")
        content.seek(start)
        return content
    body = file.body if file.body is not None else path.read_bytes()
    body = body[start:]
    if layout.delimiter == WHITESPACE:
        body = re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", body)
        body = re.sub(rb"[ \t]+", b"\t", body)
    return io.BytesIO(body)


def _line_by_line(path: Path, file: TextFile, layout: Layout) -> tuple[Any, list[str]]:
    """The same for what Arrow does not read, as a last row that ends within quotes."""
    import pyarrow as pa

    wrong: list[str] = []
    rows: list[list[str]] = []
    with _from_first_row(path, file, layout) as content:
        for raw in io.TextIOWrapper(content, encoding=file.encoding, errors="replace"):
            line = raw.rstrip("\r\n")
            cells = cells_of(line, _delimiter(layout))
            if len(cells) == len(layout.names):
                rows.append(cells)
                check_size(path, len(rows) * len(layout.names), "has")
            elif line.strip():
                wrong.append(line)
    columns = zip(*rows, strict=True) if rows else [()] * len(layout.names)
    arrays = [pa.chunked_array([pa.array(column, pa.string())]) for column in columns]
    return pa.table(arrays, names=[str(i) for i in range(len(arrays))]), wrong
