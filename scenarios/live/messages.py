"""Estimates as CAN messages, by `models/can/estimates.dbc`."""

import math
from collections.abc import Collection, Mapping
from typing import Any

import models
from twin import TwinError

DATABASE = models.path("can/estimates.dbc")


class EstimateMessages:
    """Encodes estimates; what is not finite or not known is sent as 0 with its valid bit at 0."""

    def __init__(self, taken: Collection[int] = ()) -> None:
        """Args: taken: identifiers of the car's own messages.

        Raises:
            TwinError: one of them is one of ours.
        """
        import cantools  # an extra

        self._messages: Any = cantools.database.load_file(str(DATABASE)).messages  # pyright: ignore[reportAttributeAccessIssue]
        self._counter = 0
        for message in self._messages:
            if message.frame_id in taken:
                raise TwinError(
                    f"{DATABASE.name}: {message.name} has identifier {message.frame_id:#x}, as a "
                    "message of the car's own bus; allowed: send on another bus"
                )

    def encoded(self, estimate: Mapping[str, Any]) -> list[tuple[int, bytes]]:
        """Identifier and payload of each message.

        Args:
            estimate: of `scenarios.live.estimator`.
        """
        self._counter = (self._counter + 1) % 16
        values = {**estimate, "counter": self._counter}
        return [
            (m.frame_id, bytes(m.encode({s.name: _within(s, values) for s in m.signals})))
            for m in self._messages
        ]


def _within(signal: Any, values: Mapping[str, Any]) -> float:
    """A signal's value, within what it can carry."""
    value = values.get(signal.name)
    if not isinstance(value, bool | int | float) or not math.isfinite(value):
        return 0.0
    return min(max(float(value), float(signal.minimum or 0.0)), float(signal.maximum or 0.0)) if (
        signal.length > 1
    ) else float(bool(value))  # fmt: skip
