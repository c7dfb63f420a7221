"""What an observer returns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin import OUTPUTS, PARAMETERS, STATES, TwinError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """An observer's run over a drive of N samples.

    Attributes:
        time: (N,) [s].
        states: (N, 28) of the twin before each sample's correction, `twin.STATES`.
        parameters: (N, 10) deltas from the nominal chassis after it, `twin.PARAMETERS`.
        outputs: (N, 10) what the twin's sensors showed, `twin.OUTPUTS`.
        nominal: (10,) the twin's own chassis, without deltas.
    """

    time: Array
    states: Array
    parameters: Array
    outputs: Array
    nominal: Array

    def __getitem__(self, name: str) -> Array:
        """The (N,) history of a parameter, as a delta, or of a state or output of the twin."""
        for names, table in (
            (PARAMETERS, self.parameters),
            (STATES, self.states),
            (OUTPUTS, self.outputs),
        ):
            if name in names:
                return table[:, names.index(name)]
        raise TwinError(
            f"estimate: has no {name!r}; has {', '.join(PARAMETERS + STATES + OUTPUTS)}"
        )
