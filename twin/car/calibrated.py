"""Cars that a calibration found: a TOML file that names another car and what differs from it.

    vehicle = "suv"                       # a car's name, or its file beside this one
    [values.front_cornering_stiffness]    # a factor of `twin.scales.VEHICLE_SCALES`
    value = 1.04
    [values.mass]                         # a delta of `twin.LOAD`
    value = 85.0

`til calibrate` writes it. Other values (offsets of sensors, noises of an observer) belong to logs
and observers: they are kept with the vehicle, which does not read them.
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
        further: all other values by name.
    """

    base: str
    scales: dict[str, float]
    deltas: dict[str, float]
    further: dict[str, float]


def calibrated_of(path: Path, table: Table) -> Calibrated | None:
    """What a TOML file says of another car; None if it describes a car itself.

    Raises:
        TwinError: a value is no number.
    """
    base = table.values.get("vehicle")
    if not isinstance(base, str):
        return None
    values = {name: float(value) for name, value in table.table("fixed").values.items()}
    for name, entry in table.table("values").tables():
        values[name] = entry.number("value", 0.0, -1e6, 1e6)
    beside = path.parent / base
    return Calibrated(
        base=str(beside) if beside.is_file() else base,
        scales={name: value for name, value in values.items() if name in VEHICLE_SCALES},
        deltas={name: value for name, value in values.items() if name in LOAD},
        further={n: v for n, v in values.items() if n not in VEHICLE_SCALES and n not in LOAD},
    )
