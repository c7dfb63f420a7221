"""The fields of a car's TOML file: one table for the template, the checks and the manual.

Defaults are the SUV of models/suv.xml: a car of which nothing else is known starts as one.
"""

from typing import NamedTuple

from twin.toml_fields import Field


class Section(NamedTuple):
    """A table of the file. Where `optional`, a field that is left out keeps what stands elsewhere.

    The defaults of such fields are those of the shipped tyre.
    """

    name: str
    text: tuple[str, ...]
    fields: tuple[Field, ...]
    optional: bool = False


def _axle(name: str, text: str, *defaults: float) -> Section:
    stiffness, damping, bar, roll_centre, slope = defaults
    return Section(
        f"suspension.{name}",
        (text,),
        (
            Field("stiffness", "N/m", stiffness, 1e3, 1e6, "spring, at the wheel"),
            Field("damping", "N s/m", damping, 0.0, 1e5, "damper, at the wheel"),
            Field(
                *("anti_roll", "N/m", bar, 0.0, 1e6),
                "anti-roll bar: force at a wheel over the difference of the travels",
            ),
            Field("roll_centre_height", "m", roll_centre, -0.3, 0.6, "above the road"),
            Field(
                *("travel_slope", "1", slope, -0.5, 0.5),
                "forward motion of a wheel over its upward motion: against dive and lift",
            ),
            Field("free_travel", "m", 0.08, 0.01, 0.5, "up or down, to the bump stop"),
            Field("bump_stop", "N/m", 200_000.0, 0.0, 1e7, "its stiffness"),
            Field("hub_mass", "kg", 25.0, 1.0, 500.0, "of a hub with brake and half of its links"),
            Field("wheel_mass", "kg", 28.0, 1.0, 500.0, "of a rim with its tyre"),
            Field("wheel_inertia", "kg m2", 1.7, 0.05, 100.0, "of a wheel about its axis"),
        ),
    )


_TYRE = (
    Field(
        *("file", "", "tyres/suv.tir", 0.0, 0.0),
        "a .tir file, in the folder of this one or below; or of the project",
    ),
    Field("nominal_load", "N", 6000.0, 500.0, 50_000.0, "load of the coefficients below"),
    Field("friction", "1", 1.0, 0.1, 3.0, "peak of the lateral force over the load"),
    Field(
        *("load_sensitivity", "1", 0.12, 0.0, 0.5),
        "share of the friction lost at twice the nominal load",
    ),
    Field(
        *("cornering_coefficient", "1/rad", 15.249, 2.0, 60.0),
        "cornering stiffness over load, at the nominal load",
    ),
    Field("relaxation_length", "m", 0.4723, 0.05, 2.0, "lateral, at the nominal load"),
    Field("radius", "m", 0.369, 0.1, 1.0, "unloaded"),
    Field("vertical_stiffness", "N/m", 260_000.0, 2e4, 2e6, ""),
)

SECTIONS = (
    Section(
        "chassis",
        (
            "The car without hubs and wheels, but with its driver. From scales under the wheels:",
            "  mass: their sum - twice (front hub and wheel) - twice (rear hub and wheel)",
            "  cm_to_front_axle: wheelbase * (rear axle - twice (rear hub and wheel)) / mass",
            "Inertia tensor about the centre of mass. A guess:",
            "  roll 0.15 mass * track^2, pitch 0.20 mass * wheelbase^2, yaw 1.08 times the latter",
        ),
        (
            Field("mass", "kg", 2125.8, 100.0, 50_000.0, "TiL Table 1"),
            Field("cm_to_front_axle", "m", 1.25, 0.1, 10.0, "centre of mass behind the axle"),
            Field("cm_left", "m", -0.00003, -1.0, 1.0, "centre of mass left of the middle"),
            Field("cm_height", "m", 0.644, 0.1, 3.0, "centre of mass above the road"),
            Field("Jxx", "kg m2", 834.23, 10.0, 1e6, "roll"),
            Field("Jyy", "kg m2", 3640.182, 10.0, 1e6, "pitch"),
            Field("Jzz", "kg m2", 3932.77, 10.0, 1e6, "yaw"),
            Field("Jxy", "kg m2", 0.14, -1e5, 1e5, ""),
            Field("Jxz", "kg m2", 0.097, -1e5, 1e5, ""),
            Field("Jyz", "kg m2", 3.86, -1e5, 1e5, ""),
        ),
    ),
    Section(
        "imu",
        ("Where accelerations, rates, v_x and v_y are measured; drag acts there, too.",),
        (
            Field("to_front_axle", "m", 1.25, -5.0, 15.0, "behind the axle"),
            Field("left", "m", 0.0, -2.0, 2.0, "left of the middle"),
            Field("height", "m", 0.644, 0.0, 4.0, "above the road"),
        ),
    ),
    Section(
        "geometry",
        ("Standing on level ground.",),
        (
            Field("wheelbase", "m", 2.9, 0.8, 10.0, ""),
            Field("track_front", "m", 1.65, 0.5, 4.0, ""),
            Field("track_rear", "m", 1.65, 0.5, 4.0, ""),
            Field("wheel_centre_height", "m", 0.3475, 0.1, 1.0, "above the road"),
        ),
    ),
    Section(
        "steering",
        (),
        (
            Field("ratio", "1", 16.0, 0.5, 100.0, "hand wheel over the road wheels' mean"),
            Field("ackermann", "1", 0.8, 0.0, 1.5, "0: parallel wheels, 1: full Ackermann"),
        ),
    ),
    Section(
        "drivetrain",
        ("What drivers of simulated drives, and twins without known torques, take the car for.",),
        (
            Field("drive_front", "1", 0.4, 0.0, 1.0, "share of the drive torque"),
            Field("brake_front", "1", 0.65, 0.0, 1.0, "share of the brake torque"),
            Field("power", "W", 250_000.0, 1e3, 1e7, "of the engine at the wheels"),
            Field(
                *("torque_accuracy", "1", 0.03, 0.0, 0.5),
                "standard deviation of the scale of a log's torques; widens the mass's interval",
            ),
        ),
    ),
    Section(
        "aerodynamics",
        (),
        (
            Field("drag_area", "m2", 0.9, 0.0, 10.0, "c_d A"),
            Field("lift_area_front", "m2", 0.0, -10.0, 10.0, "-c_L A: positive pushes down"),
            Field("lift_area_rear", "m2", 0.0, -10.0, 10.0, ""),
        ),
    ),
    _axle("front", "Rates at one wheel.", 36_000.0, 2900.0, 20_000.0, 0.06, 0.05),
    _axle("rear", "", 38_000.0, 2700.0, 10_000.0, 0.11, -0.05),
    Section(
        "tyre.front",
        (
            "A tyre property file (MF 5.2, 6.1 or 6.2), or the file of the project's SUV scaled to",
            "these figures; what is left out stays as it is in the file.",
        ),
        _TYRE,
        optional=True,
    ),
    Section("tyre.rear", (), _TYRE, optional=True),
)

BOUNDS = {
    f"{section.name}.{field.name}": (field.least, field.largest)
    for section in SECTIONS
    for field in section.fields
    if not isinstance(field.default, str)
}
"""Least and largest value of each field that is a number, by section and field."""
