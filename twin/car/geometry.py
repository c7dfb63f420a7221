"""Checks that a compiled model has the geometry of a car: what compiled code takes for granted."""

from typing import NoReturn

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.channels import WHEELS
from twin.errors import TwinError

TIMESTEPS = (1e-5, 0.02)  # [s]
GRAVITIES = (9.7, 9.9)  # [m/s2], of places on Earth
SHORTEST_WHEELBASE, NARROWEST_TRACK = 0.5, 0.3  # [m]
LARGEST_SKEW = 0.1  # [m], of the wheels of an axle against each other, along the car
LARGEST_TILT = np.radians(15.0)  # of a spin axis against the car's y axis: static camber
LARGEST_OFF_CENTRE = 1e-3  # [m], of a wheel's mass or spin axis from the wheel's origin
_NEEDED = ("gravity", "spring", "damper", "sensor")  # parts that <flag> must not disable


def check_geometry(source: object, model: mujoco.MjModel) -> None:
    """Checks gravity, timestep, wheels, joints and sensors of a compiled car at rest.

    Args:
        source: the car's file, for the message.
        model: has all named parts of a car, of the right kinds.

    Raises:
        TwinError: a part stands elsewhere, points elsewhere or measures something else.
    """

    def refuse(what: str) -> NoReturn:
        raise TwinError(f"{source}: {what}")

    _check_options(refuse, model)
    _check_imu(refuse, model)
    _check_wheels(refuse, model)
    _check_sensors(refuse, model)


def _check_options(refuse, model: mujoco.MjModel) -> None:
    if not TIMESTEPS[0] <= model.opt.timestep <= TIMESTEPS[1]:
        refuse(
            f"option timestep is {model.opt.timestep:g}; allowed: {TIMESTEPS[0]:g} to "
            f"{TIMESTEPS[1]:g} s"
        )
    x, y, z = model.opt.gravity
    if x != 0.0 or y != 0.0 or not GRAVITIES[0] <= -z <= GRAVITIES[1]:
        refuse(f"option gravity is {x:g} {y:g} {z:g}; allowed: 0 0 -9.81, as on Earth")
    flags = model.opt.disableflags
    for name in _NEEDED:
        if flags & getattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}"):
            refuse(f"option flag {name} must not be disable")
    touching = model.geom_contype.any() or model.geom_conaffinity.any()
    if touching and not flags & mujoco.mjtDisableBit.mjDSBL_CONTACT:
        refuse("option flag contact must be disable: tyres carry the car, not contacts of geoms")


def _check_imu(refuse, model: mujoco.MjModel) -> None:
    site = model.site("imu")
    if site.bodyid[0] != model.body("chassis").id:
        refuse("site imu must be on body chassis")
    if np.abs(np.abs(site.quat[0]) - 1.0) > 1e-9:
        refuse(f"site imu has quat {_text(site.quat)}; allowed: the axes of the chassis, 1 0 0 0")


def _check_wheels(refuse, model: mujoco.MjModel) -> None:
    """Spin axes, joints and corners, in the frame of the chassis at rest."""
    data = mujoco.MjData(model)
    data.qpos[:7] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    mujoco.mj_kinematics(model, data)
    chassis = model.body("chassis").id
    places = []
    for wheel in WHEELS:
        body, spin, travel = (
            model.body(f"wheel_{wheel}"),
            model.joint(f"spin_{wheel}"),
            model.joint(f"travel_{wheel}"),
        )
        if spin.bodyid[0] != body.id or spin.type[0] != mujoco.mjtJoint.mjJNT_HINGE:
            refuse(f"joint spin_{wheel} must be a hinge of body wheel_{wheel}")
        if np.abs(spin.axis - [0.0, 1.0, 0.0]).max() > 1e-9:
            refuse(
                f"joint spin_{wheel} has axis {_text(spin.axis)}; allowed: 0 1 0, to the left, so "
                "that rolling forward is positive"
            )
        if max(np.abs(spin.pos).max(), np.abs(body.ipos).max()) > LARGEST_OFF_CENTRE:
            refuse(f"wheel_{wheel}: its joint and its mass must stand at its origin, the centre")
        axis = data.xmat[body.id].reshape(3, 3)[:, 1]
        if axis[1] < np.cos(LARGEST_TILT):
            refuse(f"wheel_{wheel} has its axis along {_text(axis)} in the chassis; allowed: 0 1 0")
        above = model.body_parentid[body.id]
        hub = body.id if travel.bodyid[0] == body.id else above
        if travel.type[0] != mujoco.mjtJoint.mjJNT_SLIDE or travel.bodyid[0] != hub:
            refuse(f"joint travel_{wheel} must be a slide of wheel_{wheel} or of the body it is on")
        if model.body_parentid[hub] != chassis:
            refuse(f"wheel_{wheel} must hang on the chassis by its travel alone")
        up = data.xaxis[travel.id]
        if up[2] < np.cos(np.radians(45.0)):
            refuse(f"joint travel_{wheel} has axis {_text(up)}; allowed: upwards, as 0 0 1")
        places.append(data.xpos[body.id].copy())
    _check_corners(refuse, np.array(places))


def _check_corners(refuse, places: NDArray[np.float64]) -> None:
    """Wheels (4, 3) in the order of WHEELS [m]."""
    (fl, fr), (rl, rr) = places[:2], places[2:]
    wheelbase = 0.5 * (fl[0] + fr[0] - rl[0] - rr[0])
    if wheelbase < SHORTEST_WHEELBASE:
        refuse(
            f"wheel_fl and wheel_fr are {wheelbase:.3g} m ahead of wheel_rl and wheel_rr; allowed: "
            f"at least {SHORTEST_WHEELBASE} m (x is forward)"
        )
    for left, right, axle in ((fl, fr, "f"), (rl, rr, "r")):
        if left[1] - right[1] < NARROWEST_TRACK:
            refuse(
                f"wheel_{axle}l is {left[1] - right[1]:.3g} m left of wheel_{axle}r; allowed: at "
                f"least {NARROWEST_TRACK} m (y is to the left)"
            )
        if abs(left[0] - right[0]) > LARGEST_SKEW:
            refuse(
                f"wheel_{axle}l is {left[0] - right[0]:.3g} m ahead of wheel_{axle}r; allowed: at "
                f"most {LARGEST_SKEW} m"
            )


def _check_sensors(refuse, model: mujoco.MjModel) -> None:
    measured = {f"wheel_speed_{wheel}": model.joint(f"spin_{wheel}") for wheel in WHEELS}
    measured |= dict.fromkeys(("acceleration", "rates"), model.site("imu"))
    for name, part in measured.items():
        sensor = model.sensor(name)
        if sensor.objid[0] != part.id:
            refuse(f"sensor {name} must measure {part.name}, and measures another part")
        if sensor.cutoff[0] != 0.0:
            refuse(f"sensor {name} has cutoff {sensor.cutoff[0]:g}; allowed: none")
        for history in ("delay", "interval"):
            if np.any(getattr(model, f"sensor_{history}", np.zeros(model.nsensor))[sensor.id]):
                refuse(f"sensor {name} has a {history}; allowed: none")


def _text(numbers: NDArray[np.float64]) -> str:
    return " ".join(f"{number:.3g}" for number in numbers)
