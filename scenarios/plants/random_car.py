"""Random plausible real cars: what a car of a type has that its twin's files do not tell.

`random_car.toml` lists the properties with their ranges and where these come from. A `RealCar` is
a value for some of them, the others being those of the files; `random_car` draws them all at once.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin import TwinError

Array = NDArray[np.float64]
_CUT = 2.5  # standard deviations: what lies beyond does not leave the factory


@dataclass(frozen=True, slots=True, kw_only=True)
class Property:
    """A property of a car and how it varies from car to car.

    Attributes:
        text: what its numbers are, with units.
        nominal: (k,) of the car in the files.
        low, high: (k,) bounds where it is drawn uniformly.
        spread: (k,) standard deviation where it is drawn normally, else zero.
        source: where its range comes from.
    """

    text: str
    nominal: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    spread: tuple[float, ...]
    source: str

    def draw(self, rng: np.random.Generator) -> tuple[float, ...]:
        """Independent values."""
        normal = np.clip(rng.standard_normal(len(self.nominal)), -_CUT, _CUT)
        uniform = rng.uniform(self.low, self.high)
        spread = np.array(self.spread)
        values = np.where(spread > 0.0, np.array(self.nominal) + spread * normal, uniform)
        return tuple(values.tolist())


@cache
def properties() -> dict[str, Property]:
    """All properties of `random_car.toml`, by name."""
    with Path(__file__).with_suffix(".toml").open("rb") as file:
        tables = tomllib.load(file)
    found = {}
    for name, table in tables.items():
        nominal = _numbers(table["nominal"])
        size = len(nominal)
        found[name] = Property(
            text=table["text"],
            nominal=nominal,
            low=_numbers(table.get("low", 0.0), size),
            high=_numbers(table.get("high", 0.0), size),
            spread=_numbers(table.get("spread", 0.0), size),
            source=table["source"],
        )
    return found


def _numbers(value: float | list[float], size: int = 1) -> tuple[float, ...]:
    return tuple(map(float, value)) if isinstance(value, list) else (float(value),) * size


@dataclass(frozen=True, slots=True, kw_only=True)
class RealCar:
    """How a real car, its road and its sensors differ from what its twin believes.

    Attributes:
        values: (name, numbers) of some properties; the others are those of the files.
        seed: of what is random over the drive: road, hills, gusts, noise of the torques.
    """

    values: tuple[tuple[str, tuple[float, ...]], ...] = ()
    seed: int = 0

    def __getitem__(self, name: str) -> Array:
        """The (k,) numbers of a property."""
        return np.array(dict(self.values).get(name, properties()[name].nominal))

    def number(self, name: str) -> float:
        """The first number of a property."""
        return float(self[name][0])


def real_car(seed: int = 0, **values: ArrayLike) -> RealCar:
    """A car with given values of some properties, as in `real_car(steering_ratio=1.03)`.

    Raises:
        TwinError: a property is unknown, or its values are not as many finite numbers as it has.
    """
    given = []
    for name, value in values.items():
        if name not in properties():
            raise TwinError(
                f"real car: property {name!r} is unknown; allowed: {', '.join(properties())}"
            )
        numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
        size = len(properties()[name].nominal)
        if numbers.shape != (size,) or not np.isfinite(numbers).all():
            raise TwinError(
                f"real car: {name} is {numbers.tolist()}; allowed: {size} finite numbers"
            )
        given.append((name, tuple(numbers.tolist())))
    return RealCar(values=tuple(given), seed=seed)


def random_car(seed: int, only: Sequence[str] = ()) -> RealCar:
    """A car of which all properties are drawn; of the same seed, each is the same in both cases.

    Args:
        seed: of the car.
        only: properties that differ from the files; all of them if empty.

    Raises:
        TwinError: a property is unknown.
    """
    rng = np.random.default_rng(seed)
    drawn = {name: one.draw(rng) for name, one in properties().items()}
    wanted = only or tuple(drawn)
    unknown = [name for name in wanted if name not in drawn]
    if unknown:
        raise TwinError(
            f"real car: property {unknown[0]!r} is unknown; allowed: {', '.join(drawn)}"
        )
    return real_car(seed, **{name: drawn[name] for name in wanted})
