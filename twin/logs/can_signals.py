"""Signals of CAN messages: what a database (DBC, ARXML, KCD, SYM) says of them, and numbers."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError
from twin.logs.raw_log import Array, check_file_size
from twin.toml_file import reason

DATABASES = (".dbc", ".arxml", ".kcd", ".sym")
_LARGEST_DATABASE = 64_000_000  # bytes; chosen: cantools takes a minute for as much


class Signal(NamedTuple):
    """Where a signal lies in a payload, and what its numbers mean.

    Attributes:
        name: of the signal.
        bits: of its value in the payload, least significant first; bit 8 b + i is bit i of byte b.
        signed: two's complement.
        real: an IEEE 754 number of 32 or 64 bits.
        scale, offset: physical value = scale * number + offset.
        selected_by: the multiplexer and its values with which the signal is there; None: always.
    """

    name: str
    bits: NDArray[np.int64]
    signed: bool
    real: bool
    scale: float
    offset: float
    selected_by: tuple[str, frozenset[int]] | None


class Message(NamedTuple):
    """A message of the database; its identifier has bit 31 set if it is extended."""

    name: str
    identifier: int
    signals: tuple[Signal, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Database:
    """The messages of a bus.

    Attributes:
        path: of the file.
        messages: by identifier.
        units: by names of message and signal; empty where there is none.
        notes: what is odd about it, in sentences.
    """

    path: Path
    messages: dict[int, Message]
    units: dict[tuple[str, str], str]
    notes: tuple[str, ...] = ()

    @classmethod
    def load(cls, path: Path) -> "Database":
        """Reads a database.

        Raises:
            TwinError: the file is missing, broken, too large, or no CAN database.
        """
        check_file_size(path)
        if path.suffix.lower() not in DATABASES:
            raise TwinError(
                f"{path}: name ends in {path.suffix!r}; allowed: {', '.join(DATABASES)}"
            )
        if path.stat().st_size > _LARGEST_DATABASE:
            raise TwinError(
                f"{path}: has {path.stat().st_size:,} bytes; allowed: {_LARGEST_DATABASE:,}"
            )
        found = _parsed(path)
        messages, units, notes = {}, {}, []
        for message in found.messages:
            identifier = message.frame_id | (1 << 31 if message.is_extended_frame else 0)
            if identifier in messages:
                notes.append(f"{path.name}: {message.name} shares its identifier; it is left out.")
                continue
            signals = tuple(_signal(path, message, signal) for signal in message.signals)
            messages[identifier] = Message(message.name, identifier, signals)
            units |= {(message.name, s.name): s.unit or "" for s in message.signals}
            if overlapping := _overlapping(signals):
                notes.append(f"{path.name}: signals overlap in {message.name}: {overlapping}.")
        if not messages:
            raise TwinError(f"{path}: has no messages")
        return cls(path=path, messages=messages, units=units, notes=tuple(notes))


def decode(
    message: Message, payload: NDArray[np.uint8], length: NDArray[np.int64]
) -> tuple[dict[str, Array], int]:
    """The signals of a message's frames.

    Args:
        message: what they are.
        payload: (N, bytes).
        length: (N,) bytes that each frame has.

    Returns:
        By signal (N,) physical values, NaN where a frame lacks it or it is no number; and how many
        frames were too short for some signal that they should carry.
    """
    bits = np.unpackbits(payload, axis=1, bitorder="little")
    raw = {signal.name: _raw(signal, bits) for signal in message.signals}
    short = np.zeros(len(payload), dtype=np.bool_)
    values: dict[str, Array] = {}
    for signal in message.signals:
        there = _selected(signal, message, raw)
        whole = length * 8 > signal.bits.max()
        short |= there & ~whole
        with np.errstate(invalid="ignore", over="ignore"):  # of payloads that are no number
            number = raw[signal.name].astype(np.float64) * signal.scale + signal.offset
        number[~(there & whole) | ~np.isfinite(number)] = np.nan
        values[signal.name] = number
    return values, int(short.sum())


def _selected(signal: Signal, message: Message, raw: dict[str, NDArray[Any]]) -> NDArray[np.bool_]:
    """In which frames the multiplexers, one inside the other, let a signal appear."""
    there = np.ones(next(iter(raw.values())).size, dtype=np.bool_)
    by_name = {s.name: s for s in message.signals}
    seen: set[str] = set()
    while signal.selected_by is not None:
        multiplexer, values = signal.selected_by
        if multiplexer not in by_name or multiplexer in seen:
            break
        seen.add(multiplexer)
        there &= np.isin(raw[multiplexer], list(values))
        signal = by_name[multiplexer]
    return there


def _raw(signal: Signal, bits: NDArray[np.uint8]) -> NDArray[Any]:
    """The numbers before scaling; zero where a frame ends before."""
    size = signal.bits.size
    number = np.zeros(len(bits), dtype=np.uint64)
    for place, bit in enumerate(signal.bits):
        if bit < bits.shape[1]:
            number |= bits[:, bit].astype(np.uint64) << np.uint64(place)
    if signal.real:
        return number.view(np.float64) if size == 64 else number.astype(np.uint32).view(np.float32)
    if signal.signed:
        return (number << np.uint64(64 - size)).view(np.int64) >> np.int64(64 - size)
    return number


def _signal(path: Path, message: Any, signal: Any) -> Signal:
    size = int(signal.length)
    if not 1 <= size <= 64 or (signal.is_float and size not in (32, 64)):
        raise TwinError(
            f"{path}: {message.name}.{signal.name} has {size} bits; allowed: 1 to 64, 32 or 64 "
            "of a real number"
        )
    if signal.byte_order == "little_endian":
        bits = signal.start + np.arange(size)
    else:
        bits = np.empty(size, dtype=np.int64)
        at = signal.start  # the most significant; numbered from 7 to 0 within each byte
        for k in range(size):
            bits[size - 1 - k] = at
            at += 15 if at % 8 == 0 else -1
    selected = None
    if signal.multiplexer_signal and signal.multiplexer_ids:
        selected = signal.multiplexer_signal, frozenset(signal.multiplexer_ids)
    return Signal(
        name=signal.name,
        bits=np.asarray(bits, dtype=np.int64),
        signed=bool(signal.is_signed),
        real=bool(signal.is_float),
        scale=float(signal.scale),
        offset=float(signal.offset),
        selected_by=selected,
    )


def _overlapping(signals: tuple[Signal, ...]) -> str:
    """Names of the first two signals that share bits and can be there at once; empty: none."""
    for i, one in enumerate(signals):
        for other in signals[:i]:
            apart = (
                one.selected_by
                and other.selected_by
                and one.selected_by[0] == other.selected_by[0]
                and not one.selected_by[1] & other.selected_by[1]
            )
            if not apart and np.isin(one.bits, other.bits).any():
                return f"{other.name}, {one.name}"
    return ""


def _parsed(path: Path) -> Any:
    try:
        import cantools
    except ImportError as error:
        raise TwinError(
            f"{path}: CAN databases need the extra can: pip install -e '.[can]' in the project"
        ) from error
    try:
        found = cantools.database.load_file(path, strict=False)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise TwinError(f"{path}: cannot be read: {reason(error)[:200]}") from error
    except Exception as error:  # cantools' parsers have errors of their own, of no common root
        if type(error).__module__.split(".")[0] not in ("cantools", "textparser", "xml", "lxml"):
            raise
        raise TwinError(f"{path}: cannot be read: {reason(error)[:200]}") from error
    if not hasattr(found, "messages"):
        raise TwinError(f"{path}: is no CAN database; allowed: DBC, ARXML, KCD, SYM")
    return found
