"""A running observer in a file: everything that decides what it will estimate next."""

import hashlib
import io
import os
import struct
import uuid
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimators.til.observer import Observer
from twin import Snapshot, Twin, TwinError

Array = NDArray[np.float64]
FORMAT = "observer 2"
_TWIN, _MEMORY, _MORE = "twin.", "memory.", "more."
_DIGEST = "sha256"  # of all other arrays: what is not as it was written is not believed
_LARGEST = 64 << 20  # bytes of a snapshot, unpacked; a car's has some 20 kB
_MOST = 200  # arrays of one
# What reading a damaged archive or the head of an array ends in
_BROKEN = (
    OSError, ValueError, EOFError, KeyError, AttributeError, TypeError, SyntaxError, RuntimeError,
    OverflowError, MemoryError, RecursionError, zipfile.BadZipFile, zlib.error, struct.error,
)  # fmt: skip


def save_snapshot(path: str | Path, observer: Observer, more: Mapping[str, Array]) -> None:
    """Writes an observer's state, whole or not at all.

    Args:
        path: the file.
        observer: of a `twin.Twin`.
        more: what its user wants to find again.

    Raises:
        TwinError: the observer's black box is another's, or the file cannot be written.
    """
    path = Path(path)
    arrays: dict[str, Any] = {"fingerprint": np.array(_fingerprint(observer))}
    arrays |= {_TWIN + k: v for k, v in _twin(observer).snapshot()._asdict().items()}
    arrays |= {_MEMORY + k: v for k, v in observer.memory._asdict().items()}
    arrays |= {_MORE + k: np.asarray(v) for k, v in more.items()}
    arrays[_DIGEST] = np.array(_digest(arrays))
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        with partial.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError as error:
        raise TwinError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        partial.unlink(missing_ok=True)


def load_snapshot(
    path: str | Path, observer: Observer, more: Mapping[str, Array]
) -> dict[str, Array]:
    """Puts an observer where the saved one was, whole or not at all.

    Args:
        path: the file.
        observer: of the same vehicle, laws and gains.
        more: arrays like those that `save_snapshot` got, for their shapes.

    Returns:
        What `save_snapshot` got as `more`.

    Raises:
        TwinError: the file is missing or broken, or of another vehicle or observer.
    """
    path = Path(path)
    arrays = _read(path)
    if str(arrays.pop("fingerprint", "")) != _fingerprint(observer):
        raise TwinError(
            f"{path}: is the snapshot of another vehicle or observer; allowed: one of the same "
            "car, laws and gains"
        )
    twin, memory = _twin(observer), observer.memory._asdict()
    wanted = {_TWIN + k: v for k, v in twin.snapshot()._asdict().items()}
    wanted |= {_MEMORY + k: v for k, v in memory.items()}
    wanted |= {_MORE + k: v for k, v in more.items()}
    for name, like in wanted.items():
        _check(path, name, arrays.get(name), np.asarray(like))
    twin.restore(Snapshot(**{name: arrays[_TWIN + name] for name in Snapshot._fields}))
    for name, values in memory.items():
        values[...] = arrays[_MEMORY + name]
    return {name: arrays[_MORE + name] for name in more}


def _check(path: Path, name: str, found: Array | None, like: Array) -> None:
    """Refuses what compiled code could not take: another shape or type."""
    if found is None:
        raise TwinError(f"{path}: is broken: has no array {name!r}")
    if found.shape != like.shape or found.dtype != like.dtype:
        raise TwinError(
            f"{path}: is broken: {name} is {found.dtype} of shape {found.shape}; allowed: "
            f"{like.dtype} of {like.shape}"
        )


def _read(path: Path) -> dict[str, Array]:
    """The arrays of a file, each of the size that its head says, as they were written."""
    try:
        if not path.is_file():
            raise FileNotFoundError
        with zipfile.ZipFile(path) as file:
            members = file.infolist()
            if len(members) > _MOST or sum(member.file_size for member in members) > _LARGEST:
                raise ValueError("it is larger than any snapshot")
            arrays = {m.filename.removesuffix(".npy"): _array(file.read(m)) for m in members}
    except FileNotFoundError:
        raise TwinError(f"{path}: no such snapshot") from None
    except _BROKEN as error:
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise TwinError(f"{path}: is no snapshot of an observer, or broken: {reason}") from None
    if str(arrays.pop(_DIGEST, "")) != _digest(arrays):
        raise TwinError(f"{path}: is no snapshot of an observer, or not as it was written")
    return arrays


def _array(data: bytes) -> Array:
    """An array in NumPy's format, whose head claims no more than there is."""
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    if version != (1, 0):
        raise ValueError(f"an array has format {version}; allowed: (1, 0)")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    size = int(np.prod(shape, dtype=object)) * dtype.itemsize
    if dtype.hasobject or fortran or size != len(data) - stream.tell():
        raise ValueError("an array is not as long as its head says")
    return np.frombuffer(data, dtype, offset=stream.tell()).reshape(shape).copy()


def _digest(arrays: Mapping[str, Array]) -> str:
    content = hashlib.sha256()
    for name in sorted(arrays):
        values = np.ascontiguousarray(arrays[name])
        content.update(f"{name} {values.dtype.str} {values.shape};".encode())
        content.update(values.tobytes())
    return content.hexdigest()


def _twin(observer: Observer) -> Twin:
    if not isinstance(observer.twin, Twin):
        raise TwinError("snapshot: the black box is no Twin; allowed: a Twin of a vehicle")
    return observer.twin


def _fingerprint(observer: Observer) -> str:
    content = hashlib.sha256(f"{FORMAT} {_twin(observer).fingerprint()}".encode())
    content.update(observer.settings())
    return content.hexdigest()
