"""Which inertia tensors a body can have."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import TwinError


def check_inertia(path: Path, chassis: Mapping[str, Any]) -> None:
    """Checks that some distribution of mass has these moments and products of inertia.

    Args:
        path: of the car's file, for the message.
        chassis: its fields Jxx, Jyy, Jzz, Jxy, Jxz and Jyz [kg m2].

    Raises:
        TwinError: a principal moment is not positive, or larger than the sum of the other two.
    """
    xx, yy, zz, xy, xz, yz = (chassis[f"J{axes}"] for axes in ("xx", "yy", "zz", "xy", "xz", "yz"))
    moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if moments[0] > 0.0 and moments[2] <= moments[0] + moments[1]:
        return
    values = ", ".join(f"J{axes} {chassis[f'J{axes}']:g}" for axes in ("xx", "yy", "zz"))
    raise TwinError(
        f"{path}: chassis: no body has the inertia {values} kg m2; allowed: positive principal "
        "moments, none larger than the sum of the other two"
    )
