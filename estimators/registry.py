"""All estimators by name. A new one is its own file with its `Entry`, and a line here."""

from collections.abc import Sequence

from estimators.base import Estimator
from estimators.benchmarks import (
    bicycle_ekf,
    double_track,
    kalman_bucy,
    kalman_bucy_ode,
    single_track,
    static_map,
)
from estimators.ensemble import offline_fit, staged, unscented
from estimators.entry import Entry, Given
from estimators.joint import observer as joint
from estimators.til import observer as til
from estimators.til import scheduled
from twin import TwinError

ESTIMATORS: dict[str, Entry] = {
    entry.name: entry
    for entry in (
        *til.ENTRIES,
        scheduled.ENTRY,
        joint.ENTRY,
        staged.ENTRY,
        unscented.ENTRY,
        offline_fit.ENTRY,
        *kalman_bucy.ENTRIES,
        kalman_bucy_ode.ENTRY,
        double_track.ENTRY,
        single_track.ENTRY,
        bicycle_ekf.ENTRY,
        static_map.ENTRY,
    )
}


def register(entry: Entry) -> None:
    """Adds an estimator that is defined elsewhere.

    Raises:
        TwinError: the name is taken.
    """
    if entry.name in ESTIMATORS:
        raise TwinError(f"estimator {entry.name!r}: is registered already; allowed: another name")
    ESTIMATORS[entry.name] = entry


def find(name: str) -> Entry:
    """The entry of a name.

    Raises:
        TwinError: there is none.
    """
    if name not in ESTIMATORS:
        raise TwinError(f"estimator is {name!r}; allowed: {', '.join(ESTIMATORS)}")
    return ESTIMATORS[name]


def make(name: str, given: Given) -> Estimator:
    """Makes an estimator.

    Args:
        name: of `ESTIMATORS`.
        given: what it is made of.

    Raises:
        TwinError: the name is unknown, or something that it needs is missing or wrong.
    """
    entry = find(name)
    if missing := entry.lacks(given):
        raise TwinError(f"estimator {name}: lacks {', '.join(missing)}; allowed: with all of them")
    return entry.make(given)


def usable(given: Given, channels: Sequence[str]) -> tuple[str, ...]:
    """Names of the estimators for which this suffices.

    Args:
        given: what there is.
        channels: measured in the drive.
    """
    return tuple(name for name, entry in ESTIMATORS.items() if not entry.lacks(given, channels))
