"""What an observer returns that knows how well it knows."""

from dataclasses import dataclass

from estimators.estimate import Array, Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterEstimate(Estimate):
    """A run with the standard deviations that the observer claims.

    Attributes:
        estimated: names of the p parameters that were estimated.
        sd: (N, p) standard deviation of each.
    """

    estimated: tuple[str, ...]
    sd: Array
