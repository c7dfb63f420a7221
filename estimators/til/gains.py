"""The linear law of an observer, TiL Eq. (4): gains by the names of states and outputs."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.black_box import BlackBox
from twin import TwinError

Array = NDArray[np.float64]

# Gains c of an acceleration on its own speed have no unit: v' = (1 - c) a~ + c a + ... . As the
# tyres' share of a~ falls with the speed it belongs to, it restores v for c < 1 and drives it away
# for c > 1.
FEED_THROUGH = {("vx", "ax"), ("vy", "ay")}


class Gains(NamedTuple):
    """The linear law K (nx, ny), TiL Eq. (4), by its entries that are not zero."""

    state: NDArray[np.int64]
    output: NDArray[np.int64]
    gain: Array  # [1/s times unit of the state over unit of the output]


def compile_gains(gains: Mapping[tuple[str, str], float], twin: BlackBox) -> Gains:
    """The gains as compiled code sees them.

    Raises:
        TwinError: a name is unknown, a gain is not finite, or a feed-through is 1 or more.
    """
    state, output = [], []
    for (to, of), gain in gains.items():
        state.append(place_of(to, twin.states, "state"))
        output.append(place_of(of, twin.outputs, "output"))
        if not np.isfinite(gain):
            raise TwinError(f"gain {of} -> {to} is {gain}; allowed: finite numbers")
        if (to, of) in FEED_THROUGH and not gain < 1.0:
            raise TwinError(
                f"gain {of} -> {to} is {gain}; allowed: less than 1, or the tyres' restoring "
                "forces change their sign"
            )
    return Gains(
        np.array(state, dtype=np.int64),
        np.array(output, dtype=np.int64),
        np.array(list(gains.values()), dtype=np.float64),
    )


def place_of(name: str, names: tuple[str, ...], kind: str) -> int:
    """The index of a name of that kind.

    Raises:
        TwinError: there is none.
    """
    if name not in names:
        raise TwinError(f"{kind} {name!r} is unknown; allowed: {', '.join(names)}")
    return names.index(name)
