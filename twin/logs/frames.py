"""Drives from and to tables of Python: pandas, polars, xarray, Arrow and NumPy."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import TwinError
from twin.logs.log_time import TimeWanted
from twin.logs.parquet import METADATA_KEY, numbers_of
from twin.logs.raw_log import RawLog, check_size, log_of_table
from twin.toml_file import reason

KINDS = ("pandas", "polars", "xarray", "arrow", "numpy")
_PATH = Path("frame")  # stands in messages where a file's name does


def arrow_of(frame: Any) -> Any:
    """A frame as a table of Arrow, the index of pandas included.

    Args:
        frame: a pandas or polars DataFrame, an xarray Dataset of one dimension, a table of Arrow, a
            structured array, or a mapping of names to arrays of one length.

    Raises:
        TwinError: it is nothing of these.
    """
    import pyarrow as pa

    try:
        if isinstance(frame, pa.Table):
            return frame
        if isinstance(frame, np.ndarray):
            if frame.dtype.names:
                return pa.table({name: frame[name] for name in frame.dtype.names})
        elif hasattr(frame, "to_arrow"):  # polars
            return frame.to_arrow()
        elif hasattr(frame, "to_dataframe"):  # xarray
            return pa.Table.from_pandas(frame.to_dataframe())
        elif hasattr(frame, "iloc"):  # pandas
            return pa.Table.from_pandas(frame)
        elif isinstance(frame, Mapping):
            return pa.table({str(name): values for name, values in frame.items()})
    except (TypeError, ValueError, pa.ArrowException) as error:
        raise TwinError(f"frame: cannot be read: {reason(error)[:200]}") from error
    raise TwinError(
        f"frame: is {type(frame).__name__}; allowed: a frame of pandas or polars, a Dataset of "
        "xarray, a table of Arrow, a structured array or a dict of arrays"
    )


def log_of_frame(frame: Any, wanted: TimeWanted) -> RawLog:
    """A frame as a log of anybody.

    Raises:
        TwinError: it is no frame, or has no time.
    """
    table = arrow_of(frame)
    check_size("frame", table.num_rows * table.num_columns, "has")
    return log_of_table(_PATH, numbers_of(table), wanted)


def columns_of(frame: Any) -> tuple[dict[str, Any], str]:
    """Columns of a frame that `frame_of` made, and its metadata.

    Raises:
        TwinError: it is no frame, or a column holds no numbers.
    """
    table = arrow_of(frame)
    numbers = numbers_of(table)
    for name, kind in numbers.text.items():
        raise TwinError(f"frame: column {name} is {kind}; allowed: numbers")
    columns = {name: column.values for name, column in numbers.columns.items()}
    metadata = (table.schema.metadata or {}).get(METADATA_KEY, b"")
    if not metadata:
        metadata = str(getattr(frame, "attrs", {}).get(METADATA_KEY.decode(), "")).encode()
    return columns, metadata.decode("utf-8", "replace")


def frame_of(columns: Mapping[str, Any], metadata: str, kind: str) -> Any:
    """Columns as a frame, time its index where there is such a thing.

    Raises:
        TwinError: there is no such kind, or its library is not installed.
    """
    if kind not in KINDS:
        raise TwinError(f"frame: kind is {kind!r}; allowed: {', '.join(KINDS)}")
    if kind == "numpy":
        names = [(name, np.float64) for name in columns]
        table = np.empty(columns["time"].size, dtype=names)
        for name, values in columns.items():
            table[name] = values
        return table
    if kind == "arrow":
        import pyarrow as pa

        return pa.table(dict(columns)).replace_schema_metadata({METADATA_KEY: metadata})
    try:
        if kind == "polars":
            import polars as pl  # optional

            return pl.DataFrame({name: np.asarray(values) for name, values in columns.items()})
        import pandas as pd  # optional

        frame = pd.DataFrame({name: np.asarray(values) for name, values in columns.items()})
        frame = frame.set_index("time")
        if kind == "xarray":
            frame = frame.to_xarray()
    except ImportError as error:
        raise TwinError(f"frame: {kind} is not installed: pip install {kind}") from error
    frame.attrs[METADATA_KEY.decode()] = metadata
    return frame
