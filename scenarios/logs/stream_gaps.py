"""Sentences about inputs that are missing in a stream of samples."""

import math
from collections.abc import Iterator, Mapping

from twin import LONGEST_GAP

_LISTED = 20  # gaps with a sentence of their own


class StreamGaps:
    """Follows which inputs are missing, and says it once a gap has begun, is long, and has ended.

    Attributes:
        missing: the inputs that the last sample lacked.
    """

    def __init__(self) -> None:
        self.missing: tuple[str, ...] = ()
        self._names: dict[str, None] = {}
        self._last = math.nan  # time of the last complete sample [s]
        self._count = 0
        self._long = False

    def take(self, time: float, inputs: Mapping[str, float]) -> Iterator[str]:
        """Takes the inputs of a sample by name; gives what is to be said.

        Args:
            time: [s].
            inputs: not finite where one is missing.
        """
        self.missing = tuple(name for name, value in inputs.items() if not math.isfinite(value))
        if not self.missing:
            if self._names and self._count <= _LISTED:
                yield self._end(time)
            self._names, self._long, self._last = {}, False, time
            return
        if not self._names:
            self._count += 1
        self._names |= dict.fromkeys(self.missing)
        if time - self._last > LONGEST_GAP and not self._long:
            self._long = True
            if self._count <= _LISTED:
                yield (
                    f"{', '.join(self._names)}: missing since {self._last:.6g} s; there are no "
                    "estimates until it is back."
                )

    def notes(self) -> list[str]:
        """What remains to be said at the end."""
        more = self._count - _LISTED
        return [f"{more} more gaps in inputs, treated alike."] if more > 0 else []

    def _end(self, time: float) -> str:
        what = f"{', '.join(self._names)}: missing from {self._last:.6g} to {time:.6g} s"
        if self._long:
            return (
                f"{what}: the twin starts again at the measured speed and keeps what it knows of "
                "the parameters."
            )
        return (
            f"{what}: held; nothing counts as measured there, and the estimates of that time are "
            "not trustworthy."
        )
