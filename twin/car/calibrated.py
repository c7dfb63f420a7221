"""Cars that a calibration found: a TOML file that names another car and what differs from it.

    vehicle = "suv"                       # a car's name, or its file beside this one
    [values.front_cornering_stiffness]    # a factor of `twin.scales.VEHICLE_SCALES`
    value = 1.04
    [values.mass]                         # a delta of `twin.LOAD`
    value = 85.0

`til calibrate` writes it; what else stands in it (intervals, gains, offsets) is for people.
"""

from pathlib import Path
from typing import NamedTuple

from twin.parameters import LOAD
from twin.scales import VEHICLE_SCALES
from twin.toml_file import Table


class Calibrated(NamedTuple):
    """What a calibration says of a car.

    Attributes:
        base: the car's name or file.
        scales: factors of `VEHICLE_SCALES`.
        deltas: of `LOAD`.
    """

    base: str
    scales: dict[str, float]
    deltas: dict[str, float]


def calibrated_of(path: Path, table: Table) -> Calibrated | None:
    """What a TOML file says of another car; None if it describes a car itself.

    Raises:
        TwinError: a value is no number.
    """
    base = table.values.get("vehicle")
    if not isinstance(base, str):
        return None
    scales, deltas = {}, {}
    for name, value in table.table("fixed").values.items():
        _put(name, float(value), scales, deltas)
    for name, entry in table.table("values").tables():
        _put(name, entry.number("value", 0.0, -1e6, 1e6), scales, deltas)
    beside = path.parent / base
    return Calibrated(str(beside) if beside.is_file() else base, scales, deltas)


def _put(name: str, value: float, scales: dict[str, float], deltas: dict[str, float]) -> None:
    """Sorts a value in; offsets and gains belong to logs and observers."""
    if name in VEHICLE_SCALES:
        scales[name] = value
    elif name in LOAD:
        deltas[name] = value
