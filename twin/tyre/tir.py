"""Reads tyre property files (.tir) of the Magic Formula MF 5.2 (PAC2002), 6.1 and 6.2.

Sign convention, stated once: a file is in ISO-W (TYDEX W) axes, x forward, y left, z up, so that
PKY1 < 0 and a positive slip angle gives a negative lateral force. That is the convention of this
project, hence nothing is converted; a file in another one (PKY1 >= 0) is refused.
"""

import math
from pathlib import Path
from typing import NoReturn

import numpy as np

from twin.errors import TwinError
from twin.tyre.record import TYRE_DTYPE
from twin.tyre.tir_6 import EXTRA_SCALING, OPTIONAL, only_in_6, only_in_52, settle
from twin.tyre.tir_keys import ANY, LIMITS, LIMITS_6, RANGES, REQUIRED, SCALING, SECTIONS

LARGEST_FILE = 1_000_000  # bytes; real files have some 20 kB

UNITS = {
    "LENGTH": ("METER", "M"),
    "FORCE": ("NEWTON", "N"),
    "ANGLE": ("RADIAN", "RADIANS", "RAD"),
    "MASS": ("KG", "KILOGRAM"),
    "TIME": ("SECOND", "SEC", "S"),
}
MODELS = ("6", "52", "PAC2002")  # names of MF 5.2 in the FITTYP of common files
MODELS_6 = ("61", "62")
SIDES = {"LEFT": 1.0, "RIGHT": -1.0}


Entries = dict[tuple[str, str], str]


def read_tyre(path: str | Path) -> np.void:
    """Reads a tyre.

    Scaling factors and ranges may be missing (1; up to 0.26 rad, 2 % to 300 % of the nominal
    load), any other coefficient may not.

    Args:
        path: the .tir file.

    Returns:
        A record of TYRE_DTYPE; fields are written as `tyre["pcx1"]` here, `tyre.pcx1` in compiled
        code.

    Raises:
        TwinError: the file cannot be read, or is no tyre of these models in SI units and ISO-W
            signs; the message names the section, key, value and what is allowed.
    """
    entries = _entries(path, _text(path))
    _check_units(path, entries)
    is_6 = _is_6(path, entries)
    tyre = np.zeros(1, TYRE_DTYPE)
    left_out = only_in_52() if is_6 else ()
    for section, keys in REQUIRED.items():
        for key in keys:
            if key not in left_out:
                tyre[key.lower()] = _number(path, entries, section, key)
    for key in SCALING:
        tyre[key.lower()] = _number(path, entries, "SCALING_COEFFICIENTS", key, 1.0)
    tyre["side"] = _side(path, entries)
    _set_ranges(path, entries, tyre)
    if is_6:
        _complete_6(path, entries, tyre)
    return tyre[0]


def _complete_6(path: str | Path, entries: Entries, tyre: np.ndarray) -> None:
    """Adds what MF 6 has beyond MF 5.2, at the inflation pressure of the file."""
    values: dict[str, float] = {}
    for section, keys in only_in_6().items():
        for key in keys:
            values[key] = _number(path, entries, section, key, limits=LIMITS_6.get(key))
    for section, defaults in OPTIONAL.items():
        for key, default in defaults.items():
            values[key] = _number(path, entries, section, key, default, LIMITS_6.get(key))
    for key, default in EXTRA_SCALING.items():
        values[key] = _number(path, entries, "SCALING_COEFFICIENTS", key, default)
    if values["LMUV"] != 0.0:
        _refuse(path, f"[SCALING_COEFFICIENTS] LMUV = {values['LMUV']:g}, only 0 is allowed")
    settle(tyre, values)
    for key in ("pkx1", "pdx1", "pdy1", "pky2", "vertical_stiffness", "longitudinal_stiffness"):
        if not tyre[key] > 0.0:
            _refuse(path, f"{key.upper()} at INFLPRES is {tyre[key][0]:g}, must be positive")
    if not (tyre["pky1"] < 0.0 and tyre["lateral_stiffness"] > 0.0):
        _refuse(path, "PKY1 at INFLPRES must be negative and LATERAL_STIFFNESS positive")


def _text(path: str | Path) -> str:
    """Returns the text of the file; every byte is a character of latin-1, so this never fails."""
    try:
        with Path(path).open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = getattr(error, "strerror", None) or error
        raise TwinError(f"{str(path)!r}: cannot read the tyre file: {reason}") from error
    if len(content) > LARGEST_FILE:
        _refuse(path, f"larger than {LARGEST_FILE} bytes, which no tyre property file is")
    return content.decode("latin-1")


def _entries(path: str | Path, text: str) -> Entries:
    """Returns the values of the known sections by (section, key), both in upper case."""
    entries: Entries = {}
    section = ""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")  # splitlines: also at 0x85
    for number, line in enumerate(lines, start=1):
        line = _without_comment(line).strip()
        if line.startswith("["):
            section = line.strip("[] \t").upper()
        elif line and section in SECTIONS:
            key, equals, value = line.partition("=")
            place = (section, key.strip().upper())
            if not equals:
                _refuse(path, f"line {number}: {line[:40]!r} in [{section}] is not KEY = value")
            if place in entries:
                _refuse(path, f"line {number}: [{section}] {place[1][:40]!r} is given twice")
            entries[place] = value.strip().strip("'\"").strip()
    return entries


def _without_comment(line: str) -> str:
    """Returns the line up to the first $ or ! that stands outside quotes."""
    quote = ""
    for position, character in enumerate(line):
        if quote:
            quote = "" if character == quote else quote
        elif character in "'\"":
            quote = character
        elif character in "$!":
            return line[:position]
    return line


def _check_units(path: str | Path, entries: Entries) -> None:
    for key, allowed in UNITS.items():
        unit = _word(path, entries, "UNITS", key)
        if unit.upper() not in allowed:
            _refuse(path, f"[UNITS] {key} = {unit[:40]!r}, only {allowed[0].lower()!r} is allowed")


def _is_6(path: str | Path, entries: Entries) -> bool:
    """Checks FITTYP, or PROPERTY_FILE_FORMAT where a file (of Adams) has no FITTYP."""
    key = "FITTYP"
    if ("MODEL", key) not in entries and ("MODEL", "PROPERTY_FILE_FORMAT") in entries:
        key = "PROPERTY_FILE_FORMAT"
    model = _word(path, entries, "MODEL", key).upper()
    if model not in (*MODELS, *MODELS_6):
        _refuse(
            path,
            f"[MODEL] {key} = {model[:40]!r}, allowed are {', '.join(MODELS)} (all MF 5.2), "
            f"{', '.join(MODELS_6)} (MF 6.1 and 6.2)",
        )
    return model in MODELS_6


def _side(path: str | Path, entries: Entries) -> float:
    side = entries.get(("MODEL", "TYRESIDE"), "LEFT")
    if side.upper() not in SIDES:
        _refuse(path, f"[MODEL] TYRESIDE = {side[:40]!r}, allowed are {', '.join(SIDES)}")
    return SIDES[side.upper()]


def _set_ranges(path: str | Path, entries: Entries, tyre: np.ndarray) -> None:
    """Checks that each range given is one, and keeps those of inclination and load."""
    nominal = float(tyre["fnomin"][0])
    tyre["cammax"] = math.radians(15.0)
    tyre["fzmin"], tyre["fzmax"] = 0.02 * nominal, 3.0 * nominal
    for section, (least_key, largest_key) in RANGES.items():
        if not any(place[0] == section for place in entries):
            continue
        least = _number(path, entries, section, least_key, limits=(-1e6, 1e6))
        largest = _number(path, entries, section, largest_key, limits=(-1e6, 1e6))
        if least >= largest:
            _refuse(path, f"[{section}] {least_key} = {least:g} must be below {largest:g}")
        if section == "INCLINATION_ANGLE_RANGE":
            tyre["cammax"] = min(max(-least, largest), 0.5 * math.pi)
        elif section == "VERTICAL_FORCE_RANGE":
            if largest < nominal:
                _refuse(
                    path, f"[{section}] FZMAX = {largest:g} must be FNOMIN = {nominal:g} or more"
                )
            tyre["fzmin"] = min(max(least, 0.01 * nominal), nominal)
            tyre["fzmax"] = min(largest, 10.0 * nominal)


def _word(path: str | Path, entries: Entries, section: str, key: str) -> str:
    if (section, key) not in entries:
        known = any(place[0] == section for place in entries)
        _refuse(path, f"[{section}] {key} is missing" if known else f"[{section}] is missing")
    return entries[section, key]


def _number(
    path: str | Path,
    entries: Entries,
    section: str,
    key: str,
    default: float | None = None,
    limits: tuple[float, float] | None = None,
) -> float:
    if default is not None and (section, key) not in entries:
        return default
    word = _word(path, entries, section, key)
    least, largest = limits or LIMITS.get(key, ANY)
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not least <= value <= largest:
        allowed = f"a number from {least:g} to {largest:g}"
        if key == "PKY1":
            allowed += " (ISO-W sign: a positive slip angle gives a negative lateral force)"
        _refuse(path, f"[{section}] {key} = {word[:40]!r}, allowed is {allowed}")
    return value


def _refuse(path: str | Path, what: str) -> NoReturn:
    raise TwinError(f"{str(path)!r}: {what}")
