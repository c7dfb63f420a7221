"""Raw CAN logs, by python-can and cantools (extra `can`): frames become the signals of a database.

Channels are called `Message.signal`. Frames that the database does not know, that are too short,
or that carry no data are counted, never guessed.
"""

import re
from collections.abc import Iterable, Iterator, Set
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError
from twin.logs.can_signals import Database, decode
from twin.logs.raw_log import (
    Array,
    Channel,
    RawLog,
    Wanted,
    check_file_size,
    check_size,
    listed,
)
from twin.toml_file import reason

FORMATS = (".blf", ".asc", ".log", ".trc", ".csv", ".mf4")  # of python-can
_BINARY = (".blf", ".mf4")
_ALWAYS = (".blf", ".asc", ".trc")  # the others may be tables of numbers
_BEGINNINGS = {
    ".log": re.compile(r"\(\d+\.\d+\) +\S+ +[0-9A-Fa-f]{3,8}#"),
    ".csv": re.compile("timestamp,arbitration_id,"),
}
_LARGEST_PAYLOAD = 64  # bytes, CAN FD
_MOST_FRAMES = 20_000_000  # chosen: three hours of a busy bus; 1.6 GB would be the payload alone
_BLOCK = 100_000  # frames that are read at once


class Frames(NamedTuple):
    """The frames of one message, in the order of time.

    Attributes:
        time: (N,) [s].
        payload: (N, bytes) zero behind the end of a frame.
        length: (N,) bytes.
    """

    time: Array
    payload: NDArray[np.uint8]
    length: NDArray[np.int64]


class Bus(NamedTuple):
    """What a log holds: frames by identifier, and how many were of another kind.

    Attributes:
        frames: by identifier; that of an extended frame has bit 31 set.
        without_data: error and remote frames.
        start: time of the first frame [s], as the log counts it.
    """

    frames: dict[int, Frames]
    without_data: int
    start: float


def read_log(path: Path, wanted: Wanted) -> RawLog:
    """A raw log of a bus as its signals' channels; its time starts at the first frame.

    Args:
        path: in a format of `FORMATS`.
        wanted: names the database; signals that are not mapped are not decoded.

    Raises:
        TwinError: the log or the database cannot be read, or no frame is known to the database.
    """
    if wanted.database is None:
        raise TwinError(f"{path}: is a raw CAN log; allowed: with a database, [can] in the map")
    database = Database.load(wanted.database)
    bus = read_bus(path)
    channels, short = decoded(bus, database, wanted.names)
    if not channels:
        raise TwinError(
            f"{path}: no signal of {wanted.database} that is wanted is in it twice; it has frames "
            f"{listed([f'{i & 0x7FFFFFFF:#x}' for i in bus.frames])}"
        )
    notes = [*database.notes]
    notes += [f"{name}: {count} frames are too short and left out." for name, count in short]
    unknown = {i: f.time.size for i, f in bus.frames.items() if i not in database.messages}
    if unknown:
        shown = listed([f"{i & 0x7FFFFFFF:#x}" for i in unknown])
        notes.append(f"{sum(unknown.values())} frames are not in the database: {shown}.")
    if bus.without_data:
        notes.append(f"{bus.without_data} error and remote frames are left out.")
    return RawLog(path=path, channels=channels, notes=tuple(notes))


def decoded(
    bus: Bus, database: Database, wanted: Set[str] = frozenset()
) -> tuple[dict[str, Channel], list[tuple[str, int]]]:
    """The signals of a bus that occur at least twice.

    Args:
        bus: its frames.
        database: what they mean.
        wanted: names of signals, `Message.signal`; messages without any are left out. Empty: all.

    Returns:
        Channels by name, and by message how many frames were too short for a signal.
    """
    channels: dict[str, Channel] = {}
    too_short: list[tuple[str, int]] = []
    for identifier, frames in bus.frames.items():
        message = database.messages.get(identifier)
        if message is None:
            continue
        names = {f"{message.name}.{signal.name}" for signal in message.signals}
        if wanted and not names & wanted:
            continue
        found, short = decode(message, frames.payload, frames.length)
        if short:
            too_short.append((message.name, short))
        for signal, values in found.items():
            there = np.isfinite(values)
            if there.sum() < 2:
                continue
            name, unit = f"{message.name}.{signal}", database.units[message.name, signal]
            channels[name] = Channel(time=frames.time[there], values=values[there], unit=unit)
    return channels, too_short


def is_bus_log(path: Path) -> bool:
    """Whether a file is a raw CAN log: by its name's ending, of text by what it begins with."""
    kind = path.suffix.lower()
    if kind in _ALWAYS:
        return True
    if kind not in _BEGINNINGS:
        return False
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            return _BEGINNINGS[kind].match(file.read(200)) is not None
    except OSError:  # whoever reads it says so
        return False


def read_bus(path: Path) -> Bus:
    """All frames of a log, by identifier.

    Raises:
        TwinError: the file cannot be read, holds no frame, or too many.
    """
    check_file_size(path)
    if path.suffix.lower() not in FORMATS:
        raise TwinError(f"{path}: name ends in {path.suffix!r}; allowed: {', '.join(FORMATS)}")
    parts: dict[int, list[tuple[Array, NDArray[np.uint8], NDArray[np.int64]]]] = {}
    without_data, count, start = 0, 0, np.inf
    for block in _blocks(_messages(path)):
        count += len(block)
        if count > _MOST_FRAMES:
            raise TwinError(f"{path}: has more than {_MOST_FRAMES:,} frames; allowed: fewer")
        data = [m for m in block if not (m.is_error_frame or m.is_remote_frame)]
        without_data += len(block) - len(data)
        for identifier, frames in _by_identifier(data).items():
            parts.setdefault(identifier, []).append(frames)
            start = min(start, float(frames[0].min()))
    if not parts:
        raise TwinError(f"{path}: has no CAN frames")
    frames = {identifier: _joined(path, found, start) for identifier, found in parts.items()}
    return Bus(frames, without_data, start)


def _messages(path: Path) -> Iterator[Any]:
    """The frames of a log as python-can reads them."""
    try:
        import can
    except ImportError as error:
        raise TwinError(
            f"{path}: raw CAN logs need the extra can: pip install -e '.[can]' in the project"
        ) from error
    kind = path.suffix.lower()
    # opened here, as python-can's readers leave a broken file open
    text = partial(path.open, encoding="utf-8", errors="replace")
    opened = partial(path.open, "rb") if kind in _BINARY else text
    make: Any = can.io.player.MESSAGE_READERS[kind]
    try:
        with opened() as file, make(file) as reader:
            yield from reader
    except Exception as error:  # readers raise whatever their parsers do
        if isinstance(error, TwinError):
            raise
        raise TwinError(f"{path}: cannot be read as CAN log: {reason(error)[:200]}") from error


def _blocks(messages: Iterable[Any]) -> Iterator[list[Any]]:
    iterator = iter(messages)
    while block := list(islice(iterator, _BLOCK)):
        yield block


def _by_identifier(
    messages: list[Any],
) -> dict[int, tuple[Array, NDArray[np.uint8], NDArray[np.int64]]]:
    """Times, payloads and lengths of a block's frames."""
    rows: dict[int, list[Any]] = {}
    for message in messages:
        key = message.arbitration_id | (1 << 31 if message.is_extended_id else 0)
        rows.setdefault(key, []).append(message)
    found = {}
    for key, of_one in rows.items():
        time = np.array([m.timestamp for m in of_one], dtype=np.float64)
        length = np.array([min(len(m.data), _LARGEST_PAYLOAD) for m in of_one])
        payload = np.zeros((len(of_one), int(length.max(initial=1)) or 1), dtype=np.uint8)
        for row, m in zip(payload, of_one, strict=True):
            data = bytes(m.data[:_LARGEST_PAYLOAD])
            row[: len(data)] = np.frombuffer(data, dtype=np.uint8)
        found[key] = time, payload, length
    return found


def _joined(
    path: Path, parts: list[tuple[Array, NDArray[np.uint8], NDArray[np.int64]]], start: float
) -> Frames:
    """The blocks of one message as one, sorted by time: gateways write frames out of order."""
    width = max(payload.shape[1] for _, payload, _ in parts)
    total = sum(time.size for time, _, _ in parts)
    check_size(path, total * width // 8, "needs")
    payload = np.zeros((total, width), dtype=np.uint8)
    row = 0
    for time, block, _ in parts:
        payload[row : row + time.size, : block.shape[1]] = block
        row += time.size
    time = np.concatenate([time for time, _, _ in parts]) - start
    length = np.concatenate([length for _, _, length in parts])
    order = np.argsort(time, kind="stable")
    finite = order[np.isfinite(time[order])]
    return Frames(time[finite], payload[finite], length[finite])
