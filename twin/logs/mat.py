"""Logs as MATLAB saves them: .mat of version 5 by SciPy, of version 7.3 by h5py (extra `mat`).

Channels are vectors, columns of matrices (`imu[2]`), and fields of structs (`log.ax`). A struct
with fields of its own for time and values, as some loggers write for each channel, is a channel
with that time.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import TwinError
from twin.logs.log_time import Column, TimeWanted, find_time, is_called_time, spread
from twin.logs.raw_log import (
    Array,
    Channel,
    Numbers,
    RawLog,
    Wanted,
    check_file_size,
    check_size,
    check_time,
    log_of_table,
)
from twin.toml_file import reason

_HDF5 = b"\x89HDF\r\n\x1a\n"
_DEEPEST = 6  # structs within structs
_MOST_COLUMNS = 64  # of a matrix that become channels
_VALUES = ("value", "values", "data", "y", "signal")
_UNITS = ("units", "unit")


def read_log(path: Path, wanted: Wanted) -> RawLog:
    """A log of anybody.

    Raises:
        TwinError: the file cannot be read.
    """
    vectors, found = read_vectors(path)
    text = {name: str(value)[:40] for name, value in _flat(found, "", 0) if name not in vectors}
    own = _with_own_time(path, vectors, text)
    if own:
        return own
    return _with_shared_time(path, vectors, text, wanted.time)


def read_vectors(path: Path) -> tuple[dict[str, Array], dict[str, Any]]:
    """All vectors by dotted name, and the content of the file by the names of its variables.

    Raises:
        TwinError: the file cannot be read.
    """
    check_file_size(path)
    with path.open("rb") as file:
        head = file.read(520)
    try:
        found = _of_hdf5(path) if _HDF5 in (head[:8], head[512:520]) else _of_version_5(path)
        flat = dict(_flat(found, "", 0))
    except TwinError:
        raise
    except ImportError as error:
        raise TwinError(
            f"{path}: MATLAB 7.3 needs h5py: pip install 'twin-in-the-loop[mat]'"
        ) from error
    except Exception as error:  # of every kind: both libraries raise what their parts do
        raise TwinError(f"{path}: cannot be read as MATLAB: {reason(error)[:200]}") from error
    vectors = {name: value for name, value in flat.items() if isinstance(value, np.ndarray)}
    return vectors, found


def _of_version_5(path: Path) -> dict[str, Any]:
    from scipy import io

    sizes = [int(np.prod(shape, dtype=np.float64)) for _, shape, _ in io.whosmat(path)]
    check_size(path, sum(sizes), "declares")
    found = io.loadmat(path, squeeze_me=True, struct_as_record=False, chars_as_strings=True)
    return {name: value for name, value in found.items() if not name.startswith("__")}


def _of_hdf5(path: Path) -> dict[str, Any]:
    import h5py

    with h5py.File(path, "r") as file:
        return _group(path, file, 0)


def _group(path: Path, group: Any, declared: int) -> dict[str, Any]:
    import h5py

    content: dict[str, Any] = {}
    for name in group:
        if name.startswith("#") or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        item = group[name]
        if isinstance(item, h5py.Dataset):
            declared += int(np.prod(item.shape, dtype=np.float64))
            check_size(path, declared, "declares")
            content[name] = _dataset(item)
        elif item.name.count("/") <= _DEEPEST:
            content[name] = _group(path, item, declared)
    return content


def _dataset(item: Any) -> Any:
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if item.dtype.kind not in "biuf":
        return kind or str(item.dtype)
    if "MATLAB_empty" in item.attrs:
        return "empty"
    values = np.asarray(item[()])
    if kind == "char":
        return "".join(chr(int(code)) for code in values.ravel()[:200])
    return np.squeeze(values.T)


def _flat(content: Any, name: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Vectors and texts by dotted names."""
    fields = getattr(content, "_fieldnames", None)
    if fields is not None:
        content = {field: getattr(content, field) for field in fields}
    if isinstance(content, Mapping):
        if depth <= _DEEPEST:
            for key, value in content.items():
                yield from _flat(value, f"{name}.{key}" if name else str(key), depth + 1)
        return
    if isinstance(content, np.ndarray) and content.dtype.kind in "biuf":
        values = content.astype(np.float64)
        if values.ndim == 1:
            yield name, values
        elif values.ndim == 2 and min(values.shape) <= _MOST_COLUMNS:
            columns = values.T if values.shape[0] >= values.shape[1] else values
            for place, column in enumerate(columns):
                yield f"{name}[{place}]", column
        elif values.ndim == 0:
            yield name, f"a single number, {values}"
    elif isinstance(content, str | int | float):
        yield name, str(content)
    else:
        yield name, f"{type(content).__name__}, which is no vector of numbers"


def _with_own_time(path: Path, vectors: dict[str, Array], text: dict[str, str]) -> RawLog | None:
    """Channels that are structs of time and values; None if there are none."""
    structs: dict[str, dict[str, str]] = {}
    for name in vectors:
        parent, _, field = name.rpartition(".")
        if parent:
            structs.setdefault(parent, {})[field.lower()] = name
    channels: dict[str, Channel] = {}
    notes: dict[str, None] = {}
    for parent, fields in structs.items():
        times = [name for field, name in fields.items() if is_called_time(field)]
        values = [fields[field] for field in _VALUES if field in fields]
        if len(times) != 1 or len(values) != 1 or len(fields) > 3:
            continue
        units = {f"{parent}.{word}".lower() for word in _UNITS}
        given = next((text[name] for name in text if name.lower() in units), "")
        time = vectors[times[0]]
        if time.size != vectors[values[0]].size:
            continue
        found = find_time(path, {times[0]: Column(time)}, TimeWanted(times[0]), {})
        check_time(path, f"time of {parent[:40]!r}", found.factor * time)
        spaced, about = spread(found.factor * time)
        notes |= dict.fromkeys(about)
        channels[parent] = Channel(time=spaced, values=vectors[values[0]], unit=given)
    if not channels:
        return None
    return RawLog(path=path, channels=channels, text=text, notes=tuple(notes))


def _with_shared_time(
    path: Path, vectors: dict[str, Array], text: dict[str, str], wanted: TimeWanted
) -> RawLog:
    """Vectors of one length, time among them; those of another length are set aside."""
    longest = {values.size for values in vectors.values() if values.size > 1}
    for name in [wanted.name] if wanted.name in vectors else [n for n in vectors if _is_time(n)]:
        longest = {vectors[str(name)].size}
        break
    size = max(longest, default=0)
    columns = {}
    for name, values in vectors.items():
        if values.size == size:
            columns[name] = Column(values)
        else:
            text[name] = f"{values.size} values, where time has {size}"
    named = {name.rpartition(".")[2]: name for name in columns if _is_time(name)}
    if wanted.name is None and len(named) == 1 and not any(is_called_time(n) for n in columns):
        wanted = TimeWanted(next(iter(named.values())), wanted.unit)
    return log_of_table(path, Numbers(columns, text, {}), wanted)


def _is_time(name: str) -> bool:
    return is_called_time(name.rpartition(".")[2])


def read_columns(path: Path) -> tuple[dict[str, Any], str | None]:
    """Nothing: a drive of ours is not kept as .mat."""
    check_file_size(path)
    return {}, None


def write(path: Path, columns: dict[str, Any], metadata: str) -> None:
    """Refuses: a drive of ours is not kept as .mat."""
    raise TwinError(f"{path}: drives are not written as .mat; allowed: Parquet, CSV, MDF 4")
