"""One frame as it comes: the signals of its payload, by integers instead of arrays.

`twin.logs.can_signals.decode` does the same for the many frames of a log.
"""

import math
import struct
from itertools import pairwise
from typing import NamedTuple

from twin.logs.can_signals import Message, Signal

_LARGEST_PAYLOAD = 64  # bytes, CAN FD


class _Place(NamedTuple):
    """Where a signal lies, as a shift of the payload read as one integer."""

    signal: Signal
    little: bool  # whether the payload is read with its first byte least significant
    shift: int  # bits; of a big-endian signal counted from the end of the first `size` bytes
    size: int  # bytes that the frame must have
    mask: int


class FrameDecoder:
    """Decodes the frames of one message."""

    def __init__(self, message: Message) -> None:
        self.message = message
        self._places = [_place(signal) for signal in message.signals]
        self._by_name = {place.signal.name: place for place in self._places}

    def decode(self, payload: bytes) -> tuple[dict[str, float], bool]:
        """The signals that a frame carries.

        Args:
            payload: of any length.

        Returns:
            Finite physical values by the signal's name; and whether the frame is too short for a
            signal that it should carry.
        """
        payload = payload[:_LARGEST_PAYLOAD]
        little = int.from_bytes(payload, "little")
        found: dict[str, float] = {}
        short = False
        for place in self._places:
            if place.signal.selected_by is not None and not self._selected(place, payload, little):
                continue
            if len(payload) < place.size:
                short = True
                continue
            value = _number(place, payload, little) * place.signal.scale + place.signal.offset
            if math.isfinite(value):
                found[place.signal.name] = value
        return found, short

    def _selected(self, place: _Place, payload: bytes, little: int) -> bool:
        """Whether the multiplexers, one inside the other, let a signal appear."""
        seen: set[str] = set()
        while place.signal.selected_by is not None:
            name, values = place.signal.selected_by
            if name not in self._by_name or name in seen:
                return True
            seen.add(name)
            place = self._by_name[name]
            padded = payload.ljust(place.size, b"\0")
            if _number(place, padded, int.from_bytes(padded, "little")) not in values:
                return False
        return True


def _place(signal: Signal) -> _Place:
    bits = [int(bit) for bit in signal.bits]
    size = max(bits) // 8 + 1
    mask = (1 << len(bits)) - 1
    if all(b - a == 1 for a, b in pairwise(bits)):
        return _Place(signal, True, bits[0], size, mask)
    last = bits[0]
    return _Place(signal, False, 8 * (size - 1 - last // 8) + last % 8, size, mask)


def _number(place: _Place, payload: bytes, little: int) -> float:
    """The number before scaling."""
    whole = little if place.little else int.from_bytes(payload[: place.size], "big")
    number = (whole >> place.shift) & place.mask
    signal, size = place.signal, place.mask.bit_length()
    if signal.real:
        kind = "<d" if size == 64 else "<f"
        return struct.unpack(kind, number.to_bytes(size // 8, "little"))[0]
    if signal.signed and number >> (size - 1):
        return number - (1 << size)
    return number
