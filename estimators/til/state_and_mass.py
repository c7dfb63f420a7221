"""Sideslip and mass together: the observer of TiL Section 5, Eqs. (19)-(24), by a few numbers.

Of the 28 states those of Eq. (22) are corrected, each by its own measurement of Eq. (21): the
reduced K of Eq. (23). The mass is corrected in one of two ways:

* the paper's: a constant gain times the sign of the measured longitudinal acceleration, at rest
  beyond a yaw rate of 3 deg/s;
* ours: least squares on the twin's own acceleration, cleared of what the correction of the wheel
  speeds adds to it (see `estimators.til.law`), at rest beyond that yaw rate and below 1.5 m/s2,
  where drag and a sensor's bias weigh more than the mass.

An extended state may come on top, TiL Eqs. (2)-(3): the lateral force that each axle's tyres lack.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

from estimators.til.law import ParameterLaw
from twin import WHEELS

LARGEST_YAW_RATE = math.radians(3.0)  # TiL Eq. (24)
LEAST_ACCELERATION = 1.5  # [m/s2]; chosen
PRIOR_SD = 350.0  # [kg], of the mass before the drive: the initial error of TiL Section 5.3

# The gains by their names, with the range in which to look for them. TiL Table 8 prints bounds of
# 0.01 to 0.01 for the feed-throughs, with optima outside; all of these are chosen.
STATE_BOUNDS = {
    "wheel_speed": (0.01, 300.0),  # K_w-w [1/s]
    "ax_vx": (1e-3, 0.5),  # K_ax-vx [-]
    "ay_vy": (1e-3, 0.5),  # K_ay-vy [-]
    "pitch_rate": (0.1, 300.0),  # K_wy-wy [1/s]
    "yaw_rate": (0.1, 300.0),  # K_wz-wz [1/s]
}
# One more entry of K, ours: the yaw rate's innovation on the lateral speed. With the yaw rate held
# to its measurement, what is left of its innovation is the yaw moment that the twin's tyres lack,
# and with it goes an error of the lateral speed.
CROSS_BOUNDS = {"yaw_rate_vy": (1.0, 1000.0)}  # K_wz-vy [m/s2 per rad/s]
LEAST_SQUARES_BOUNDS = {
    "noise_density": (3e-3, 3.0),  # [m/s2 per root of Hz]
    "drift": (1e-2, 30.0),  # [kg per root of s]
}
SIGN_BOUNDS = {"mass": (5.0, 2000.0)}  # K_ax-dM [kg/s per m/s2]


class Wheels(NamedTuple):
    """What the mass law has to know of a car."""

    mass: float  # M of the car [kg]
    share: float  # I / (R M) of a wheel, the mean of four [m/s2 per rad/s2]


def state_gains(gains: Mapping[str, float]) -> dict[tuple[str, str], float]:
    """The entries of K, for `estimators.til.observer.Observer`.

    Args:
        gains: a value for each of `STATE_BOUNDS`, and perhaps of `CROSS_BOUNDS`; others are left
            alone.
    """
    own = ("pitch_rate", "yaw_rate")
    return {
        ("vx", "ax"): gains["ax_vx"],
        ("vy", "ay"): gains["ay_vy"],
        ("vy", "yaw_rate"): gains.get("yaw_rate_vy", 0.0),
        **{(name, name): gains[name] for name in own},
        **{(f"wheel_speed_{w}", f"wheel_speed_{w}"): gains["wheel_speed"] for w in WHEELS},
    }


def paper_mass_law(gains: Mapping[str, float]) -> ParameterLaw:
    """TiL Eq. (24), corrected in sign.

    Args:
        gains: a value for each of `SIGN_BOUNDS`.
    """
    return ParameterLaw(
        parameter="mass",
        signal="ax",
        instrument="measured",
        form="sign",
        gain=gains["mass"],
        largest_yaw_rate=LARGEST_YAW_RATE,
    )


def mass_law(gains: Mapping[str, float], wheels: Wheels) -> ParameterLaw:
    """The default law.

    Args:
        gains: a value for each of `LEAST_SQUARES_BOUNDS`, and wheel_speed.
        wheels: of the twin's car.
    """
    return ParameterLaw(
        parameter="mass",
        signal="ax",
        scale=wheels.mass,
        prior_sd=PRIOR_SD,
        noise_density=gains["noise_density"],
        drift=gains["drift"],
        largest_yaw_rate=LARGEST_YAW_RATE,
        least_signal=LEAST_ACCELERATION,
        compensation=gains["wheel_speed"] * wheels.share,
    )


def axle_force_laws(
    gains: Mapping[str, float],
    bandwidth: float,
    leak: float,
    mass: float,
    yaw_inertia: float,
    axles: tuple[float, float],
) -> tuple[ParameterLaw, ...]:
    """Corrections of the axles' lateral forces, as extended states.

    The force that is missing is M (a_y - a~_y). The moment is what the correction of the yaw rate
    makes up for, J_zz K_wz (w_z - w~_z). Both are shared between the axles. Without a leak the twin
    would take over all of it, its tyres would no longer hold its lateral speed, and the sideslip
    would drift off as an integral of the sensors' errors. With the leak the twin takes over the
    share bandwidth / (bandwidth + leak): one that must stay below 1, as a feed-through.

    Args:
        gains: yaw_rate.
        bandwidth: [1/s].
        leak: [1/s].
        mass: of the car [kg].
        yaw_inertia: of the car [kg m2].
        axles: x of the front and the rear axle, from the IMU [m].
    """
    front, rear = axles
    wheelbase = front - rear
    shares = {"front": -rear / wheelbase, "rear": front / wheelbase}
    return tuple(
        ParameterLaw(
            parameter=f"axle_force_{axle}",
            signal=signal,
            form="integral",
            gain=bandwidth * gain,
            leak=leak,
        )
        for axle, sign in (("front", 1.0), ("rear", -1.0))
        for signal, gain in (
            ("ay", mass * shares[axle]),
            ("yaw_rate", sign * gains["yaw_rate"] * yaw_inertia / wheelbase),
        )
    )
