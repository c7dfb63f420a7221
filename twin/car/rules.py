"""A car from a handful of figures: what else its file needs, by rules that name their sources."""

import math
from dataclasses import dataclass

from twin.errors import TwinError
from twin.tyre.size import TyreSize

GRAVITY = 9.81  # [m/s2]
UNSPRUNG_SHARE = 0.09  # of the mass, in four hubs and wheels; as the project's SUV
HUB_SHARE = 25.0 / 53.0  # of an unsprung corner
WHEEL_GYRATION = 0.446  # inertia of a wheel over mass and squared radius; as the SUV's
STABILITY_FACTOR = 1.4  # half the track over the height of the centre of mass: NHTSA, cars
RIDE_FREQUENCY = {"front": 1.2, "rear": 1.4}  # [Hz]: Olley, the rear one higher
DAMPING_RATIO = 0.31  # of the ride; usual: 0.2 to 0.4
BAR_SHARE = {"front": 0.556, "rear": 0.263}  # anti-roll bar over spring; as the SUV
DRAG_COEFFICIENT = 0.30  # chosen: cars since 2000 have 0.25 to 0.35
LIMITS = {
    "mass": (300.0, 10_000.0),
    "wheelbase": (1.2, 8.0),
    "track": (0.8, 3.0),
    "front_share": (0.25, 0.75),
    "drive_front": (0.0, 1.0),
}

Values = dict[tuple[str, str], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """What people know of their car.

    Attributes:
        mass: of the whole car with its driver [kg].
        wheelbase: [m].
        track: mean of both axles [m].
        front_share: of the weight, on the front axle.
        drive_front: of the drive torque, on the front axle.
        tyre: of both axles; None: that of the project's SUV.
        known: the names above that somebody gave; the others are guesses.

    Raises:
        TwinError: a figure is that of no car.
    """

    mass: float = 2337.8
    wheelbase: float = 2.9
    track: float = 1.65
    front_share: float = 0.567
    drive_front: float = 0.4
    tyre: TyreSize | None = None
    known: frozenset[str] = frozenset(("mass", "wheelbase", "track", "front_share", "drive_front"))

    def __post_init__(self) -> None:
        for name, (least, largest) in LIMITS.items():
            value = getattr(self, name)
            if not least <= value <= largest:
                raise TwinError(
                    f"new-car: {name.replace('_', '-')} is {value:g}; allowed: {least:g} to "
                    f"{largest:g}"
                )


# The figures that settle a field
_SETTLES = {
    ("chassis", "mass"): ("mass",),
    ("chassis", "cm_to_front_axle"): ("wheelbase", "front_share"),
    ("geometry", "wheelbase"): ("wheelbase",),
    ("geometry", "track_front"): ("track",),
    ("geometry", "track_rear"): ("track",),
    ("drivetrain", "drive_front"): ("drive_front",),
}


def settled(figures: Figures) -> set[tuple[str, str]]:
    """The fields, by section and name, that follow from what is known without a guess."""
    return {field for field, names in _SETTLES.items() if figures.known.issuperset(names)}


def derived(figures: Figures) -> Values:
    """The fields that follow from the figures, by section and name of `twin.car.fields`."""
    radius, stiffness = 0.369, 260_000.0
    if figures.tyre:
        radius, stiffness = figures.tyre.radius, figures.tyre.vertical_stiffness
    corner = 0.25 * UNSPRUNG_SHARE * figures.mass
    chassis = figures.mass - 4.0 * corner
    front = figures.front_share * figures.mass
    behind = figures.wheelbase * (figures.mass - front - 2.0 * corner) / chassis
    wheel_height = radius - 0.25 * figures.mass * GRAVITY / stiffness
    height = 0.5 * figures.track / STABILITY_FACTOR
    height += (height - wheel_height) * 4.0 * corner / chassis  # of the chassis alone
    pitch = 0.20 * chassis * figures.wheelbase**2
    values = {
        ("chassis", "mass"): chassis,
        ("chassis", "cm_to_front_axle"): behind,
        ("chassis", "cm_left"): 0.0,
        ("chassis", "cm_height"): height,
        ("chassis", "Jxx"): 0.15 * chassis * figures.track**2,
        ("chassis", "Jyy"): pitch,
        ("chassis", "Jzz"): 1.08 * pitch,
        **{("chassis", name): 0.0 for name in ("Jxy", "Jxz", "Jyz")},
        ("imu", "to_front_axle"): behind,
        ("imu", "height"): height,
        ("drivetrain", "drive_front"): figures.drive_front,
        ("geometry", "wheelbase"): figures.wheelbase,
        ("geometry", "track_front"): figures.track,
        ("geometry", "track_rear"): figures.track,
        ("geometry", "wheel_centre_height"): wheel_height,
        # Wong, Theory of Ground Vehicles, 4th ed., Eq. (3.22): A = 1.6 + 0.00056 (m - 765)
        ("aerodynamics", "drag_area"): DRAG_COEFFICIENT * (1.6 + 0.00056 * (figures.mass - 765.0)),
    }
    for axle, load in (("front", front), ("rear", figures.mass - front)):
        values |= _suspension(axle, 0.5 * load - corner, corner, radius)
    return values


def _suspension(axle: str, sprung: float, corner: float, radius: float) -> Values:
    """Of one axle, from the sprung and the unsprung mass of a corner [kg]."""
    rate = sprung * (2.0 * math.pi * RIDE_FREQUENCY[axle]) ** 2
    wheel = (1.0 - HUB_SHARE) * corner
    fields = {
        "stiffness": rate,
        "damping": 2.0 * DAMPING_RATIO * math.sqrt(rate * sprung),
        "anti_roll": BAR_SHARE[axle] * rate,
        "hub_mass": HUB_SHARE * corner,
        "wheel_mass": wheel,
        "wheel_inertia": WHEEL_GYRATION * wheel * radius**2,
    }
    return {(f"suspension.{axle}", name): value for name, value in fields.items()}
