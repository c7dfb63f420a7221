"""Reads tyre property files (.tir) of the Magic Formula MF 5.2 (PAC2002), 6.1 and 6.2.

Sign convention, stated once: a file is in ISO-W (TYDEX W) axes, x forward, y left, z up, so that
PKY1 < 0 and a positive slip angle gives a negative lateral force. That is the convention of this
project, hence nothing is converted; a file in another one (PKY1 >= 0) is refused.

What a file holds and the model leaves out is named in one warning, as is what stands in for
relaxation lengths that are missing.
"""

import math
import warnings
from pathlib import Path

import numpy as np

from twin.errors import TwinWarning
from twin.tyre.record import TYRE_DTYPE
from twin.tyre.tir_6 import (
    EXTRA_SCALING,
    OPTIONAL,
    OPTIONAL_52,
    only_in_6,
    only_in_52,
    settle,
    settle_52,
)
from twin.tyre.tir_keys import (
    CONDITIONS,
    DEFAULTS,
    LIMITS_6,
    RANGES,
    RELAXATION,
    REQUIRED,
    SCALING,
)
from twin.tyre.tir_text import TirFile

UNITS = {
    "LENGTH": ("METER", "M"),
    "FORCE": ("NEWTON", "N"),
    "ANGLE": ("RADIAN", "RADIANS", "RAD"),
    "MASS": ("KG", "KILOGRAM"),
    "TIME": ("SECOND", "SEC", "S"),
}
PRESSURE = ("PASCAL", "PA")
MODELS = ("6", "52", "PAC2002")  # names of MF 5.2 in the FITTYP of common files
MODELS_6 = ("61", "62")
SIDES = {"LEFT": 1.0, "RIGHT": -1.0}
FACTORS = "SCALING_COEFFICIENTS"
# Digits of USE_MODE: which forces, and whether they lag behind the slip
UNCOMBINED, COMBINED, COMBINED_WITH_TURN_SLIP = 3, 4, 5


def read_tyre(path: str | Path) -> np.void:
    """Reads a tyre.

    Scaling factors and ranges may be missing (1; up to 0.26 rad, 2 % to 300 % of the nominal
    load), as may what `twin.tyre.tir_keys.DEFAULTS` names; any other coefficient may not.

    Args:
        path: the .tir file.

    Returns:
        A record of TYRE_DTYPE; fields are written as `tyre["pcx1"]` here, `tyre.pcx1` in compiled
        code.

    Raises:
        TwinError: the file cannot be read, or is no tyre of these models in SI units and ISO-W
            signs; the message names the section, key, value and what is allowed, or everything
            that is missing.
    """
    file = TirFile(path)
    _check_units(file)
    is_6 = _is_6(file)
    tyre = np.zeros(1, TYRE_DTYPE)
    left_out = only_in_52() if is_6 else ()
    notes = [] if is_6 else _relaxation_notes(file)
    for section, keys in REQUIRED.items():
        for key in keys:
            if key not in left_out:
                tyre[key.lower()] = file.number(section, key, _default(file, key))
    for key in SCALING:
        tyre[key.lower()] = file.number(FACTORS, key, 1.0)
    further = _further_6(file) if is_6 else _further_52(file)
    file.check_missing()
    tyre["side"] = _side(file)
    _set_ranges(file, tyre)
    notes += _set_vertical_stiffness(file, tyre)
    notes += _set_mode(file, tyre)
    if is_6:
        settle(tyre, further)
    else:
        settle_52(tyre, further)
    _check_stiffnesses(file, tyre)
    if unused := file.unused():
        notes.append(f"not used: {unused}")
    if notes:
        warnings.warn(f"{str(path)!r}: {'; '.join(notes)}", TwinWarning, stacklevel=2)
    return tyre[0]


def _default(file: TirFile, key: str) -> float | None:
    if key == "VERTICAL_STIFFNESS" and len(file.curve) > 1:
        return 1.0  # replaced by the curve's
    return DEFAULTS.get(key)


def _relaxation_notes(file: TirFile) -> list[str]:
    places = {key: section for section, keys in REQUIRED.items() for key in keys}
    missing = [key for key in RELAXATION if not file.has(places[key], key)]
    if not missing:
        return []
    values = ", ".join(f"{key} = {DEFAULTS[key]:g}" for key in missing)
    return [f"has no relaxation lengths of its own: {values}"]


def _further_6(file: TirFile) -> dict[str, float]:
    """What MF 6 has beyond MF 5.2, by key."""
    values: dict[str, float] = {}
    for section, keys in only_in_6().items():
        for key in keys:
            values[key] = file.number(section, key, limits=LIMITS_6.get(key))
    for section, defaults in OPTIONAL.items():
        for key, default in defaults.items():
            values[key] = file.number(section, key, default, LIMITS_6.get(key))
    for key, default in EXTRA_SCALING.items():
        values[key] = file.number(FACTORS, key, default)
    if values["LMUV"] != 0.0:
        file.refuse(f"[{FACTORS}] LMUV = {values['LMUV']:g}, only 0 is allowed")
    return values


def _further_52(file: TirFile) -> dict[str, float]:
    """What later versions of PAC2002 add to MF 5.2, by key; pressures by their names in MF 6."""
    values: dict[str, float] = {}
    for section, defaults in OPTIONAL_52.items():
        for key, default in defaults.items():
            values[key] = file.number(section, key, default, LIMITS_6.get(key))
    values["LKYG"] = file.number(FACTORS, "LKYG", 1.0)
    for key, names in (("INFLPRES", ("IP", "INFLPRES")), ("NOMPRES", ("IP_NOM", "NOMPRES"))):
        given = [(s, name) for s in CONDITIONS for name in names if file.has(s, name)]
        values[key] = file.number(*given[0], limits=LIMITS_6[key]) if given else 0.0
    return values


def _check_stiffnesses(file: TirFile, tyre: np.ndarray) -> None:
    keys = ["pkx1", "pdx1", "pdy1", "pky2", "vertical_stiffness"]
    keys += ["longitudinal_stiffness"] if tyre["mf6"] else []
    for key in keys:
        if not tyre[key] > 0.0:
            file.refuse(f"{key.upper()} at INFLPRES is {tyre[key][0]:g}, must be positive")
    if not (tyre["pky1"] < 0.0 and (tyre["lateral_stiffness"] > 0.0 or not tyre["mf6"])):
        file.refuse("PKY1 at INFLPRES must be negative and LATERAL_STIFFNESS positive")


def _check_units(file: TirFile) -> None:
    for key, allowed in UNITS.items():
        unit = file.word("UNITS", key)
        if unit and unit.upper() not in allowed:
            file.refuse(f"[UNITS] {key} = {unit[:40]!r}, only {allowed[0].lower()!r} is allowed")
    unit = file.word("UNITS", "PRESSURE", PRESSURE[0])
    if unit.upper() not in PRESSURE and any(place[0] in CONDITIONS for place in file.values):
        file.refuse(f"[UNITS] PRESSURE = {unit[:40]!r}, only 'pascal' is allowed")


def _is_6(file: TirFile) -> bool:
    """Checks FITTYP, or PROPERTY_FILE_FORMAT where a file (of Adams) has no FITTYP."""
    key = "FITTYP"
    if not file.has("MODEL", key) and file.has("MODEL", "PROPERTY_FILE_FORMAT"):
        key = "PROPERTY_FILE_FORMAT"
    model = file.word("MODEL", key).upper()
    if model and model not in (*MODELS, *MODELS_6):
        file.refuse(
            f"[MODEL] {key} = {model[:40]!r}, allowed are {', '.join(MODELS)} (all MF 5.2), "
            f"{', '.join(MODELS_6)} (MF 6.1 and 6.2)"
        )
    return model in MODELS_6


def _side(file: TirFile) -> float:
    side = file.word("MODEL", "TYRESIDE", "LEFT")
    if side.upper() not in SIDES:
        file.refuse(f"[MODEL] TYRESIDE = {side[:40]!r}, allowed are {', '.join(SIDES)}")
    return SIDES[side.upper()]


def _set_mode(file: TirFile, tyre: np.ndarray) -> list[str]:
    """Heeds USE_MODE: its last digit says which forces there are, the one before whether they lag.

    Returns:
        What is to be said about it.
    """
    tyre["combined"] = 1.0
    given = abs(file.number("MODEL", "USE_MODE", 14.0, (-1e5, 1e5)))
    forces, lag = int(given) % 10, int(given) // 10 % 10
    if given != int(given) or forces not in (UNCOMBINED, COMBINED, COMBINED_WITH_TURN_SLIP):
        file.refuse(
            f"[MODEL] USE_MODE = {given:g}, allowed are those with longitudinal and lateral "
            "forces: 3, 4, 5, 13, 14, 15"
        )
    if forces == UNCOMBINED:
        tyre["combined"] = tyre["lxal"] = tyre["lyka"] = tyre["lvyka"] = tyre["ls"] = 0.0
    if lag == 0:
        tyre["lsgkp"] = tyre["lsgal"] = 0.0
        return [f"USE_MODE = {given:g} leaves out the relaxation of slip"]
    return []


def _set_vertical_stiffness(file: TirFile, tyre: np.ndarray) -> list[str]:
    """The secant of the load curve at the nominal load, if there is one, times LCZ.

    Returns:
        What is to be said about it.
    """
    notes = []
    if len(file.curve) > 1:
        penetrations, loads = np.transpose(file.curve)
        nominal = float(tyre["fnomin"][0])
        if not loads[0] <= nominal <= loads[-1] * 10.0 or loads[-1] <= loads[-2]:
            file.refuse(f"[DEFLECTION_LOAD_CURVE] does not reach FNOMIN = {nominal:g} N")
        last = (loads[-1] - loads[-2]) / (penetrations[-1] - penetrations[-2])
        beyond = penetrations[-1] + (nominal - loads[-1]) / last
        depth = beyond if nominal > loads[-1] else np.interp(nominal, loads, penetrations)
        stiffness = nominal / depth if depth > 0.0 else math.nan
        if not 1e3 <= stiffness <= 1e8:
            file.refuse("[DEFLECTION_LOAD_CURVE] has no positive deflection at FNOMIN")
        bent = np.abs(loads - stiffness * penetrations).max() / nominal
        if bent > 0.02:
            notes.append(
                f"[DEFLECTION_LOAD_CURVE] is used as a straight line of {stiffness:.0f} N/m, "
                f"right at FNOMIN, up to {100.0 * bent:.0f} % of FNOMIN off elsewhere"
            )
        tyre["vertical_stiffness"] = stiffness
    tyre["vertical_stiffness"] *= file.number(FACTORS, "LCZ", 1.0)
    return notes


def _set_ranges(file: TirFile, tyre: np.ndarray) -> None:
    """Checks that each range given is one, and keeps those of inclination and load."""
    nominal = float(tyre["fnomin"][0])
    tyre["cammax"] = math.radians(15.0)
    tyre["fzmin"], tyre["fzmax"] = 0.02 * nominal, 3.0 * nominal
    for section, (least_key, largest_key) in RANGES.items():
        if not any(place[0] == section for place in file.values):
            continue
        least = file.number(section, least_key, limits=(-1e6, 1e6))
        largest = file.number(section, largest_key, limits=(-1e6, 1e6))
        file.check_missing()
        if least >= largest:
            file.refuse(f"[{section}] {least_key} = {least:g} must be below {largest:g}")
        if section == "INCLINATION_ANGLE_RANGE":
            tyre["cammax"] = min(max(-least, largest), 0.5 * math.pi)
        elif section == "VERTICAL_FORCE_RANGE":
            if largest < 0.05 * nominal:
                file.refuse(
                    f"[{section}] FZMAX = {largest:g}, allowed is 5 % of FNOMIN = {nominal:g} "
                    "or more"
                )
            tyre["fzmax"] = min(largest, 10.0 * nominal)
            tyre["fzmin"] = min(max(least, 0.01 * nominal), nominal, 0.5 * largest)
