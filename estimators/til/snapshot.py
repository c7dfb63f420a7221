"""A running observer in a file: everything that decides what it will estimate next."""

import hashlib
import os
import uuid
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimators.til.observer import Observer
from twin import Snapshot, Twin, TwinError

Array = NDArray[np.float64]
FORMAT = "observer 1"
_TWIN, _MEMORY, _MORE = "twin.", "memory.", "more."


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


def load_snapshot(path: str | Path, observer: Observer) -> dict[str, Array]:
    """Puts an observer where the saved one was, whole or not at all.

    Returns:
        What `save_snapshot` got as `more`.

    Raises:
        TwinError: the file is missing or broken, or of another vehicle or observer.
    """
    path = Path(path)
    arrays = _read(path)
    if str(arrays.get("fingerprint")) != _fingerprint(observer):
        raise TwinError(
            f"{path}: is the snapshot of another vehicle or observer; allowed: one of the same "
            "car, laws and gains"
        )
    memory = observer.memory._asdict()
    try:
        twin = Snapshot(**{name: arrays[_TWIN + name] for name in Snapshot._fields})
        saved = {name: arrays[_MEMORY + name] for name in memory}
        shapes = [(saved[name].shape, memory[name].shape) for name in memory]
        if any(a != b for a, b in shapes):
            raise TwinError(f"{path}: is broken: an array has another shape than it should")
    except KeyError as error:
        raise TwinError(f"{path}: is broken: has no array {error}") from None
    _twin(observer).restore(twin)
    for name, values in saved.items():
        memory[name][...] = values
    return {k.removeprefix(_MORE): v for k, v in arrays.items() if k.startswith(_MORE)}


def _read(path: Path) -> dict[str, Array]:
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except FileNotFoundError:
        raise TwinError(f"{path}: no such snapshot") from None
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, KeyError, AttributeError) as error:
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise TwinError(f"{path}: is no snapshot of an observer, or broken: {reason}") from None


def _twin(observer: Observer) -> Twin:
    if not isinstance(observer.twin, Twin):
        raise TwinError("snapshot: the black box is no Twin; allowed: a Twin of a vehicle")
    return observer.twin


def _fingerprint(observer: Observer) -> str:
    content = hashlib.sha256(f"{FORMAT} {_twin(observer).fingerprint()}".encode())
    content.update(observer.settings())
    return content.hexdigest()
