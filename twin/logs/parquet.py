"""Logs and drives in Parquet."""

from pathlib import Path
from typing import Any

from twin.errors import TwinError
from twin.logs.csv import numbers
from twin.logs.raw_log import Array, RawLog, check_file_size, check_size, log_of_table
from twin.toml_file import reason

METADATA_KEY = b"twin_drive"


def write(path: Path, columns: dict[str, Array], metadata: str) -> None:
    """Writes a drive's columns, and its metadata into those of the schema."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table(columns).replace_schema_metadata({METADATA_KEY: metadata})
    pq.write_table(table, path, write_page_checksum=True)


def read_columns(path: Path) -> tuple[dict[str, Array], str | None]:
    """A drive's columns by name, and its metadata; None if the file is no drive.

    Raises:
        TwinError: the file cannot be read, or a column does not hold doubles.
    """
    table = _table(path)
    metadata = (table.schema.metadata or {}).get(METADATA_KEY)
    if metadata is None:
        return {}, None
    columns: dict[str, Array] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        if name in columns:
            raise TwinError(f"{path}: column {name!r} occurs twice, names must be unique")
        if str(column.type) != "double":
            raise TwinError(f"{path}: column {name} is {column.type}, must be double")
        columns[name] = column.to_numpy()
    return columns, metadata.decode("utf-8", "replace")


def read_log(path: Path, time: tuple[str | None, float | None]) -> RawLog:
    """A log of anybody; `time` as in `twin.logs.raw_log.log_of_table`.

    A column's unit is that of its field's metadata `unit`, where there is one.

    Raises:
        TwinError: the file cannot be read.
    """
    table = _table(path)
    columns, text, units = {}, {}, {}
    for field, column in zip(table.schema, table.columns, strict=True):
        values = numbers(column)
        if values is None:
            text[field.name] = str(field.type)
        elif field.name in columns:
            raise TwinError(f"{path}: column {field.name[:40]!r} occurs twice; allowed: once")
        else:
            columns[field.name] = values
            units[field.name] = (field.metadata or {}).get(b"unit", b"").decode("utf-8", "replace")
    return log_of_table(path, columns, units, text, time)


def _table(path: Path) -> Any:
    """The whole table, once what it declares is known to fit."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    check_file_size(path)
    try:
        with path.open("rb") as file:
            declared = pq.ParquetFile(file, page_checksum_verification=True)
            groups = range(declared.metadata.num_row_groups)
            unpacked = sum(declared.metadata.row_group(i).total_byte_size for i in groups)
            check_size(path, declared.metadata.num_rows * declared.metadata.num_columns, "declares")
            check_size(path, unpacked // 8, "declares")
            return declared.read()
    except TwinError:
        raise
    except (OSError, ValueError, MemoryError, OverflowError, pa.ArrowException) as error:
        raise TwinError(f"{path}: cannot be read as Parquet: {reason(error)[:200]}") from error
