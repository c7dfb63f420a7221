"""What is believed of a car's parameters before a drive, and how far apart twins are set."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from twin import PARAMETERS, SCALES, TwinError

# Standard deviations before the first sample: a full car more or less, its CM anywhere between the
# seats, and a model of tyres and springs from a data sheet
PRIOR_SD = {
    "mass": 300.0,
    **{"cm_x": 0.08, "cm_y": 0.04, "cm_z": 0.06},
    **{"Jxx": 150.0, "Jyy": 900.0, "Jzz": 900.0},
    **{"Jxy": 30.0, "Jxz": 80.0, "Jyz": 30.0},
    **dict.fromkeys(SCALES, 0.15),
    **dict.fromkeys(("drag", "relaxation"), 0.3),
    **dict.fromkeys(("drive_torque", "brake_torque"), 0.03),
}
# How far each twin is off: as in `estimators.identifiability.cramer_rao`, large beside rounding,
# small beside curvature
OFFSETS = {
    "mass": 10.0,
    **dict.fromkeys(("cm_x", "cm_y", "cm_z"), 0.005),
    **{"Jxx": 10.0, "Jyy": 30.0, "Jzz": 30.0},
    **dict.fromkeys(("Jxy", "Jxz", "Jyz"), 10.0),
    **dict.fromkeys(SCALES, 0.01),
    "drag": 0.05,
}


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
