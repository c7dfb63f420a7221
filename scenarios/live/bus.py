"""A python-can bus that comes back: errors are said, and the bus is opened again."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from twin import TwinError
from twin.toml_file import reason

EXTENDED = 1 << 31
_WAIT = 1.0  # [s] before a bus is opened again; chosen


def options_of(texts: Sequence[str]) -> dict[str, Any]:
    """Further arguments of python-can's bus, from NAME=VALUE.

    Raises:
        TwinError: a text has no = in it.
    """
    found: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise TwinError(f"--bus-option is {text[:40]!r}; allowed: NAME=VALUE")
        found[name] = int(value) if value.lstrip("-").isdigit() else value
    return found


class Bus:
    """A bus of python-can.

    Attributes:
        faults: errors of receiving and sending.
        unsent: frames that could not be sent.
    """

    def __init__(
        self,
        interface: str,
        channel: str,
        options: Mapping[str, Any],
        say: Callable[[str], object],
        identifiers: Sequence[int] = (),
    ) -> None:
        """Args: identifiers: that are received; none: all.

        Raises:
            TwinError: python-can is missing, or the bus cannot be opened.
        """
        try:
            import can  # an extra
        except ImportError as error:
            raise TwinError(
                "a CAN bus needs the extra can: pip install -e '.[can]' in the project"
            ) from error
        self._can, self._say = can, say
        self._arguments = {"interface": interface, "channel": channel, **options}
        self._filters = [
            {
                "can_id": identifier & ~EXTENDED,
                "can_mask": 0x1FFFFFFF if identifier & EXTENDED else 0x7FF,
                "extended": bool(identifier & EXTENDED),
            }
            for identifier in identifiers
        ]
        self.faults = self.unsent = 0
        self._retry = 0.0
        self._off = False
        self._bus: Any = None  # while it is off
        try:
            self._open()
        except Exception as error:  # whatever the interface's library raises
            raise TwinError(
                f"bus {interface} {channel}: cannot be opened: {reason(error)[:200]}"
            ) from error

    def _open(self) -> None:
        self._bus = self._can.Bus(**self._arguments)
        if self._filters:
            self._bus.set_filters(self._filters)

    def receive(self, timeout: float) -> Any | None:
        """The next frame, or None if there is none within a time [s] or the bus is off."""
        if self._bus is None and not self._again(timeout):
            return None
        bus: Any = self._bus
        try:
            return bus.recv(timeout)
        except self._can.CanError as error:
            self._lost(error)
        except Exception as error:  # of datagrams that are no frames
            self.faults += 1
            if self.faults == 1:
                self._say(f"the bus has what is no frame: {reason(error)[:100]}")
        return None

    def send(self, identifier: int, data: bytes) -> bool:
        """Sends a frame; one that cannot be sent is counted."""
        frame = self._can.Message(
            arbitration_id=identifier & ~EXTENDED,
            is_extended_id=bool(identifier & EXTENDED),
            data=data,
            is_fd=len(data) > 8,
        )
        return self.send_frame(frame)

    def send_frame(self, frame: Any) -> bool:
        """The same of a frame of python-can."""
        if self._bus is not None:
            try:
                self._bus.send(frame)
                return True
            except self._can.CanError as error:
                if self.unsent == 0:
                    self._say(f"frames cannot be sent: {reason(error)[:100]}")
            except (OSError, ValueError) as error:
                self._lost(error)
        self.unsent += 1
        return False

    def close(self) -> None:
        """Lets the bus go."""
        if self._bus is not None:
            self._bus.shutdown()
            self._bus = None

    def _lost(self, error: Exception) -> None:
        self.faults += 1
        if not self._off:
            self._say(f"the bus is off: {reason(error)[:100]}; it is opened again until it is back")
        self._off = True
        self._shut()
        self._retry = time.monotonic() + _WAIT

    def _shut(self) -> None:
        try:
            self.close()
        except Exception as error:  # of a bus that is broken already
            self._bus = None
            self._say(f"the bus could not be closed: {reason(error)[:100]}")

    def _again(self, timeout: float) -> bool:
        """Opens the bus again, if it is time to; whether it is open."""
        wait = self._retry - time.monotonic()
        if wait > 0.0:
            time.sleep(min(wait, timeout))
            return False
        try:
            self._open()
        except Exception:  # said when it went off
            self._bus = None
            self.faults += 1
            self._retry = time.monotonic() + _WAIT
            return False
        self._off = False
        self._say("the bus is back")
        return True
