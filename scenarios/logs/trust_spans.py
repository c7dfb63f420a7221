"""When an estimate is not trustworthy, and why: times, channels and reasons."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from estimators.base import Estimate
from estimators.til.measurement_validation import SETTLING
from twin import Drive
from twin.logs.input_gaps import LONGEST_GAP, InputGap, gaps_of

_MOST = 20  # spans that are listed; more are counted in the last one
_GAPS = 3  # gaps in inputs that a span's reason names
_SHORT = 0.05  # [s]; spans nearer than that are one


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """A time that is not trustworthy.

    Attributes:
        start, end: [s], in the log's time.
        reason: why.
        channels: that are missing in it; empty where all are there.
    """

    start: float
    end: float
    reason: str
    channels: tuple[str, ...] = ()


def distrust_gaps(estimate: Estimate, drive: Drive) -> Estimate:
    """The estimate, not trustworthy where inputs were interpolated, nor until it has settled.

    Args:
        estimate: over the drive.
        drive: N samples, with the gaps of its inputs among its settings.
    """
    bridged = [gap for gap in gaps_of(drive.settings) if gap.bridged]
    if not bridged:
        return estimate
    trusted = np.ones(estimate.time.size, dtype=np.bool_)
    if estimate.trustworthy is not None:
        trusted &= estimate.trustworthy
    for gap in bridged:
        trusted[(estimate.time >= gap.start) & (estimate.time <= gap.end + SETTLING)] = False
    return replace(estimate, trustworthy=trusted)


def trust_spans(estimate: Estimate, drive: Drive) -> tuple[Span, ...]:
    """The times that are not trustworthy.

    Args:
        estimate: over the drive.
        drive: N samples, what the estimator was shown.
    """
    if estimate.trustworthy is None:
        return ()
    found = [_span(estimate, drive, a, b) for a, b in _runs(estimate)]
    if len(found) <= _MOST:
        return tuple(found)
    last = found[_MOST - 1]
    more = f"{len(found) - _MOST + 1} more times, the first from {last.start:.1f} s"
    return (
        *found[: _MOST - 1],
        Span(start=last.start, end=found[-1].end, reason=more, channels=()),
    )


def _runs(estimate: Estimate) -> Iterator[tuple[int, int]]:
    """First and last index of each run of samples that are not trusted, for one reason each."""
    code = np.zeros(estimate.time.size, dtype=np.int64)
    bad = ~np.asarray(estimate.trustworthy, dtype=np.bool_)
    if estimate.trust_reason is not None:
        code = estimate.trust_reason.astype(np.int64)
    state = np.where(bad, 1 + code, 0)
    steps = np.flatnonzero(np.diff(state)) + 1
    bounds = np.concatenate([[0], steps, [state.size]])
    start, kind = -1, 0
    for a, b in pairwise(bounds):
        if state[a] == 0 and estimate.time[b - 1] - estimate.time[a] < _SHORT and start >= 0:
            continue
        if state[a] != kind and start >= 0:
            yield start, int(a) - 1
            start = -1
        kind = int(state[a])
        if kind and start < 0:
            start = int(a)
    if start >= 0:
        yield start, state.size - 1


def _span(estimate: Estimate, drive: Drive, first: int, last: int) -> Span:
    time = estimate.time
    start = float(time[first])
    if _follows_a_cut(drive, first):
        start = float(time[first - 1])
    gaps = [gap for gap in gaps_of(drive.settings) if gap.start <= time[last] and gap.end >= start]
    if gaps:
        names = tuple(dict.fromkeys(name for gap in gaps for name in gap.names))
        return Span(start=start, end=float(time[last]), reason=_of_gaps(gaps), channels=names)
    channels = _missing(drive, first, last)
    return Span(
        start=start,
        end=float(time[last]),
        reason=_reason(estimate, drive, first, last, channels),
        channels=channels,
    )


def _follows_a_cut(drive: Drive, first: int) -> bool:
    """Whether the twin has started again at that sample."""
    return first > 0 and bool(drive.time[first] - drive.time[first - 1] > LONGEST_GAP)


def _of_gaps(gaps: Sequence[InputGap]) -> str:
    """What gaps in inputs do to the estimates of a span."""
    told = [
        f"{', '.join(gap.names)} missing from {gap.start:.2f} to {gap.end:.2f} s"
        + (", interpolated" if gap.bridged else ", the twin started again")
        for gap in gaps[:_GAPS]
    ]
    more = f" and {len(gaps) - _GAPS} more times" if len(gaps) > _GAPS else ""
    return "; ".join(told) + more


def _reason(
    estimate: Estimate, drive: Drive, first: int, last: int, channels: tuple[str, ...]
) -> str:
    if estimate.trust_reason is not None:
        told = estimate.reasons[int(estimate.trust_reason[first])]
        if told:
            return told
    if _follows_a_cut(drive, first):
        return "the log has a gap before it, the twin started again"
    if channels:
        return f"{', '.join(channels)}: missing in the log"
    seconds = float(estimate.time[last] - estimate.time[first])
    if first == 0 and seconds <= 1.5 * SETTLING:
        return "the estimate settles after the start"
    if last == len(drive) - 1 and first == 0:
        return "see what is wrong with the log or the estimate, above"
    return "a measurement is rejected as implausible or frozen, or the estimate settles after it"


def _missing(drive: Drive, first: int, last: int) -> tuple[str, ...]:
    """Channels that the log has elsewhere and that are missing in a span."""
    nan = np.isnan(drive.measurements)
    has = np.atleast_1d(~nan.all(axis=0))
    here = np.atleast_1d(nan[first : last + 1].any(axis=0))
    return tuple(name for name, a, b in zip(drive.output_names, has, here, strict=True) if a and b)
