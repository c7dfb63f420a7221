"""What is believed of the parameters before a drive."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from twin import PARAMETER, PARAMETERS, TwinError


def prior_sds(
    parameters: Sequence[str], changed: Mapping[str, float] | None = None
) -> dict[str, float]:
    """Standard deviations before the first sample by name.

    Args:
        parameters: names.
        changed: by name, instead of those of the records.
    """
    return {name: PARAMETER[name].prior_sd for name in parameters} | dict(changed or {})


def initial_deltas(
    values: Mapping[str, float] | None, names: tuple[str, ...] = PARAMETERS
) -> NDArray[np.float64]:
    """(np,) deltas by name as an array; zero where not given.

    Args:
        values: by name.
        names: of the parameters, in order.

    Raises:
        TwinError: a name is unknown or a value not finite.
    """
    found = np.zeros(len(names))
    for name, value in (values or {}).items():
        if name not in names:
            raise TwinError(f"parameter {name!r} is unknown; allowed: {', '.join(names)}")
        if not np.isfinite(value):
            raise TwinError(f"parameter {name} is {value}; allowed: a finite number")
        found[names.index(name)] = value
    return found
