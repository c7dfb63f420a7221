"""How a live observer does: rates, lateness, what was dropped, and how much faster it could be."""

import math
from collections import deque
from collections.abc import Mapping
from typing import Any

_MOST = 5000  # latencies that are kept


class Health:
    """Counts between two reports."""

    def __init__(self) -> None:
        self.latencies: deque[float] = deque(maxlen=_MOST)  # [s] from frame to estimate
        self._all: deque[float] = deque(maxlen=50_000)
        self.busy = self.driven = 0.0  # [s] of work, and of the bus's time
        self.margin = math.nan
        self._before: dict[str, int] = {}
        self._since = math.nan

    def estimated(self, latency: float, step: float) -> None:
        """Notes an estimate that went out."""
        self.latencies.append(latency)
        self._all.append(latency)
        self.driven += step

    def report(self, now: float, counts: Mapping[str, int]) -> dict[str, Any]:
        """Figures since the last report.

        Args:
            now: [s].
            counts: totals of all kinds of events.
        """
        seconds = max(now - self._since, 1e-9) if math.isfinite(self._since) else 1.0
        new = {name: count - self._before.get(name, 0) for name, count in counts.items()}
        self._before, self._since = dict(counts), now
        if self.busy > 0.0:
            self.margin = self.driven / self.busy
        found: dict[str, Any] = {
            "frames_per_second": round(new["used"] / seconds, 1),
            "estimates_per_second": round(new["estimates"] / seconds, 1),
            "latency_p50_ms": _ms(self.latencies, 0.5),
            "latency_p99_ms": _ms(self.latencies, 0.99),
            "margin": round(self.margin, 1) if math.isfinite(self.margin) else None,
        }
        found |= {name: n for name, n in new.items() if n and name not in ("used", "estimates")}
        self.latencies.clear()
        self.busy = self.driven = 0.0
        return found

    def total(self) -> tuple[float | None, float | None]:
        """Latency, median and 99th percentile, of all that is remembered [ms]."""
        return _ms(self._all, 0.5), _ms(self._all, 0.99)


def _ms(values: deque[float], share: float) -> float | None:
    if not values:
        return None
    ordered = sorted(values)
    return round(1e3 * ordered[min(int(share * len(ordered)), len(ordered) - 1)], 3)
