"""The keys of a tyre property file by section, and the bounds of their numbers."""

from twin.tyre.tir_6 import OPTIONAL, OPTIONAL_52, only_in_6


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
CONDITIONS = ("TIRE_CONDITIONS", "OPERATING_CONDITIONS", "INFLATION_PRESSURE")
CURVE = "DEFLECTION_LOAD_CURVE"
SECTIONS = {
    *("UNITS", "SCALING_COEFFICIENTS", CURVE, *CONDITIONS),
    *(*REQUIRED, *RANGES, *OPTIONAL, *OPTIONAL_52, *only_in_6()),
}
# Sections about the file itself, the wheel's inertia (the car's file has it), the shape of the
# carcass on rough roads and the tyre's own oscillations
QUIET_SECTIONS = {
    *("MDI_HEADER", "SHAPE", "INERTIA", "CONTACT_PATCH", "INFLATION_PRESSURE_RANGE", "PARAMETER"),
}
# Keys that say nothing about forces on a flat road, or only how a solver is to treat the file
HARMLESS = {
    "UNITS": words("PRESSURE"),
    "MODEL": words(
        "PROPERTY_FILE_FORMAT FITTYP TYPE FUNCTION_NAME VXLOW ROAD_INCREMENT ROAD_DIRECTION "
        "N_TIRE_STATES MFSAFE1 MFSAFE2 MFSAFE3 HMAX_LOCAL TIME_SWITCH_INTEG SWITCH_INTEG "
        "USER_SUB_ID FE_METHOD CONTACT_MODEL"
    ),
    "DIMENSION": words("ASPECT_RATIO RIM_RADIUS RIM_WIDTH BOTTOMING_RADIUS"),
    "VERTICAL": words("MC_CONTOUR_A MC_CONTOUR_B TIRE_MASS BOTTOM_OFFST BOTTOM_STIFF"),
    "STRUCTURAL": words(
        "YAW_STIFFNESS FREQ_LONG FREQ_LAT FREQ_YAW FREQ_WINDUP DAMP_LONG DAMP_LAT DAMP_YAW "
        "DAMP_WINDUP DAMP_RESIDUAL DAMP_VLOW Q_BVX Q_BVT PCMZ1"
    ),
}

# Coefficients of MF 5.2 that a file need not have, and what stands in for them
DEFAULTS = {
    **{"WIDTH": 0.0, "PDX3": 0.0},
    **{"PTX1": 0.55, "PTX2": 0.05, "PTX3": 0.0, "PTY1": 1.6, "PTY2": 2.0},  # those of suv.tir
}
RELAXATION = words("PTX1 PTX2 PTX3 PTY1 PTY2")

POSITIVE = (1e-3, 1e3)
NOT_NEGATIVE = (0.0, 1e3)
ANY = (-1e4, 1e4)  # a typing error, not a coefficient, lies outside
LIMITS = {
    "LFZO": (0.1, 10.0),
    **dict.fromkeys(words("LCX LMUX LKX LCY LMUY LKY"), (0.01, 10.0)),
    **dict.fromkeys(words("LXAL LYKA LTR LSGKP LSGAL LMY"), NOT_NEGATIVE),
    **dict.fromkeys(words("BREFF DREFF"), NOT_NEGATIVE),
    "FREFF": (-10.0, 1e3),
    "LCZ": (0.01, 10.0),
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
    **dict.fromkeys(words("INFLPRES NOMPRES IP IP_NOM"), (1e3, 1e7)),
    "Q_RE0": (0.5, 1.5),
    "QSY7": (-5.0, 5.0),
    "QSY8": (-5.0, 5.0),
}
