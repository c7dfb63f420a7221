"""What a car makes of the signals that its log has: the table [signals] of its file, and its own
steering ratio and wheel radius.
"""  # noqa: D205

import numpy as np

from twin.car.vehicle import Vehicle
from twin.logs.car_signals import CarSignals
from twin.toml_file import read_toml

_DEFLECTED = 1.0 / 3.0  # of the tyre's deflection by which a free-rolling radius is less; chosen


def signals_of(vehicle: Vehicle) -> CarSignals:
    """The signals of a car.

    Raises:
        TwinError: its files are missing or broken.
    """
    model = vehicle.compile()
    tyres = vehicle.tyres()
    load = 0.25 * 9.81 * float(model.body_subtreemass[0])
    deflection = load / np.asarray(tyres["vertical_stiffness"])
    radius = np.mean(np.asarray(tyres["unloaded_radius"]) - _DEFLECTED * deflection)
    known = CarSignals(
        steering_ratio=float(model.numeric("steering_ratio").data[0]), radius=float(radius)
    )
    if vehicle.source.suffix != ".toml":
        return known
    return CarSignals.of(read_toml(vehicle.source).table("signals"), known)
