"""What `til calibrate` can free: a name, what it changes, its unit and its bounds.

Most are factors on what a car's files say (`Vehicle.scaled`), some are parameters of a running twin
(deltas from the nominal chassis). The rest belongs to the log and to the observer: offsets of
its sensors, how the unknown torques are made, gains, noises that a covariance is driven by.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from estimators.til.scheduled_kernel import Noise
from twin import OUTPUTS, PARAMETER, RATES, TwinError
from twin.parameters import LARGEST_SCALE, LEAST_SCALE
from twin.scales import VEHICLE_SCALES

SCALE_SD = 0.25  # prior of a factor; chosen: a data sheet's tyres, springs and dampers

# Of a noise's natural logarithm: a factor of 2.7, chosen; the bounds are a thousandfold
LOG_SD, LARGEST_LOG = 1.0, 7.0

Kind = Literal["scale", "load", "offset", "follower", "gain", "noise", "band"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Free:
    """A number that a fit may change.

    Attributes:
        kind: of what: a factor on the vehicle's files; a delta of the twin's chassis; an offset
            that is added to a channel; a field of `SpeedFollower`; a gain; the natural logarithm of
            a field of `Noise` over its default; a standard deviation that follows from errors.
        unit: of the number.
        start: where it is not given.
        low, high: bounds.
        scale: a change that makes a difference.
        prior_sd: how far it is believed to lie from its start; inf: nothing is believed.
        of: the gain's (state, output).
    """

    kind: Kind
    unit: str
    start: float
    low: float
    high: float
    scale: float
    prior_sd: float = math.inf
    of: tuple[str, str] = ("", "")


def _scale() -> Free:
    return Free(
        kind="scale", unit="1", start=1.0, low=LEAST_SCALE, high=LARGEST_SCALE, scale=0.3,
        prior_sd=SCALE_SD,
    )  # fmt: skip


def _delta(name: str, least: float, largest: float) -> Free:
    return Free(
        kind="load", unit=PARAMETER[name].unit, start=0.0, low=least, high=largest,
        scale=0.2 * (largest - least), prior_sd=PARAMETER[name].prior_sd,
    )  # fmt: skip


def _offset(unit: str, largest: float) -> Free:
    return Free(
        kind="offset", unit=unit, start=0.0, low=-largest, high=largest, scale=0.1 * largest,
        prior_sd=0.3 * largest,
    )  # fmt: skip


def _gain(
    unit: str, start: float, low: float, high: float, prior_sd: float, of: tuple[str, str]
) -> Free:
    return Free(
        kind="gain", unit=unit, start=start, low=low, high=high, scale=0.05 * (high - low),
        prior_sd=prior_sd, of=of,
    )  # fmt: skip


def _noise() -> Free:
    return Free(
        kind="noise", unit="1", start=0.0, low=-LARGEST_LOG, high=LARGEST_LOG, scale=0.5,
        prior_sd=LOG_SD,
    )  # fmt: skip


# How far the twin of a corrected observer is from the car, and its sensors from the truth
_NOISE = "log_noise_"
NOISES = tuple(f"{_NOISE}{name}" for name in ("vy", "yaw_rate", "front", "rear", "ay"))
# Follow from the errors: a factor on the standard deviations of scheduled gains, and the standard
# deviation of the sideslip with constant ones, which have none of their own
BAND, SIDESLIP_SD = f"{_NOISE}band", "sideslip_sd"

# Bounds are chosen: wide for a passenger car whose files are roughly right.
FREE: Mapping[str, Free] = {
    **{name: _scale() for name in VEHICLE_SCALES},
    "mass": _delta("mass", -500.0, 1000.0),
    "cm_x": _delta("cm_x", -0.3, 0.3),
    "cm_y": _delta("cm_y", -0.1, 0.1),
    "cm_z": _delta("cm_z", -0.2, 0.2),
    "Jxx": _delta("Jxx", -300.0, 500.0),
    "Jyy": _delta("Jyy", -1000.0, 2500.0),
    "Jzz": _delta("Jzz", -600.0, 1500.0),
    "Jxy": _delta("Jxy", -100.0, 100.0),
    "Jxz": _delta("Jxz", -300.0, 300.0),
    "Jyz": _delta("Jyz", -100.0, 100.0),
    "steering_offset": _offset("rad", 0.03),  # of the hand wheel: that of the road wheels x ratio
    **{f"{name}_offset": _offset("m/s2", 1.0) for name in ("ax", "ay", "az")},
    **{f"{name}_offset": _offset("rad/s", 0.05) for name in OUTPUTS[RATES]},
    "sideslip_offset": _offset("rad", 0.03),
    # the measured sideslip's point lies so far before the twin's IMU
    "sideslip_lever": _offset("m", 0.6),
    "brake_front": Free(
        kind="follower", unit="1", start=0.65, low=0.3, high=0.9, scale=0.1, prior_sd=0.1
    ),
    "locking": Free(
        kind="follower",
        unit="N m s/rad",
        start=0.0,
        low=0.0,
        high=3000.0,
        scale=300.0,
        prior_sd=500.0,
    ),
    # priors of gains are chosen: as large as gains that were found useful
    "yaw_rate_to_yaw_rate": _gain("1/s", 20.0, 0.0, 100.0, 20.0, ("yaw_rate", "yaw_rate")),
    "yaw_rate_to_vy": _gain("m/s per rad", 0.0, -50.0, 50.0, 15.0, ("vy", "yaw_rate")),
    "ay_to_vy": _gain("1", 0.0, 0.0, 0.95, 0.3, ("vy", "ay")),
    **{name: _noise() for name in NOISES},
    BAND: _noise(),
    SIDESLIP_SD: Free(kind="band", unit="rad", start=0.0, low=0.0, high=math.pi, scale=0.01),
}


# What is freed unless the user says something else: what a data sheet knows least of, as far as a
# drive without torques shows it
_TYRES = ("tyre_friction", "cornering_stiffness", "load_of_largest_stiffness")
DEFAULTS = (
    *(f"{axle}_{name}" for name in _TYRES for axle in ("front", "rear")),
    *("relaxation", "cm_x", "steering_offset"),
)
DEFAULTS_OF_SIDESLIP = ("sideslip_offset", "sideslip_lever")


GAINS = tuple(name for name, free in FREE.items() if free.kind == "gain")
FOLLOWING = (BAND, SIDESLIP_SD)  # from the errors of a fit: not to be freed


def noise_of(values: Mapping[str, float]) -> Noise:
    """The noise of an observer, by the values of a calibration; the default's where it has none."""
    default = Noise()
    logs = {n.removeprefix(_NOISE): v for n, v in values.items() if n.startswith(_NOISE)}
    return default._replace(**{n: getattr(default, n) * math.exp(v) for n, v in logs.items()})


def starts(names: tuple[str, ...], given: Mapping[str, float]) -> dict[str, float]:
    """Where each name starts: as given, or as the table says.

    Raises:
        TwinError: a name is unknown or given twice, or a given value is out of bounds.
    """
    for name in (*names, *given):
        if name not in FREE:
            raise TwinError(f"calibrate: {name!r} is no parameter; allowed: {', '.join(FREE)}")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise TwinError(f"calibrate: {twice} is freed twice; allowed: once")
    for name, value in given.items():
        if not FREE[name].low <= value <= FREE[name].high:
            raise TwinError(
                f"calibrate: {name} is {value:g}; allowed: {FREE[name].low:g} to "
                f"{FREE[name].high:g} {FREE[name].unit}"
            )
    return {name: given.get(name, FREE[name].start) for name in names}
