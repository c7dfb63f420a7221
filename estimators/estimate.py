"""What an observer returns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin import EXTENDED, OUTPUTS, PARAMETERS, STATES, TwinError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """An observer's run over a drive of N samples.

    Attributes:
        time: (N,) [s].
        states: (N, nx) of the twin before each sample's correction.
        parameters: (N, np) deltas from the nominal chassis after it.
        outputs: (N, ny) what the twin's sensors showed.
        extended: (N, ne) what else the twin computed: forces and slips of its tyres.
        nominal: (np,) the twin's own chassis, without deltas; NaN where a black box does not tell.
        trustworthy: (N,) false where the guard rejected or missed a measurement in use, and for a
            while after; None where an estimator has no guard.
        state_names, parameter_names, output_names, extended_names: of the columns; by default
            those of a car.
    """

    time: Array
    states: Array
    parameters: Array
    outputs: Array
    extended: Array
    nominal: Array
    trustworthy: NDArray[np.bool_] | None = None
    state_names: tuple[str, ...] = STATES
    parameter_names: tuple[str, ...] = PARAMETERS
    output_names: tuple[str, ...] = OUTPUTS
    extended_names: tuple[str, ...] = EXTENDED

    def __getitem__(self, name: str) -> Array:
        """The (N,) history of a parameter, as a delta, or of anything else of the twin."""
        tables = (
            (self.parameter_names, self.parameters),
            (self.state_names, self.states),
            (self.output_names, self.outputs),
            (self.extended_names, self.extended),
        )
        for names, table in tables:
            if name in names:
                return table[:, names.index(name)]
        allowed = ", ".join(dict.fromkeys(name for names, _ in tables for name in names))
        raise TwinError(f"estimate: has no {name!r}; has {allowed}")
