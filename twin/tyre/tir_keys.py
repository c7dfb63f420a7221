"""The keys of a tyre property file by section, and the bounds of their numbers."""

from twin.tyre.tir_6 import OPTIONAL, only_in_6


def words(text: str) -> tuple[str, ...]:
    """The words of a text."""
    return tuple(text.split())


SCALING = words(
    "LFZO LCX LMUX LEX LKX LHX LVX LGAX LCY LMUY LEY LKY LHY LVY LGAY LTR LRES LGAZ "
    "LXAL LYKA LVYKA LS LSGKP LSGAL LMX LVMX LMY"
)
REQUIRED = {
    "MODEL": ("LONGVL",),
    "DIMENSION": words("UNLOADED_RADIUS WIDTH"),
    "VERTICAL": words("VERTICAL_STIFFNESS VERTICAL_DAMPING BREFF DREFF FREFF FNOMIN"),
    "LONGITUDINAL_COEFFICIENTS": words(
        "PCX1 PDX1 PDX2 PDX3 PEX1 PEX2 PEX3 PEX4 PKX1 PKX2 PKX3 PHX1 PHX2 PVX1 PVX2 "
        "RBX1 RBX2 RCX1 REX1 REX2 RHX1 PTX1 PTX2 PTX3"
    ),
    "OVERTURNING_COEFFICIENTS": ("QSX1", "QSX2", "QSX3"),
    "LATERAL_COEFFICIENTS": words(
        "PCY1 PDY1 PDY2 PDY3 PEY1 PEY2 PEY3 PEY4 PKY1 PKY2 PKY3 PHY1 PHY2 PHY3 "
        "PVY1 PVY2 PVY3 PVY4 RBY1 RBY2 RBY3 RCY1 REY1 REY2 RHY1 RHY2 "
        "RVY1 RVY2 RVY3 RVY4 RVY5 RVY6 PTY1 PTY2"
    ),
    "ROLLING_COEFFICIENTS": ("QSY1", "QSY2", "QSY3", "QSY4"),
    "ALIGNING_COEFFICIENTS": words(
        "QBZ1 QBZ2 QBZ3 QBZ4 QBZ5 QBZ9 QBZ10 QCZ1 QDZ1 QDZ2 QDZ3 QDZ4 QDZ6 QDZ7 QDZ8 QDZ9 "
        "QEZ1 QEZ2 QEZ3 QEZ4 QEZ5 QHZ1 QHZ2 QHZ3 QHZ4 SSZ1 SSZ2 SSZ3 SSZ4"
    ),
}
RANGES = {
    "LONG_SLIP_RANGE": ("KPUMIN", "KPUMAX"),
    "SLIP_ANGLE_RANGE": ("ALPMIN", "ALPMAX"),
    "INCLINATION_ANGLE_RANGE": ("CAMMIN", "CAMMAX"),
    "VERTICAL_FORCE_RANGE": ("FZMIN", "FZMAX"),
}
SECTIONS = {"UNITS", "SCALING_COEFFICIENTS", *REQUIRED, *RANGES, *OPTIONAL, *only_in_6()}

POSITIVE = (1e-3, 1e3)
NOT_NEGATIVE = (0.0, 1e3)
ANY = (-1e4, 1e4)  # a typing error, not a coefficient, lies outside
LIMITS = {
    "LFZO": (0.1, 10.0),
    **dict.fromkeys(words("LCX LMUX LKX LCY LMUY LKY"), (0.01, 10.0)),
    **dict.fromkeys(words("LXAL LYKA LTR LSGKP LSGAL LMY BREFF DREFF FREFF"), NOT_NEGATIVE),
    **dict.fromkeys(words("PDX1 PKX1 PTX1 PDY1 PKY2 PTY1 PTY2 LONGVL"), POSITIVE),
    **dict.fromkeys(words("UNLOADED_RADIUS WIDTH"), (1e-2, 1e1)),
    **dict.fromkeys(words("PCX1 PCY1"), (0.1, 2.0)),  # from 2 on the sliding force turns round
    **dict.fromkeys(words("PKX3 PTX3"), (-5.0, 5.0)),  # exponents
    "PKY1": (-1e3, -1e-3),  # ISO-W sign
    "VERTICAL_STIFFNESS": (1e3, 1e8),
    "VERTICAL_DAMPING": (0.0, 1e6),
    "FNOMIN": (1e1, 1e6),
}
LIMITS_6 = {
    "PKY4": (0.1, 5.0),
    **dict.fromkeys(words("LONGITUDINAL_STIFFNESS LATERAL_STIFFNESS"), (1e3, 1e8)),
    **dict.fromkeys(words("INFLPRES NOMPRES"), (1e3, 1e7)),
    "Q_RE0": (0.5, 1.5),
    "QSY7": (-5.0, 5.0),
    "QSY8": (-5.0, 5.0),
}
