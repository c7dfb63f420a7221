"""Logs and drives in CSV: one row of names, perhaps one of units, then numbers."""

import csv
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from twin.errors import TwinError
from twin.logs.raw_log import Array, RawLog, check_file_size, check_size, log_of_table
from twin.toml_file import reason

MARK = "# twin_drive "  # what a drive's first line starts with; its metadata follow
_HEAD = 2**16  # bytes that the rows before the numbers may fill
_DELIMITERS = (",", ";", "\t")
_MISSING = ["", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "null", "-"]


class _Dialect(NamedTuple):
    """How a file is written."""

    encoding: str
    delimiter: str
    decimal: str
    skipped: int  # lines before the names
    names: list[str]
    units: dict[str, str]  # where a row of units follows the names
    metadata: str | None


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
    dialect = _dialect(path)
    if dialect.metadata is None:
        return {}, None
    columns, text = _read(path, dialect)
    for name, entry in text.items():
        raise TwinError(f"{path}: column {name} has the entry {entry}; allowed: numbers")
    return columns, dialect.metadata


def read_log(path: Path, time: tuple[str | None, float | None]) -> RawLog:
    """A log of anybody; `time` as in `twin.logs.raw_log.log_of_table`.

    Commas, semicolons and tabs may stand between the columns, a decimal comma where it is no
    comma; lines before the names start with #; a row of units may follow the names.

    Raises:
        TwinError: the file cannot be read.
    """
    dialect = _dialect(path)
    columns, text = _read(path, dialect)
    return log_of_table(path, columns, dialect.units, text, time)


def _dialect(path: Path) -> _Dialect:
    check_file_size(path)
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise TwinError(f"{path}: cannot be read: {reason(error)}") from error
    encoding, text = _decoded(head)
    if "\0" in text:
        raise TwinError(f"{path}: is no CSV: it has null characters; allowed: text")
    lines = text.splitlines()
    if len(head) == _HEAD:
        lines = lines[:-1]  # may be cut
    metadata = lines[0].removeprefix(MARK) if lines and lines[0].startswith(MARK) else None
    skipped = 0
    while skipped < len(lines) and (not lines[skipped].strip() or lines[skipped][0] == "#"):
        skipped += 1
    if skipped + 2 > len(lines):
        raise TwinError(
            f"{path}: is no CSV: it needs a row of names within the first {_HEAD} bytes and two "
            "of numbers"
        )
    delimiter = max(_DELIMITERS, key=lines[skipped].count)
    names = [name.strip() for name in _cells(lines[skipped], delimiter)]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise TwinError(f"{path}: the name {repeated[0][:40]!r} occurs twice; allowed: once")
    after = [_cells(line, delimiter) for line in lines[skipped + 1 : skipped + 20]]
    decimal = "," if delimiter != "," and _has_decimal_comma(after) else "."
    units = {}
    if not any(_is_number(cell) for cell in after[0]) and any(after[0]):
        units = {name: unit.strip(" []()") for name, unit in zip(names, after[0], strict=False)}
    return _Dialect(encoding, delimiter, decimal, skipped, names, units, metadata)


def _decoded(head: bytes) -> tuple[str, str]:
    """The encoding and the text; a character cut at the end does not count."""
    try:
        return "utf-8", head.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if len(head) == _HEAD and error.start > _HEAD - 4:
            return "utf-8", head[: error.start].decode("utf-8-sig")
        return "latin-1", head.decode("latin-1")


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:
        return line.split(delimiter)


def _is_number(cell: str) -> bool:
    try:
        float(cell.strip().replace(",", "."))
    except ValueError:
        return False
    return True


def _has_decimal_comma(rows: list[list[str]]) -> bool:
    return any("," in cell and _is_number(cell) for row in rows for cell in row)


def _read(path: Path, dialect: _Dialect) -> tuple[dict[str, Array], dict[str, str]]:
    """The numeric columns, and the first entry that is no number of each other one."""
    import pyarrow as pa
    from pyarrow import csv as pa_csv

    try:
        table = pa_csv.read_csv(
            str(path),
            read_options=pa_csv.ReadOptions(
                encoding=dialect.encoding,
                column_names=dialect.names,
                skip_rows=dialect.skipped + 1 + bool(dialect.units),
            ),
            parse_options=pa_csv.ParseOptions(delimiter=dialect.delimiter),
            convert_options=pa_csv.ConvertOptions(
                decimal_point=dialect.decimal,
                null_values=_MISSING,
                true_values=["true", "True", "TRUE"],
                false_values=["false", "False", "FALSE"],
            ),
        )
    except (OSError, ValueError, pa.ArrowException) as error:
        raise TwinError(f"{path}: cannot be read as CSV: {reason(error)[:200]}") from error
    check_size(path, table.num_rows * table.num_columns, "has")
    columns, text = {}, {}
    for name, column in zip(dialect.names, table.columns, strict=True):
        values = numbers(column)
        if values is None:
            text[name] = _first_text(column)
        else:
            columns[name] = values
    return columns, text


def numbers(column: Any) -> Array | None:
    """A column of Arrow as floats, NaN where nothing is; None if it holds no numbers."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_timestamp(kind):
        ticks = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
        return ticks * column.cast(pa.int64()).to_numpy().astype(np.float64)
    is_number = (
        pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_boolean(kind)
        or pa.types.is_null(kind)
    )
    if not is_number:
        return None
    if pa.types.is_boolean(kind):
        column = column.cast(pa.int8())
    if kind != pa.float64():
        column = column.cast(pa.float64(), safe=False)
    return column.to_numpy()


def _first_text(column: Any) -> str:
    for entry in column:
        text = str(entry.as_py())
        if entry.is_valid and not _is_number(text):
            return json.dumps(text[:20], ensure_ascii=False)
    return str(column.type)
