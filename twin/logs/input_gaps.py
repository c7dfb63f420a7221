"""Gaps in the inputs of a log: short ones are bridged, at long ones the drive is cut.

A twin cannot step without its inputs. Over a short gap they are interpolated, and nothing counts as
measured there, as a twin with guessed inputs is compared with nothing. The samples of a long gap
are left out: a gap in time, behind which a twin starts again at the measured speed.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LONGEST_GAP = 1.0  # [s] that is bridged; chosen: held torques take a car off by 3 m/s by then
_LISTED = 10  # gaps with a sentence of their own


class InputGap(NamedTuple):
    """A time without an input.

    Attributes:
        start, end: of the samples without it [s].
        names: of the inputs that are missing, in some sample of it.
        bridged: whether it was; else the drive has no samples there.
    """

    start: float
    end: float
    names: tuple[str, ...]
    bridged: bool

    def sentence(self) -> str:
        """What was done about it."""
        what = f"{', '.join(self.names)}: missing from {self.start:.6g} to {self.end:.6g} s"
        if self.bridged:
            return (
                f"{what}: interpolated; nothing counts as measured there, and the estimates of "
                "that time are not trustworthy."
            )
        return (
            f"{what}: that time is left out; behind it a twin starts again at the measured speed "
            "and keeps what it knows of the parameters."
        )


class WithoutGaps(NamedTuple):
    """Inputs without gaps.

    Attributes:
        columns: of each input (N,), finite where `kept`.
        kept: (N,) samples that the drive has.
        bridged: (N,) samples of which an input was interpolated.
        gaps: in the order of time; those at the ends are left out of the drive as long ones are.
    """

    columns: dict[str, Array]
    kept: Mask
    bridged: Mask
    gaps: tuple[InputGap, ...]


def without_gaps(time: Array, columns: Mapping[str, Array]) -> WithoutGaps | None:
    """Inputs with short gaps bridged; None if no two samples have all inputs.

    Args:
        time: (N,) rising [s].
        columns: of each input (N,), not finite where it is missing.
    """
    missing = {name: ~np.isfinite(values) for name, values in columns.items()}
    any_missing = np.zeros(time.size, dtype=np.bool_)
    for mask in missing.values():
        any_missing |= mask
    if np.count_nonzero(~any_missing) < 2:
        return None
    kept, bridged = ~any_missing, np.zeros(time.size, dtype=np.bool_)
    gaps = []
    for first, last in runs(any_missing):
        inside = first > 0 and last < time.size - 1
        short = inside and bool(time[last + 1] - time[first - 1] <= LONGEST_GAP)
        if short:
            bridged[first : last + 1] = kept[first : last + 1] = True
        names = tuple(name for name, mask in missing.items() if mask[first : last + 1].any())
        gaps.append(InputGap(float(time[first]), float(time[last]), names, short))
    filled = {name: _filled(time, columns[name], mask) for name, mask in missing.items()}
    return WithoutGaps(filled, kept, bridged, tuple(gaps))


def sentences(gaps: tuple[InputGap, ...]) -> list[str]:
    """What was done about gaps, one by one, and how many more there are."""
    told = [gap.sentence() for gap in gaps[:_LISTED]]
    if len(gaps) > _LISTED:
        long = sum(not gap.bridged for gap in gaps[_LISTED:])
        told.append(
            f"{len(gaps) - _LISTED} more gaps in inputs, {long} of them longer than "
            f"{LONGEST_GAP:g} s: treated alike."
        )
    return told


def as_settings(gaps: tuple[InputGap, ...]) -> list[dict[str, Any]]:
    """Gaps as a drive's settings keep them."""
    return [gap._asdict() for gap in gaps]


def gaps_of(settings: Mapping[str, Any]) -> tuple[InputGap, ...]:
    """The gaps in the inputs of a log that became the drive of these settings."""
    return tuple(
        InputGap(**one | {"names": tuple(one["names"])})
        for one in settings.get("log", {}).get("input_gaps", ())
    )


def mended(parts: dict[str, Any], settings: dict[str, Any]) -> dict[str, Any]:
    """The parts of a drive, settings among them, with gaps in its inputs bridged or cut out.

    Args:
        parts: time, inputs, input_names, measurements and truth of `twin.Drive`.
        settings: of it.
    """
    whole = parts | {"settings": settings}
    inputs, time = parts["inputs"], parts["time"]
    sound = inputs.ndim == 2 and len(inputs) == time.size and np.isfinite(time).all()
    if not sound or np.isfinite(inputs).all():
        return whole
    found = without_gaps(time, dict(zip(parts["input_names"], inputs.T, strict=True)))
    if found is None:
        return whole
    measurements = parts["measurements"].copy()
    measurements[found.bridged] = np.nan
    there = found.kept
    return whole | {
        "time": time[there],
        "inputs": np.column_stack(list(found.columns.values()))[there],
        "measurements": measurements[there],
        "truth": {name: values[there] for name, values in parts["truth"].items()},
        "settings": settings
        | {"log": settings.get("log", {}) | {"input_gaps": as_settings(found.gaps)}},
    }


def runs(mask: Mask) -> list[tuple[int, int]]:
    """First and last index of each run of true samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _filled(time: Array, values: Array, missing: Mask) -> Array:
    if not missing.any() or missing.all():
        return values
    return np.where(missing, np.interp(time, time[~missing], values[~missing]), values)
