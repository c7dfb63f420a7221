"""How an estimator is listed: what it is given, what it needs and what it gives."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimators.base import Estimator
from estimators.black_box import BlackBox
from estimators.speed_follower import SpeedFollower
from twin import Twin, TwinError, Vehicle

NEEDS = ("twin", "noise_sd", "laws", "model", "settings", "dt")


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What an estimator can be given. All of it is optional; an `Entry` says what is needed.

    Attributes:
        vehicle: of the twins.
        black_box: makes a twin of another kind, instead of `vehicle`; called once for each twin.
        noise_sd: standard deviation of a sample's white noise by channel. A channel that is not
            there is not used.
        laws: parameter laws, `estimators.til.law.ParameterLaw`.
        gains: of the states, by (state, output).
        parameters: to be estimated; None: what the estimator estimates by default.
        prior_sd: standard deviations before the drive by parameter, instead of those of its record.
        model: of an estimator without a twin: `double_track.DoubleTrack`, `TruckParameters`, ...
        settings: the estimator's own settings record.
        dt: sample time of the drive [s], for an estimator without a twin.
        every: the TiL observer corrects at every n-th sample.
        validated: whether the TiL observer rejects implausible measurements.
        follower: makes the torques of a drive without torques, from its measured speed.
    """

    vehicle: Vehicle | None = None
    black_box: Callable[[], BlackBox] | None = None
    noise_sd: Mapping[str, float] = field(default_factory=dict)
    laws: Sequence[Any] = ()
    gains: Mapping[tuple[str, str], float] = field(default_factory=dict)
    parameters: tuple[str, ...] | None = None
    prior_sd: Mapping[str, float] = field(default_factory=dict)
    model: Any = None
    settings: Any = None
    dt: float | None = None
    every: int = 1
    validated: bool = False
    follower: SpeedFollower | None = None

    def has(self, need: str) -> bool:
        """Whether one of `NEEDS` is there."""
        if need == "twin":
            return self.vehicle is not None or self.black_box is not None
        value = getattr(self, need)
        return bool(value) if need in ("noise_sd", "laws") else value is not None

    def twin(self) -> BlackBox:
        """A fresh twin.

        Raises:
            TwinError: there is neither a vehicle nor a black box.
        """
        if self.black_box is not None:
            return self.black_box()
        if self.vehicle is None:
            raise TwinError("estimator: has no twin; allowed: with a vehicle or a black box")
        return Twin(self.vehicle)

    def source(self) -> Vehicle | Callable[[], BlackBox]:
        """What the twins of an estimator that runs several are made of.

        Raises:
            TwinError: there is neither a vehicle nor a black box.
        """
        return self.car() if self.black_box is None else self.black_box

    def car(self) -> Vehicle:
        """The vehicle of the twins.

        Raises:
            TwinError: there is none.
        """
        if self.vehicle is None:
            raise TwinError("estimator: has no vehicle; allowed: with one")
        return self.vehicle

    def noise(self, outputs: tuple[str, ...]) -> NDArray[np.float64]:
        """(ny,) standard deviation of each output's noise; NaN: the channel is not used."""
        return np.array([self.noise_sd.get(name, np.nan) for name in outputs])


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """An estimator of the registry.

    Attributes:
        name: of the estimator.
        words: one line that says what it is.
        make: makes it from what is given.
        needs: of `NEEDS`, what has to be given.
        channels: measured channels that the drive must have.
        gives: names of what it estimates, as far as its twin or laws have them.
        sd: whether it has standard deviations.
        online: whether it takes one sample at a time, see `estimators.base.OnlineEstimator`.
    """

    name: str
    words: str
    make: Callable[[Given], Estimator]
    needs: frozenset[str] = frozenset()
    channels: tuple[str, ...] = ()
    gives: tuple[str, ...] = ()
    sd: bool = False
    online: bool = False

    def __post_init__(self) -> None:
        """Checks the needs."""
        if unknown := sorted(self.needs - set(NEEDS)):
            raise TwinError(
                f"estimator {self.name}: needs {unknown[0]!r}; allowed: {', '.join(NEEDS)}"
            )

    def lacks(self, given: Given, channels: Sequence[str] | None = None) -> tuple[str, ...]:
        """What is missing.

        Args:
            given: what there is.
            channels: measured in the drive; None: not known yet.
        """
        needs = [need for need in NEEDS if need in self.needs and not given.has(need)]
        have = self.channels if channels is None else channels
        return (*needs, *(name for name in self.channels if name not in have))
