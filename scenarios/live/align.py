"""Signals of different rates and phases become samples at common times, with bounded lateness."""

import math
from collections import deque
from collections.abc import Iterator, Sequence
from itertools import pairwise

from estimators.til.stream import LONGEST_STEP

LATENESS = 0.05  # [s] that a sample waits for a late signal; chosen: five frames at 100 Hz
JUMP = 1.0  # [s] between two frames after which time begins anew
_FASTER = 1.5  # a signal faster than the samples by more is averaged, as in a log
_MOST = 2000  # points of a signal that are kept; a flood does not grow memory
_LATEST = 1e11  # [s]; what is beyond is no time, and too coarse for samples
_CATCH_UP = 50  # samples at once; what is older is left out

Point = tuple[float, float]  # time [s], value


class Aligner:
    """Collects points of signals and gives a value of each at uniform times.

    Attributes:
        late: samples that did not wait any longer for a signal.
        out_of_order: points that came after a later one of the same signal.
        jumps: of time.
        skipped: samples that were left out, to catch up.
    """

    def __init__(self, names: Sequence[str], step: float, lateness: float = LATENESS) -> None:
        """Args: step: of the samples [s]; lateness: [s]."""
        self.late = self.out_of_order = self.jumps = self.skipped = 0
        self._step, self._lateness = step, lateness
        self._points: dict[str, deque[Point]] = {name: deque(maxlen=_MOST) for name in names}
        self._period = dict.fromkeys(names, math.nan)  # of a signal's points [s], a running mean
        self._newest = math.nan
        self._next = math.nan  # time of the next sample

    def add(self, name: str, time: float, value: float) -> None:
        """Takes a point of a signal; one without a time is left out."""
        if not abs(time) < _LATEST:
            return
        if abs(time - self._newest) > JUMP:
            self.jumps += 1
            self.clear()
        points = self._points[name]
        if points and time <= points[-1][0]:
            self.out_of_order += 1
            return
        if points:
            gap = time - points[-1][0]
            known = self._period[name]
            self._period[name] = gap if math.isnan(known) else known + 0.1 * (gap - known)
        points.append((time, value))
        if not time <= self._newest:
            self._newest = time
        if math.isnan(self._next):
            self._next = math.ceil(time / self._step) * self._step

    def clear(self) -> None:
        """Forgets all points: time begins anew with the next one."""
        for points in self._points.values():
            points.clear()
        self._newest = self._next = math.nan

    def samples(self) -> Iterator[tuple[float, dict[str, float], float]]:
        """Samples that are due: time [s], values by name, and the age of the oldest [s]."""
        behind = math.floor((self._newest - self._lateness - self._next) / self._step) if (
            math.isfinite(self._next)
        ) else 0  # fmt: skip
        if behind > _CATCH_UP:
            self.skipped += behind - _CATCH_UP
            self._next += (behind - _CATCH_UP) * self._step
        while self._next <= self._newest:
            time = self._next
            if not self._complete(time):
                if self._newest < time + self._lateness:
                    return
                self.late += 1
            values, oldest = {}, 0.0
            for name, points in self._points.items():
                value, age = self._at(name, points, time)
                if math.isfinite(value):
                    values[name] = value
                    oldest = max(oldest, age)
            self._next = time + self._step
            yield time, values, oldest

    def _complete(self, time: float) -> bool:
        """Whether every signal that is on the bus has come as far as a sample needs it."""
        return all(
            points[-1][0] >= time + self._half_window(name)
            for name, points in self._points.items()
            if points and self._newest - points[-1][0] < LONGEST_STEP
        )

    def _half_window(self, name: str) -> float:
        """Half the time over which a fast signal is averaged [s]; 0 of others."""
        return 0.5 * self._step if self._period[name] * _FASTER < self._step else 0.0

    def _at(self, name: str, points: deque[Point], time: float) -> tuple[float, float]:
        """Value at a time, NaN if it is not known, and its age [s]."""
        while len(points) > 2 and points[1][0] <= time - self._step:
            points.popleft()
        half = self._half_window(name)
        if half:
            near = [value for at, value in points if abs(at - time) <= half]
            if near:
                return sum(near) / len(near), 0.0
        if not points:
            return math.nan, 0.0
        if points[-1][0] <= time:
            age = time - points[-1][0]
            return (points[-1][1] if age <= LONGEST_STEP else math.nan), age
        for (before, first), (after, second) in pairwise(points):
            if before <= time <= after:
                if after - before > LONGEST_STEP:
                    return math.nan, 0.0
                return first + (time - before) / (after - before) * (second - first), 0.0
        return math.nan, 0.0
