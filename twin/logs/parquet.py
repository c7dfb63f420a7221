"""Logs and drives in Parquet."""

import json
from pathlib import Path
from typing import Any

from twin.errors import TwinError
from twin.logs.arrow_columns import cleaned
from twin.logs.raw_log import (
    Array,
    Numbers,
    RawLog,
    Wanted,
    check_file_size,
    check_size,
    log_of_table,
)
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


def read_log(path: Path, wanted: Wanted) -> RawLog:
    """A log of anybody: time is a column called so, the index of a pandas table or a timestamp.

    A column's unit is that of its field's metadata `unit`, where there is one.

    Raises:
        TwinError: the file cannot be read.
    """
    import pyarrow as pa

    table = _table(path)
    try:
        numbers = numbers_of(table)
    except (ValueError, pa.ArrowException) as error:
        raise TwinError(f"{path}: cannot be read as Parquet: {reason(error)[:200]}") from error
    return log_of_table(path, numbers, wanted.time)


def numbers_of(table: Any) -> Numbers:
    """The columns of an Arrow table, cleaned; units and index as its metadata declare them."""
    index = _index_names(table.schema.metadata or {})
    names = list(table.column_names)
    repeated = tuple(sorted({name for name in names if names.count(name) > 1}))
    columns, text, bad = {}, {}, {}
    for place, field in enumerate(table.schema):
        name = field.name
        while name in columns or name in text:
            name += " (2)"
        found = cleaned(table.column(place))
        unit = (field.metadata or {}).get(b"unit", b"").decode("utf-8", "replace")
        if found.column is None:
            text[name] = found.text
        else:
            columns[name] = found.column._replace(unit=unit, is_index=field.name in index)
        if found.bad is not None:
            bad[name] = found.bad
    return Numbers(columns, text, bad, repeated)


def _index_names(metadata: dict[bytes, bytes]) -> tuple[str, ...]:
    """Names of the columns that pandas says are the table's index."""
    try:
        declared = json.loads(metadata.get(b"pandas", b"{}"))["index_columns"]
        return tuple(name for name in declared if isinstance(name, str))
    except (ValueError, KeyError, TypeError, RecursionError):
        return ()


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
            # text may unpack to much more than the file says: each entry once, and codes
            words = [f.name for f in declared.schema_arrow if str(f.type).endswith("string")]
            return pq.ParquetFile(
                file, page_checksum_verification=True, read_dictionary=words
            ).read()
    except TwinError:
        raise
    except (OSError, ValueError, MemoryError, OverflowError, pa.ArrowException) as error:
        raise TwinError(f"{path}: cannot be read as Parquet: {reason(error)[:200]}") from error
