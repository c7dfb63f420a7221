"""Columns of Arrow as numbers: decimal commas, timestamps, durations, cells that are none."""

import json
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.logs.log_time import Column, text_as_seconds
from twin.logs.text_table import MISSING, number_of

_NUMBER = r"^[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?$"
_TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_DAY = 86400.0


class Cleaned(NamedTuple):
    """What became of a column.

    Attributes:
        column: its numbers; None if it is none.
        text: kind or first entry of a column that is none.
        bad: (N,) cells that were text in a column of numbers; None if there are none.
    """

    column: Column | None
    text: str = ""
    bad: NDArray[np.bool_] | None = None


def cleaned(column: Any, *, commas: bool = True) -> Cleaned:
    """An Arrow column as numbers, NaN where nothing is.

    Args:
        column: of any type.
        commas: whether a comma in text is a decimal one.
    """
    import pyarrow as pa

    kind = column.type
    if pa.types.is_dictionary(kind):
        return _of_dictionary(column, commas)
    if pa.types.is_timestamp(kind):
        return Cleaned(Column(_TICKS[kind.unit] * _floats(column), declares="a timestamp"))
    if pa.types.is_duration(kind):
        return Cleaned(Column(_TICKS[kind.unit] * _floats(column), declares="a duration"))
    if pa.types.is_time(kind):
        seconds = _TICKS[kind.unit] * _floats(column)
        return Cleaned(Column(_past_midnight(seconds), declares="a clock"))
    if pa.types.is_boolean(kind):
        return Cleaned(Column(_floats(column.cast(pa.int8()))))
    numeric = (pa.types.is_integer, pa.types.is_floating, pa.types.is_null, pa.types.is_decimal)
    if any(is_kind(kind) for is_kind in numeric):
        return Cleaned(Column(_floats(column)))
    if _is_text(kind):
        return _of_text(column, commas)
    return Cleaned(None, str(kind)[:40])


def _of_dictionary(column: Any, commas: bool) -> Cleaned:
    """The numbers behind the codes of a column that holds each entry once."""
    codes = column.unify_dictionaries().combine_chunks() if hasattr(column, "chunks") else column
    found = cleaned(codes.dictionary, commas=commas)
    if found.column is None:
        return found
    indices = _floats(codes.indices)
    there = np.isfinite(indices)
    place = np.where(there, indices, 0).astype(np.int64)
    size = len(codes.dictionary)
    values = np.where(there, found.column.values[place] if size else np.nan, np.nan)
    if found.column.declares == "a clock":
        values = _past_midnight(values)
    bad = None if found.bad is None else there & found.bad[place]
    return Cleaned(found.column._replace(values=values), bad=bad)


def _is_text(kind: Any) -> bool:
    import pyarrow as pa

    views = getattr(pa.types, "is_string_view", lambda _: False)
    return pa.types.is_string(kind) or pa.types.is_large_string(kind) or views(kind)


def _floats(column: Any) -> NDArray[np.float64]:
    import pyarrow as pa

    if pa.types.is_temporal(column.type):
        column = column.cast(pa.int32() if column.type.bit_width == 32 else pa.int64())
    if column.type != pa.float64():
        column = column.cast(pa.float64(), safe=False)
    return column.to_numpy()


def _of_text(column: Any, commas: bool) -> Cleaned:
    import pyarrow as pa

    pc = _compute()
    trimmed = pc.utf8_trim_whitespace(column.cast(pa.string()))
    missing = pc.is_in(pc.utf8_lower(trimmed), pa.array(sorted(MISSING)))
    missing = pc.or_(pc.is_null(trimmed), missing)
    is_number = pc.fill_null(pc.match_substring_regex(trimmed, _NUMBER), False)
    has_comma = pc.and_(is_number, pc.fill_null(pc.match_substring(trimmed, ","), False))
    any_comma = bool(pc.any(has_comma).as_py())
    if any_comma and not commas:
        is_number = pc.and_(is_number, pc.invert(has_comma))
    bad = pc.and_(pc.invert(is_number), pc.invert(missing))
    n_numbers, n_bad = (int(pc.sum(mask).as_py() or 0) for mask in (is_number, bad))
    if n_numbers <= n_bad or n_numbers == 0:
        return _times_or_text(trimmed, missing)
    if any_comma and commas:
        has_point = pc.and_(is_number, pc.fill_null(pc.match_substring(trimmed, "."), False))
        if bool(pc.any(has_point).as_py()):
            return Cleaned(None, "mixed decimal points and commas")
        trimmed = pc.replace_substring(trimmed, ",", ".")
    kept = pc.if_else(is_number, trimmed, pa.scalar(None, pa.string()))
    values = _floats(pc.cast(kept, pa.float64()))
    return Cleaned(Column(values), bad=_mask(bad) if n_bad else None)


def _times_or_text(trimmed: Any, missing: Any) -> Cleaned:
    pc = _compute()
    there = trimmed.filter(pc.invert(missing))
    first = [str(there[i].as_py()) for i in range(min(len(there), 20))]
    if first and text_as_seconds(first) is not None:
        found = text_as_seconds([cell or "" for cell in trimmed.to_pylist()])
        if found is not None:
            seconds, declares = found
            bad = ~np.isfinite(seconds) & ~_mask(missing)
            return Cleaned(Column(seconds, declares=declares), bad=bad if bad.any() else None)
    texts = [cell for cell in first if number_of(cell) is None] or first
    return Cleaned(None, json.dumps(texts[0][:20], ensure_ascii=False) if texts else "empty")


def _compute() -> Any:
    import pyarrow.compute  # its functions are made at run time: a type checker knows none

    return pyarrow.compute


def _mask(values: Any) -> NDArray[np.bool_]:
    return np.asarray(values.to_numpy(zero_copy_only=False)).astype(np.bool_)


def _past_midnight(seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    """A clock that goes on behind midnight."""
    good = np.flatnonzero(np.isfinite(seconds))
    for place in np.flatnonzero(np.diff(seconds[good]) < -0.5 * _DAY) + 1:
        seconds = seconds.copy()
        seconds[good[place] :] += _DAY
    return seconds
