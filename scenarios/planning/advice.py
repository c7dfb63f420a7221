"""What to drive so that what is still missing becomes known: sentences from a table.

`advice.toml` holds, for standard manoeuvres of the project's SUV, the seconds until each parameter
is known to the share of its prior at which the joint observer calls it valid, if the car is as its
files say. `scenarios.planning.advice_table` computes it.
"""

import tomllib
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from estimators.base import Estimate
from twin import PARAMETER

FILE = Path(__file__).with_name("advice.toml")
MAIN = ("mass", "cm_x", "cm_y", "cm_z", "Jxx", "Jyy", "Jzz")
LEAST = 10.0  # [s] of driving before the joint observer calls anything valid
# In the words of a driver, at the speeds of the table
WORDS = {
    "slalom": "slalom at 15 m/s, to and fro 0.9 times a second",
    "swept steer": "steering to and fro at 22 m/s, slowly at first, then up to 4 times a second",
    "step steer": "quick turns of the hand wheel to either side at 22 m/s, each held for 4 s",
    "brake in turn": "bends to either side, braking hard in each from 22 to 8 m/s",
    "urban": "driving straight on with stops, as in town",
}


@cache
def table() -> dict[str, dict[str, float]]:
    """Seconds by parameter and manoeuvre, where it takes no more than ten minutes."""
    with FILE.open("rb") as file:
        return {name: dict(values) for name, values in tomllib.load(file).items()}


def missing(estimate: Estimate, names: Sequence[str] = MAIN) -> tuple[str, ...]:
    """The parameters that an estimate does not call valid at its end.

    Args:
        estimate: with standard deviations.
        names: of the parameters that are looked at.
    """
    return tuple(name for name in names if not estimate.valid_of(name)[-1])


def what_to_drive(names: Sequence[str]) -> tuple[str, ...]:
    """A sentence for each parameter, and one manoeuvre for all of them where there is one.

    Args:
        names: of the parameters that are to become known.
    """
    known = [name for name in names if table().get(name)]
    sentences = []
    for name in known:
        manoeuvre = min(table()[name], key=table()[name].__getitem__)
        sentences.append(
            f"Not known yet: {PARAMETER[name].words}. {_about(table()[name][manoeuvre])} of "
            f"{WORDS[manoeuvre]} would tell."
        )
    together = {
        manoeuvre: max(table()[name][manoeuvre] for name in known)
        for manoeuvre in WORDS
        if known and all(manoeuvre in table()[name] for name in known)
    }
    if len(known) > 1 and together:
        manoeuvre = min(together, key=together.__getitem__)
        sentences.append(f"All of these: {_about(together[manoeuvre])} of {WORDS[manoeuvre]}.")
    if known:
        sentences.append(
            "Times are those of the project's SUV, if it is as its files say; til plan finds "
            "what is quicker for this car."
        )
    return tuple(sentences)


def _about(seconds: float) -> str:
    """Rounded up, to 5 s or half a minute."""
    seconds = max(seconds, LEAST)
    if seconds <= 90.0:
        return f"{5.0 * np.ceil(seconds / 5.0):.0f} s"
    return f"{0.5 * np.ceil(seconds / 30.0):g} min"
