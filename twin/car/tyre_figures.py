"""The few figures of a Magic Formula tyre that a car's file has: read, or written into it."""

import numpy as np

from twin.tyre.interface import relaxation, stiffness


def tyre_figures(tyre: np.void) -> dict[str, float]:
    """The figures of a tyre, by the names of the fields of `twin.car.fields` [SI].

    Args:
        tyre: a record of the Magic Formula.
    """
    load = float(tyre["fnomin"] * tyre["lfzo"])
    return {
        "friction": float(tyre["pdy1"] * tyre["lmuy"]),
        "load_sensitivity": float(-tyre["pdy2"] / tyre["pdy1"]),
        "cornering_coefficient": float(stiffness(tyre, load, 0.0)[1] / load),
        "relaxation_length": float(relaxation(tyre, load, 0.0)[1]),
        "radius": float(tyre["unloaded_radius"]),
        "vertical_stiffness": float(tyre["vertical_stiffness"]),
    }


def scale_tyre(
    tyre: np.ndarray,
    nominal_load: float | None = None,
    friction: float | None = None,
    load_sensitivity: float | None = None,
    cornering_coefficient: float | None = None,
    relaxation_length: float | None = None,
    radius: float | None = None,
    vertical_stiffness: float | None = None,
) -> None:
    """Changes a tyre in place so that it has these figures."""
    if nominal_load is not None:
        for key in ("fzmin", "fzmax"):
            tyre[key] *= nominal_load / tyre["fnomin"]
        tyre["fnomin"] = nominal_load
    if radius is not None:
        tyre["unloaded_radius"] = radius
    if vertical_stiffness is not None:
        tyre["vertical_stiffness"] = vertical_stiffness
    if load_sensitivity is not None:
        change = load_sensitivity + tyre["pdy2"] / tyre["pdy1"]
        for direction in "xy":
            tyre[f"pd{direction}2"] -= change * tyre[f"pd{direction}1"]
    load = float(tyre["fnomin"] * tyre["lfzo"])
    if friction is not None:
        factor = friction / (tyre["pdy1"] * tyre["lmuy"])
        tyre["lmux"] *= factor
        tyre["lmuy"] *= factor
    if cornering_coefficient is not None:
        tyre["lky"] *= cornering_coefficient * load / stiffness(tyre[()], load, 0.0)[1]
    if relaxation_length is not None:
        tyre["lsgal"] *= relaxation_length / relaxation(tyre[()], load, 0.0)[1]
