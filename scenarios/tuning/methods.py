"""Ways of searching: Bayesian optimisation, differential evolution, random points.

Each is asked for points and told their costs. Points lie in a box of log10 of the gains.
"""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from twin import TwinError

Array = NDArray[np.float64]
Box = Sequence[tuple[float, float]]

METHODS = ("bayes", "evolution", "random")
# Storn and Price 1997: factor of the differences, probability of crossing over
FACTOR, CROSSING = 0.6, 0.8


class Method(Protocol):
    """A search that is asked and told."""

    models: Sequence[Any]  # surrogates; none where the method has none

    def ask(self, n_points: int, strategy: str = "") -> list[list[float]]:
        """The next points."""
        ...

    def tell(self, x: Sequence[Sequence[float]], y: Sequence[float]) -> Any:
        """What points cost."""
        ...


def method_of(name: str, box: Box, first: int) -> Any:
    """A method by its name.

    Args:
        name: of `METHODS`.
        box: bounds of each coordinate.
        first: points that are told before the method is asked.

    Raises:
        TwinError: no such method.
    """
    if name == "evolution":
        return Evolution(box, np.random.default_rng(0))
    if name == "random":
        return RandomPoints(box, np.random.default_rng(0))
    if name not in METHODS:
        raise TwinError(f"tune: method is {name!r}; allowed: {', '.join(METHODS)}")
    from skopt import Optimizer

    return Optimizer(
        list(box), base_estimator="GP", n_initial_points=first, acq_func="EI", random_state=0
    )


class RandomPoints:
    """Uniform in the box: what any search has to beat."""

    models: Sequence[Any] = ()

    def __init__(self, box: Box, rng: np.random.Generator) -> None:
        """Args: box: bounds of each coordinate; rng: of the points."""
        self._low, self._high = np.transpose(np.asarray(box, dtype=np.float64))
        self._rng = rng

    def ask(self, n_points: int, strategy: str = "") -> list[list[float]]:
        """New points."""
        del strategy
        return self._rng.uniform(self._low, self._high, (n_points, self._low.size)).tolist()

    def tell(self, x: Sequence[Sequence[float]], y: Sequence[float]) -> None:
        """Learns nothing."""


class Evolution:
    """Differential evolution, current-to-best/1/bin: a genetic algorithm of real numbers."""

    models: Sequence[Any] = ()

    def __init__(self, box: Box, rng: np.random.Generator) -> None:
        """Args: box: bounds of each coordinate; rng: of the mutations."""
        self._low, self._high = np.transpose(np.asarray(box, dtype=np.float64))
        self._rng = rng
        self._population: list[Array] = []
        self._costs: list[float] = []
        self._next = 0
        self._asked: list[int] = []

    def ask(self, n_points: int, strategy: str = "") -> list[list[float]]:
        """Mutations of the next members, each towards the best and by two others' difference."""
        del strategy
        self._asked = [(self._next + k) % len(self._population) for k in range(n_points)]
        self._next = (self._next + n_points) % len(self._population)
        return [self._child(member).tolist() for member in self._asked]

    def _child(self, member: int) -> Array:
        others = [k for k in range(len(self._population)) if k != member]
        b, c = (self._population[k] for k in self._rng.choice(others, 2, replace=False))
        best = self._population[int(np.argmin(self._costs))]
        crossed = self._rng.random(self._low.size) < CROSSING
        crossed[self._rng.integers(self._low.size)] = True
        own = self._population[member]
        wanted = np.where(crossed, own + FACTOR * (best - own + b - c), own)
        # half way to a bound instead of beyond it
        wanted = np.where(wanted < self._low, 0.5 * (own + self._low), wanted)
        return np.where(wanted > self._high, 0.5 * (own + self._high), wanted)

    def tell(self, x: Sequence[Sequence[float]], y: Sequence[float]) -> None:
        """The first points are the population; later ones take the place of what is worse."""
        if not self._asked:
            self._population += [np.asarray(point, dtype=np.float64) for point in x]
            self._costs += list(y)
            return
        for member, point, cost in zip(self._asked, x, y, strict=True):
            if cost <= self._costs[member]:
                self._population[member] = np.asarray(point, dtype=np.float64)
                self._costs[member] = cost
        self._asked = []
