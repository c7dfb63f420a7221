"""What is to become known, as a user writes it: `mass=20kg,Jzz=5%`."""

import math
import re
from collections.abc import Mapping

from twin import LOAD, PARAMETER, SCALES, TwinError, Vehicle

ALL = ("mass", "cm_x", "cm_y", "cm_z", "Jxx", "Jyy", "Jzz")
# Of each SI unit, what it may be written in
_UNITS: Mapping[str, Mapping[str, float]] = {
    "kg": {"": 1.0, "kg": 1.0, "t": 1000.0},
    "m": {"": 1.0, "m": 1.0, "cm": 0.01, "mm": 0.001},
    "kg m2": {"": 1.0, "kgm2": 1.0},
    "1": {"": 1.0},
}
_EXAMPLE = {"kg": "20kg", "m": "10mm", "kg m2": "100kgm2", "1": "5%"}
_QUANTITY = re.compile(r"([0-9.]+(?:e[+-]?[0-9]+)?)\s*([a-z0-9% ]*)", re.IGNORECASE)


def wanted_sd(text: str, vehicle: Vehicle) -> dict[str, float]:
    """Standard deviations by parameter, SI.

    Args:
        text: as in `mass=20kg,Jzz=5%`; a percentage is of the car's own value, of a scale of 1.
        vehicle: whose values percentages are of.

    Raises:
        TwinError: an unknown parameter or unit, a name given twice, or no positive number.
    """
    allowed = tuple(name for name in (*LOAD, *SCALES) if PARAMETER[name].prior_sd > 0.0)
    found: dict[str, float] = {}
    for part in text.split(","):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if name not in allowed:
            raise TwinError(f"--want: parameter {name!r} is unknown; allowed: {', '.join(allowed)}")
        if name in found:
            raise TwinError(f"--want: {name} is given twice; allowed: each parameter once")
        found[name] = _sd(name, value if equals else "", vehicle)
    return found


def _sd(name: str, value: str, vehicle: Vehicle) -> float:
    units = dict(_UNITS[PARAMETER[name].unit])
    own = nominal(name, vehicle)
    if own > 0.0:
        units["%"] = 0.01 * own
    named = ", ".join(unit for unit in units if unit)
    match = _QUANTITY.fullmatch(value)
    unit = match[2].replace(" ", "") if match else ""
    number = _number(match[1]) if match else math.nan
    if unit not in units or not 0.0 < number < math.inf:
        raise TwinError(
            f"--want: {name} is {value!r}; allowed: a standard deviation above 0 in "
            f"{named or 'no unit'}, as in {name}={_EXAMPLE[PARAMETER[name].unit]}"
        )
    sd, prior = number * units[unit], PARAMETER[name].prior_sd
    if sd >= prior:
        raise TwinError(
            f"--want: {name} is {value!r}; allowed: less than the {shown(name, prior)} that it is "
            "known to before the drive"
        )
    return sd


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def nominal(name: str, vehicle: Vehicle) -> float:
    """What a percentage is of: the car's mass or inertia, 1 of a scale; 0 where there is none."""
    if name in SCALES:
        return 1.0
    if name == "mass":
        return vehicle.figures.mass
    axis = {"Jxx": 0, "Jyy": 1, "Jzz": 2}.get(name)
    return 0.0 if axis is None else float(vehicle.chassis().inertia[axis, axis])


def shown(name: str, sd: float) -> str:
    """A standard deviation for people: kg, mm, kg m2 or %."""
    unit = PARAMETER[name].unit
    if name in SCALES:
        return f"{100.0 * sd:.2g} %"
    return f"{1000.0 * sd:.2g} mm" if unit == "m" else f"{_rounded(sd)} {unit}"


def _rounded(value: float) -> str:
    return f"{value:.0f}" if value >= 100.0 else f"{value:.2g}"
