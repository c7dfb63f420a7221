"""Histories as a table of pandas, a file or a picture."""

import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin import TwinError

Array = NDArray[np.float64]
_SIGMAS = 2.0  # half width of a band


class Curve(NamedTuple):
    """A history to be drawn: (N,) values and, where they are known, standard deviations."""

    label: str
    values: Array
    sd: Array | None


def frame_of(columns: Mapping[str, NDArray[Any]]) -> Any:
    """A DataFrame of pandas with the column time as its index.

    Raises:
        TwinError: pandas is not installed.
    """
    try:
        import pandas as pd  # not at the top: it is optional
    except ImportError:
        raise TwinError("to_frame: needs pandas; allowed: pip install pandas") from None
    return pd.DataFrame(dict(columns)).set_index("time")


def save_columns(columns: Mapping[str, NDArray[Any]], path: str | Path) -> None:
    """Writes columns of (N,) as Parquet or CSV, by the name's ending, whole or not at all.

    Raises:
        TwinError: the ending is unknown, or the file cannot be written.
    """
    import pyarrow as pa  # not at the top: it is slow to import
    import pyarrow.csv as pv
    import pyarrow.parquet as pq

    path = Path(path)
    writers = {".parquet": pq.write_table, ".csv": pv.write_csv}
    if path.suffix not in writers:
        raise TwinError(f"{path}: ends in {path.suffix!r}; allowed: {', '.join(writers)}")
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        writers[path.suffix](pa.table(dict(columns)), str(partial))
        partial.replace(path)
    except OSError as error:
        raise TwinError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        partial.unlink(missing_ok=True)


def plot_curves(time: Array, curves: Sequence[Curve], trusted: NDArray[np.bool_] | None) -> Any:
    """A figure of matplotlib, one axis for each curve, bands of two standard deviations.

    Args:
        time: (N,) [s].
        curves: at least one.
        trusted: (N,) where the estimate is trustworthy; grey elsewhere. None: not assessed.

    Raises:
        TwinError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise TwinError("plot: needs matplotlib; allowed: pip install -e '.[plots]'") from None
    sheet = Figure(figsize=(8.0, 1.0 + 2.2 * len(curves)), layout="constrained")
    axes = np.atleast_1d(sheet.subplots(len(curves), 1, sharex=True))
    for axis, curve in zip(axes, curves, strict=True):
        (line,) = axis.plot(time, curve.values, lw=1.2)
        if curve.sd is not None:
            low, high = (curve.values + sign * _SIGMAS * curve.sd for sign in (-1.0, 1.0))
            axis.fill_between(time, low, high, color=line.get_color(), alpha=0.2, lw=0)
        if trusted is not None:
            axis.fill_between(
                time, 0.0, 1.0, where=(~trusted).tolist(), transform=axis.get_xaxis_transform(),
                color="0.5", alpha=0.15, lw=0,
            )  # fmt: skip
        axis.set_ylabel(curve.label)
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("time [s]")
    return sheet
