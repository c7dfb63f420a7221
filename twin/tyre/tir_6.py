"""What MF 6.1 and 6.2, and later PAC2002, have beyond MF 5.2, brought into one record.

Inflation pressure is constant in a drive: its terms are worked into the coefficients that they
multiply, so that the compiled formula has none. Turn slip is left out (a car's wheels turn far
slower than they roll), as is friction that falls with sliding speed (LMUV) and the growth of the
tyre with speed; the vertical stiffness is that at the nominal load. In steady state 6.2 is 6.1.

Sources: Pacejka, *Tyre and Vehicle Dynamics*, 3rd ed., 2012, section 4.3.2 ("book"); Besselink,
Schmeitz, Pacejka, *An improved Magic Formula/Swift tyre model that can handle inflation pressure
changes*, Vehicle System Dynamics 48, 2010 ("paper").
"""

import numpy as np


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.split())


# Coefficients without which a file is no tyre of MF 6; others are 0, or as here
_NEEDED = {
    "STRUCTURAL": _words("LONGITUDINAL_STIFFNESS LATERAL_STIFFNESS"),
    "LATERAL_COEFFICIENTS": _words("PKY4 PKY6"),
}
OPTIONAL = {
    "OPERATING_CONDITIONS": {"INFLPRES": 0.0, "NOMPRES": 0.0},
    "VERTICAL": {"Q_RE0": 1.0, "PFZ1": 0.0},
    "STRUCTURAL": dict.fromkeys(_words("PCFX1 PCFX2 PCFX3 PCFY1 PCFY2 PCFY3"), 0.0),
    "LONGITUDINAL_COEFFICIENTS": dict.fromkeys(_words("PPX1 PPX2 PPX3 PPX4 RBX3"), 0.0),
    "OVERTURNING_COEFFICIENTS": dict.fromkeys(
        _words("PPMX1 QSX4 QSX5 QSX6 QSX7 QSX8 QSX9 QSX10 QSX11 QSX12 QSX13 QSX14"), 0.0
    ),
    "LATERAL_COEFFICIENTS": dict.fromkeys(
        _words("PEY5 PKY5 PKY7 PPY1 PPY2 PPY3 PPY4 PPY5 RBY4"), 0.0
    ),
    "ROLLING_COEFFICIENTS": {"QSY5": 0.0, "QSY6": 0.0, "QSY7": 1.0, "QSY8": 0.0},
    "ALIGNING_COEFFICIENTS": dict.fromkeys(_words("PPZ1 PPZ2 QDZ10 QDZ11"), 0.0),
}
# Of MF 5.2 in later versions of PAC2002: Adams/Tire's manual; implemented in Project Chrono, too
OPTIONAL_52 = {
    "VERTICAL": {"QPFZ1": 0.0},
    "LONGITUDINAL_COEFFICIENTS": dict.fromkeys(_words("PPX1 PPX2 PPX3 PPX4"), 0.0),
    "OVERTURNING_COEFFICIENTS": dict.fromkeys(
        _words("QPX1 QSX4 QSX5 QSX6 QSX7 QSX8 QSX9 QSX10 QSX11"), 0.0
    ),
    "LATERAL_COEFFICIENTS": dict.fromkeys(_words("PPY1 PPY2 PPY3 PPY4"), 0.0),
    "ROLLING_COEFFICIENTS": dict.fromkeys(_words("QSY5 QSY6 QSY7 QSY8"), 0.0),
    "ALIGNING_COEFFICIENTS": dict.fromkeys(_words("QPZ1 QPZ2"), 0.0),
}
_NAMES_IN_6 = {"QPFZ1": "PFZ1", "QPX1": "PPMX1", "QPZ1": "PPZ1", "QPZ2": "PPZ2"}
EXTRA_SCALING = {"LKYC": 1.0, "LKZC": 1.0, "LMUV": 0.0}

_KEPT = _words(
    "PEY5 PKY4 PKY5 PKY6 PKY7 RBX3 RBY4 QDZ10 QDZ11 QSY5 QSY6 QSY7 "
    "QSX4 QSX5 QSX6 QSX7 QSX8 QSX9 QSX10 QSX11 QSX12 QSX13 QSX14 "
    "LONGITUDINAL_STIFFNESS LATERAL_STIFFNESS PCFX1 PCFX2 PCFY1 PCFY2"
)
FIELDS = ("mf6", "further_mx", "further_my", "growth", *(key.lower() for key in _KEPT))
"""Fields of `twin.tyre.record.TYRE_DTYPE` that are 0 in plain MF 5.2: mf6 is 1; further_mx and
further_my are 1 where there are more terms of M_x (from q_Sx4 on) and M_y (from q_Sy5 on); growth
[m] is added to the rolling radius; the others are coefficients."""


def only_in_6() -> dict[str, tuple[str, ...]]:
    """Keys by section that a file of MF 6 must have and one of MF 5.2 has not."""
    return _NEEDED


def only_in_52() -> tuple[str, ...]:
    """Keys that a file of MF 6 has not: relaxation lengths, camber's horizontal shift."""
    return _words("PTX1 PTX2 PTX3 PHY3 PTY1 PTY2")


def settle(tyre: np.ndarray, values: dict[str, float]) -> None:
    """Completes a record (1,) of MF 6 in place.

    Args:
        tyre: with the coefficients that MF 5.2 has, too.
        values: the others, by their keys.
    """
    for key in _KEPT:
        tyre[key.lower()] = values[key]
    tyre["mf6"] = tyre["further_mx"] = tyre["further_my"] = 1.0
    tyre["pty2"] = 1.0  # unused, but divided by where tyres of both kinds are computed at once
    tyre["growth"] = tyre["unloaded_radius"] * (values["Q_RE0"] - 1.0)
    # MF 6 scales camber's forces and moments (book, 4.E28, 4.E30, 4.E47), MF 5.2 the angle
    for key in ("lgax", "lgay", "lgaz"):
        tyre[key] = 1.0
    for key in ("pvy3", "pvy4", "pky6", "pky7"):
        tyre[key] *= values["LKYC"]
    for key in ("qdz8", "qdz9", "qdz10", "qdz11"):
        tyre[key] *= values["LKZC"]
    tyre["lvmx"] *= tyre["lmx"]  # (4.E69)
    if values["INFLPRES"] and values["NOMPRES"]:
        _inflate(tyre, values)


def settle_52(tyre: np.ndarray, values: dict[str, float]) -> None:
    """Completes a record (1,) of MF 5.2 in place with what later versions of PAC2002 added.

    Args:
        tyre: with the coefficients of MF 5.2.
        values: by key: LKYG, INFLPRES and NOMPRES [Pa], 0 where unknown, and those of OPTIONAL_52.
    """
    v = {key: 0.0 for keys in OPTIONAL.values() for key in keys}
    v |= {_NAMES_IN_6.get(key, key): value for key, value in values.items()}
    for key in OPTIONAL_52["OVERTURNING_COEFFICIENTS"]:
        if key in _KEPT:
            tyre[key.lower()] = v[key]
    tyre["further_mx"] = float(v["QSX4"] != 0.0 or v["QSX10"] != 0.0)
    # there the load's power comes on top of the load itself
    tyre["qsy5"], tyre["qsy6"], tyre["qsy7"] = v["QSY5"], v["QSY6"], 1.0 + v["QSY7"]
    tyre["further_my"] = float(any(v[key] != 0.0 for key in ("QSY5", "QSY6", "QSY7")))
    for key in ("phy3", "pvy3", "pvy4"):
        tyre[key] *= v["LKYG"]
    if v["INFLPRES"] and v["NOMPRES"]:
        _inflate(tyre, v)


def _inflate(tyre: np.ndarray, v: dict[str, float]) -> None:
    """Works the pressure, book (4.E2b), into what it multiplies."""
    ratio = v["INFLPRES"] / v["NOMPRES"]
    dpi = ratio - 1.0
    factors = {
        ("pkx1", "pkx2"): 1.0 + v["PPX1"] * dpi + v["PPX2"] * dpi**2,  # (4.E15)
        ("pdx1", "pdx2"): 1.0 + v["PPX3"] * dpi + v["PPX4"] * dpi**2,  # (4.E13)
        ("pky1",): 1.0 + v["PPY1"] * dpi,  # (4.E25)
        ("pky2", "pky5"): 1.0 + v["PPY2"] * dpi,
        ("pdy1", "pdy2"): 1.0 + v["PPY3"] * dpi + v["PPY4"] * dpi**2,  # (4.E23)
        ("pky6", "pky7"): 1.0 + v["PPY5"] * dpi,  # (4.E30)
        ("qdz1", "qdz2"): 1.0 - v["PPZ1"] * dpi,  # (4.E42)
        ("qdz8", "qdz9"): 1.0 + v["PPZ2"] * dpi,  # (4.E47)
        ("qsx2",): 1.0 + v["PPMX1"] * dpi,  # (4.E69)
        ("lmy",): ratio ** v["QSY8"],  # (4.E70)
        ("vertical_stiffness",): 1.0 + v["PFZ1"] * dpi,  # paper (5)
    }
    for keys, factor in factors.items():
        for key in keys:
            tyre[key] *= factor
    # paper (14), (15): stiffness (1 + a dfz + b dfz^2 + c dpi)
    for name, axis in (("longitudinal", "x"), ("lateral", "y")):
        inflated = 1.0 + v[f"PCF{axis.upper()}3"] * dpi
        tyre[f"{name}_stiffness"] *= inflated
        for order in (1, 2):
            tyre[f"pcf{axis}{order}"] /= inflated if inflated else 1.0
