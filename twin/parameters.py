"""What a twin can get wrong of its car, one record per parameter.

Each is the delta from the nominal car: an absolute one of the load on the chassis (TiL Eq. (2)),
a relative one of what `twin.scales` scales, or a force that nothing in the model accounts for.
"""

import math
from collections import namedtuple
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from twin.channels import span

# Beyond these factors it is no longer the same car
LEAST_SCALE, LARGEST_SCALE = 0.3, 3.0


@dataclass(frozen=True, slots=True)
class Parameter:
    """What is known of a parameter by its name.

    Attributes:
        name: unique.
        kind: "load", "scale" (relative), "offset" (absolute, zero in the files) or "force".
        unit: of the delta.
        prior_sd: standard deviation of the delta before the first sample; 0: not estimated.
        step: of finite differences: a tenth or less of what a full car changes, large beside
            rounding (1e-13 of an output), small beside the curvature.
        signal: the measurement whose residual tells most of it: TiL Eqs. (14), (15), (18).
        words: what it is, within a sentence.
        advice: what to drive so that it becomes known.
        low, high: what the twin accepts; of a load, the body must be physically possible besides.
    """

    name: str
    kind: Literal["load", "scale", "offset", "force"]
    unit: str
    prior_sd: float
    step: float
    signal: str
    words: str
    advice: str
    low: float = -math.inf
    high: float = math.inf


# Prior: a full car more or less, its centre of mass (CM) anywhere between the seats. The inertia is
# about the CM that goes with it. Steps: over two minutes in town half of them change no sensitivity
# by more than 0.1 %, rms over all channels in units of their noise. Only the instants at which a
# car comes to a stop are jumps; they change what ax or pitch_rate alone tell of the mass by 3 %.
# Columns: name, unit, prior_sd, step, signal, words, advice
_LOAD = tuple(
    Parameter(row[0], "load", *row[1:])
    for row in (
        ("mass", "kg", 300.0, 10.0, "ax", "the mass", "accelerate and brake"),
        ("cm_x", "m", 0.08, 0.005, "yaw_rate",
         "where the centre of mass lies along the car", "brake hard, drive a bend"),
        ("cm_y", "m", 0.04, 0.005, "roll_rate", "where the centre of mass lies across the car",
         "accelerate, brake and drive bends to both sides"),
        ("cm_z", "m", 0.06, 0.005, "roll_rate",
         "the height of the centre of mass", "drive bends, brake hard"),
        ("Jxx", "kg m2", 150.0, 10.0, "roll_rate", "the roll inertia",
         "steer quickly to and fro, or drive over bumps on one side"),
        ("Jyy", "kg m2", 900.0, 30.0, "pitch_rate",
         "the pitch inertia", "drive over bumps, or brake abruptly"),
        ("Jzz", "kg m2", 900.0, 30.0, "yaw_rate",
         "the yaw inertia", "drive a bend, better steer quickly to and fro"),
        ("Jxy", "kg m2", 30.0, 10.0, "pitch_rate",
         "the product of inertia Jxy", "steer to and fro on a rough road"),
        ("Jxz", "kg m2", 80.0, 10.0, "yaw_rate",
         "the product of inertia Jxz", "steer quickly to and fro"),
        ("Jyz", "kg m2", 30.0, 10.0, "pitch_rate",
         "the product of inertia Jyz", "steer to and fro while braking"),
    )
)  # fmt: skip
# Prior: a model of tyres and springs from a data sheet. Columns: the same without the unit
_SCALES = tuple(
    Parameter(row[0], "scale", "1", *row[1:], low=LEAST_SCALE - 1.0, high=LARGEST_SCALE - 1.0)
    for row in (
        ("tyre_friction", 0.15, 0.01, "ay",
         "the friction of the tyres", "brake hard or corner fast, near the limit"),
        ("cornering_stiffness", 0.15, 0.01, "ay",
         "the cornering stiffness of the tyres", "drive bends"),
        ("drag", 0.3, 0.05, "ax", "the air drag", "drive fast and let the car coast"),
        ("spring", 0.15, 0.01, "roll_rate",  # with anti-roll bars, at the nominal ride height
         "the stiffness of the springs", "drive bends and over bumps"),
        ("damper", 0.15, 0.01, "roll_rate",
         "the dampers", "drive over bumps, steer to and fro"),
        ("relaxation", 0.3, 0.01, "yaw_rate",
         "the relaxation lengths of the tyres", "steer quickly to and fro"),
        ("drive_torque", 0.03, 0.01, "ax", "the share of the drive torque that reaches the wheels",
         "accelerate hard, with bends besides"),
        ("brake_torque", 0.03, 0.01, "ax", "the share of the brake torque that reaches the wheels",
         "brake hard, with bends besides"),
    )
)  # fmt: skip
# What cars of one type differ in besides: tolerances of manufacture, wear and pressure of tyres,
# bushings; sources of the spreads in scenarios/plants/random_car.toml. Columns: name, prior_sd,
# step, signal, words, advice, low, high. First factors, of one axle beside those of both above
_PART_SCALES = tuple(
    Parameter(row[0], "scale", "1", *row[1:])
    for row in (
        ("tyre_stiffness", 0.08, 0.01, "az",
         "the vertical stiffness of the tyres", "drive over bumps", -0.6, 1.5),
        ("front_cornering_stiffness", 0.1, 0.01, "yaw_rate",
         "the cornering stiffness of the front tyres beside the rear ones", "drive bends",
         -0.6, 1.5),
        ("rolling_radius", 0.008, 0.001, "wheel_speed_fl",
         "the rolling radius of the tyres", "drive straight ahead", -0.1, 0.1),
        ("front_anti_roll", 0.12, 0.02, "roll_rate",
         "the front anti-roll bar", "drive bends", -0.6, 2.0),
        ("rear_anti_roll", 0.12, 0.02, "roll_rate",
         "the rear anti-roll bar", "drive bends", -0.6, 2.0),
        ("front_spring", 0.05, 0.01, "pitch_rate",
         "the front springs beside the rear ones", "brake and accelerate", -0.6, 1.5),
        ("front_damper", 0.15, 0.02, "pitch_rate",
         "the front dampers beside the rear ones", "drive over bumps", -0.6, 1.5),
        ("front_brake_torque", 0.04, 0.005, "wheel_speed_fl",
         "the front brakes beside the rear ones", "brake hard", -0.6, 1.5),
        ("steering_ratio", 0.02, 0.005, "yaw_rate",
         "the steering ratio", "drive bends", -0.6, 1.5),
    )
)  # fmt: skip
# Then what no factor is. Columns: name, unit, and the same
_OFFSETS = tuple(
    Parameter(row[0], "offset", *row[1:])
    for row in (
        ("unsprung_mass", "1", 0.08, 0.02, "az",
         "the mass of wheels and hubs", "drive over bumps", -0.6, 1.5),
        ("roll_centre", "1", 0.2, 0.02, "roll_rate",
         "the heights of the roll centres", "drive bends", -2.0, 4.0),
        ("lift", "m2", 0.15, 0.05, "az",
         "the downforce on both axles, as an area", "drive fast", -5.0, 5.0),
        ("damper_asymmetry", "1", 0.3, 0.02, "az",
         "by how much the dampers are softer in bump than in rebound", "drive over bumps",
         -0.8, 0.8),
        ("steering_offset", "rad", 0.025, 0.005, "yaw_rate",
         "the offset of the hand wheel's angle", "drive straight ahead", -1.0, 1.0),
        ("compliance_steer", "rad/N", 1.2e-6, 1e-7, "yaw_rate",
         "by how much lateral force steers the front wheels out of the bend", "drive bends",
         -1e-5, 1e-5),
        ("steering_delay", "s", 0.015, 0.002, "yaw_rate",
         "the delay of the road wheels behind the told hand wheel", "steer quickly to and fro",
         -0.1, 0.1),
        ("torque_delay", "s", 0.03, 0.002, "ax",
         "the delay of the torques behind the told ones", "accelerate and brake abruptly",
         -0.2, 0.2),
    )
)  # fmt: skip
# Lateral forces on the axles, at the road, that their tyres do not account for; to the left
_FORCES = tuple(
    Parameter(f"axle_force_{axle}", "force", "N", 0.0, 100.0, "ay",
              f"the lateral force on the {axle} axle beside its tyres'", "drive straight ahead")
    for axle in ("front", "rear")
)  # fmt: skip

PARAMETER: Mapping[str, Parameter] = {
    p.name: p for p in (*_LOAD, *_SCALES, *_PART_SCALES, *_OFFSETS, *_FORCES)
}
"""The record of each name; compiled code knows parameters by the indices below."""

LOAD = tuple(p.name for p in _LOAD)
SCALES = tuple(p.name for p in _SCALES)
PARTS = tuple(p.name for p in (*_PART_SCALES, *_OFFSETS))
FACTORS = tuple(p.name for p in (*_SCALES, *_PART_SCALES))
FORCES = tuple(p.name for p in _FORCES)
PARAMETERS = tuple(PARAMETER)
# Indices by name, as in `p[P.mass]`, and blocks
P = namedtuple("P", PARAMETERS)._make(range(len(PARAMETERS)))
CENTRE_OF_MASS = span(PARAMETERS, ("cm_x", "cm_y", "cm_z"))
INERTIA = span(PARAMETERS, ("Jxx", "Jyy", "Jzz", "Jxy", "Jxz", "Jyz"))
SCALE_FACTORS = span(PARAMETERS, SCALES)
PART_CHANGES = span(PARAMETERS, PARTS)
ALL_FACTORS = span(PARAMETERS, FACTORS)
OFFSETS = span(PARAMETERS, tuple(p.name for p in _OFFSETS))
AXLE_FORCES = span(PARAMETERS, FORCES)
