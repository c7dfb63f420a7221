"""What every table and figure of a paper is made with."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenarios.experiment.result import Result, Row


@dataclass(frozen=True, slots=True, kw_only=True)
class Making:
    """How a table or figure is made.

    Attributes:
        seeds: of the noise.
        jobs: processes.
        out: existing folder for pictures.
        duration: of every drive [s]; None: as in the paper.
    """

    seeds: tuple[int, ...]
    jobs: int
    out: Path
    duration: float | None = None


@dataclass(frozen=True, slots=True)
class Clock:
    """Makes the result of what has been going on since it was made."""

    start: float

    @classmethod
    def started(cls) -> "Clock":
        """Starts now."""
        return cls(time.perf_counter())

    def result(self, name: str, making: Making, rows: Sequence[Row], **settings: Any) -> Result:
        """The result with its settings."""
        shared: dict[str, Any] = {"seeds": len(making.seeds)}
        if making.duration is not None:
            shared["duration"] = making.duration
        return Result(
            name=name,
            settings=shared | settings,
            seconds=time.perf_counter() - self.start,
            rows=list(rows),
        )
