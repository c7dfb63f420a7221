"""How a few searched numbers become K and the law of the mass.

A run's gains are numbers by name. An entry of K is named `output -> state`; `noise_density` and
`drift` are those of the mass law (`estimators.til.state_and_mass.LEAST_SQUARES_BOUNDS`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import replace as changed

import numpy as np
from numpy.typing import NDArray

from estimators.entry import Given
from estimators.til import state_and_mass
from estimators.til.ensemble_gain import entries
from scenarios.experiment.experiment import Gain, Recipe, Run
from scenarios.experiment.sideslip_and_mass import wheels_of
from twin import WHEELS, Drive

Array = NDArray[np.float64]
Named = tuple[tuple[str, float], ...]

ARROW = " -> "
DRIFT = 0.22  # [kg per root of s]; of the gains set by hand
FACTORS = (0.2, 5.0)  # of a direction of the ensemble's gain; chosen


def named(gain: Array, law: Mapping[str, float]) -> Named:
    """Gains of a run from a gain of one block, (n, ny), and the numbers of the mass law."""
    k = entries(gain)
    return (*((f"{of}{ARROW}{to}", value) for (to, of), value in k.items()), *law.items())


def k_of(values: Mapping[str, float]) -> dict[tuple[str, str], float]:
    """The entries of K among a run's gains."""
    found = {}
    for name, value in values.items():
        of, arrow, to = name.partition(ARROW)
        if arrow:
            found[to, of] = value
    return found


def _complete(run: Run, drive: Drive, given: Given) -> Given:
    values = dict(run.gains or ())
    k = k_of(values)
    own = [k.get((f"wheel_speed_{w}", f"wheel_speed_{w}"), 0.0) for w in WHEELS]
    numbers = {"noise_density": values["noise_density"], "drift": values["drift"]}
    law = state_and_mass.mass_law(
        numbers | {"wheel_speed": max(float(np.mean(own)), 0.0)}, wheels_of(run.case.twin)
    )
    return changed(given, laws=(law,), gains=k)


ENTRIES = Recipe(estimator="til", complete=_complete)


@dataclass(frozen=True, slots=True)
class Directions:
    """K as a sum of parts of the ensemble's gain, each times a searched factor.

    Attributes:
        parts: (r, n, ny) of which all but the last are searched.
        law: numbers of the mass law.
    """

    parts: Array
    law: Named

    def gains(self) -> tuple[Gain, ...]:
        """What is searched."""
        return tuple(Gain(f"direction {k}", *FACTORS, 1.0) for k in range(len(self.parts) - 1))

    def __call__(self, values: Mapping[str, float]) -> Named:
        """Gains of a run."""
        factors = [*values.values(), 1.0]
        return named(np.einsum("r,rij->ij", factors, self.parts), dict(self.law))


@dataclass(frozen=True, slots=True)
class AllEntries:
    """Every entry of K on its own, but for left and right, of which nothing is known.

    A searched number between 0.01 and 100 says how much of `unit` an entry is, by its logarithm:
    1 is no correction, 100 is plus, 0.01 is minus the unit.

    Attributes:
        unit: (n, ny) what an entry can be at most, for one block.
        orbits: (m, n, ny) of entries that are one in a mirror, 1 or -1, else 0.
        law: numbers of the mass law.
    """

    unit: Array
    orbits: Array
    law: Named

    def gains(self) -> tuple[Gain, ...]:
        """What is searched."""
        return tuple(Gain(f"entry {k}", 0.01, 100.0, 1.0) for k in range(len(self.orbits)))

    def __call__(self, values: Mapping[str, float]) -> Named:
        """Gains of a run."""
        shares = 0.5 * np.log10(list(values.values()))
        return named(np.einsum("r,rij->ij", shares, self.orbits) * self.unit, dict(self.law))


def itself(values: Mapping[str, float]) -> Named:
    """Of gains chosen by hand: what is searched is what a run takes."""
    return tuple(values.items())
