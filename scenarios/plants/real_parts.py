"""What is set of a real car, sample by sample, that a twin's parts do not do.

Friction and asymmetry of the dampers, progressive springs, toe and camber that follow travel and
force; torques that lag, lose and fade; wind on the body.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from scenarios.plants.random_car import RealCar
from twin import STATES, TYRE_OUTPUTS, WHEELS, Twin
from twin.stepping import AIR_DENSITY

Array = NDArray[np.float64]

VX, YAW, YAW_RATE = (STATES.index(name) for name in ("vx", "yaw", "yaw_rate"))
TRAVEL, RATE, SPIN = (
    STATES.index(f"{name}_fl") for name in ("suspension_travel", "suspension_rate", "wheel_speed")
)
FY = TYRE_OUTPUTS.index("fy")
SIDE = np.array([1.0, -1.0, 1.0, -1.0])
AXLE = np.array([0, 0, 1, 1])
# Of the damper: speed at which its bump and rebound part, and below which friction is viscous [m/s]
BEND, STICK = 0.05, 0.02
DEGRESSION_SPEED = 0.5  # [m/s]
PROGRESSION = 0.05  # [m]
SMALL_TORQUE = 250.0  # [N m] at a wheel, over which the efficiency rises
# Heat of the front and rear brakes [J/K], 10 and 8 kg of iron, and the time in which they cool [s]
HEAT, COOLING = np.array([5000.0, 4000.0]), 200.0
# Side force and yaw moment of the wind over its angle: 2.3 and 0.6 of the frontal area, times the
# wheelbase (Hucho) [m2, m3]
SIDE_AREA, YAW_VOLUME = 6.1, 4.6


class Parts(NamedTuple):
    """What compiled code changes of a car while it drives."""

    damping: Array  # (nv,) MuJoCo's, changed in place
    free: Array  # (nq,) free positions of its springs, likewise
    quat: Array  # (nbody, 4) poses of its bodies, likewise
    push: Array  # (nbody, 6) forces on its bodies, likewise
    chassis: int
    hub: NDArray[np.int64]  # (4,)
    nominal_damping: Array  # (4,)
    nominal_free: Array  # (4,)
    asymmetry: float
    degression: float
    friction: float
    progression: Array  # (2,)
    toe: Array  # (2,)
    camber: Array  # (2,)
    camber_gain: Array  # (2,)
    bump_steer: Array  # (2,)
    compliance_steer: Array  # (2,)
    compliance_camber: float
    steering_offset: float
    steering_lag: float
    drive_scale: float
    efficiency: Array  # (2,)
    brake: Array  # (2,)
    fade: float  # per K
    brake_drag: float
    torque_lag: Array  # (2,)
    drag_area: float
    wheelbase: float


def parts_of(twin: Twin, real: RealCar) -> Parts:
    """Of a twin of the real car."""
    model, data, car = twin.model, twin.data, twin.car
    joints = [model.joint(f"travel_{wheel}") for wheel in WHEELS]
    hubs = [model.body(f"hub_{wheel}").id for wheel in WHEELS]
    return Parts(
        damping=model.dof_damping,
        free=model.qpos_spring,
        quat=model.body_quat,
        push=data.xfrc_applied,
        chassis=int(car.chassis),
        hub=np.array(hubs, dtype=np.int64),
        nominal_damping=np.array([model.dof_damping[joint.dofadr[0]] for joint in joints]),
        nominal_free=np.array([model.qpos_spring[joint.qposadr[0]] for joint in joints]),
        asymmetry=real.number("damper_asymmetry"),
        degression=real.number("damper_degression"),
        friction=real.number("suspension_friction"),
        progression=real["spring_progression"],
        toe=real["toe"],
        camber=real["static_camber"],
        camber_gain=real["camber_gain"],
        bump_steer=real["bump_steer"],
        compliance_steer=real["compliance_steer"],
        compliance_camber=real.number("compliance_camber"),
        steering_offset=real.number("steering_offset"),
        steering_lag=real.number("steering_lag"),
        drive_scale=real.number("drive_scale"),
        efficiency=real["drive_efficiency"],
        brake=real["brake_balance"],
        fade=real.number("brake_fade") / 100.0,
        brake_drag=real.number("brake_drag"),
        torque_lag=real["torque_lag"],
        drag_area=float(car.drag_area),
        wheelbase=float(car.wheelbase),
    )


@njit(cache=True, nogil=True)
def _lag(before, wanted, time, dt, first):
    """A first-order lag, at the first sample settled."""
    if first or time <= 0.0:
        return wanted
    return before + (wanted - before) * (1.0 - math.exp(-dt / time))


@njit(cache=True, nogil=True)
def act_on(parts, dt, k, x, told, now, heat):
    """Hand wheel and torques that act, of those told."""
    first = k == 0
    now[0] = _lag(now[0], told[0] - parts.steering_offset, parts.steering_lag, dt, first)
    low, high = parts.efficiency
    for w in range(4):
        torque = parts.drive_scale * told[1 + w]
        torque *= high - (high - low) * math.exp(-abs(torque) / SMALL_TORQUE)
        now[1 + w] = _lag(now[1 + w], torque, parts.torque_lag[0], dt, first)
        left = max(1.0 - parts.fade * heat[w], 0.1)
        brake = parts.brake[AXLE[w]] * left * told[5 + w]
        now[5 + w] = _lag(now[5 + w], brake + parts.brake_drag, parts.torque_lag[1], dt, first)
        power = now[5 + w] * abs(x[SPIN + w])
        heat[w] += dt * (power / HEAT[AXLE[w]] - heat[w] / COOLING)


@njit(cache=True, nogil=True)
def suspend(car, parts, x):
    """Sets dampers and springs for the travels and rates they have."""
    for w in range(4):
        rate, travel = x[RATE + w], x[TRAVEL + w]
        factor = 1.0 - parts.asymmetry * math.tanh(rate / BEND)
        factor *= 1.0 - parts.degression * min(abs(rate) / DEGRESSION_SPEED, 1.0)
        damping = parts.nominal_damping[w] * factor + parts.friction / (abs(rate) + STICK)
        parts.damping[car.travel_dof[w]] = damping
        growth = 0.5 * parts.progression[AXLE[w]] / PROGRESSION * travel * abs(travel)
        parts.free[car.travel_qpos[w]] = parts.nominal_free[w] - growth


@njit(cache=True, nogil=True)
def turn_wheels(car, parts, x):
    """Sets toe and camber of the hubs for their travels and forces."""
    for w in range(4):
        axle, side, travel = AXLE[w], SIDE[w], x[TRAVEL + w]
        force = car.tyre_output[w, FY]
        out = parts.bump_steer[axle] * travel - parts.toe[axle]
        outwards = 1.0 if axle == 0 else -1.0  # of the front wheel: a bend less, of the rear: too
        turn = side * out - outwards * parts.compliance_steer[axle] * force
        lean = side * (parts.camber[axle] + parts.camber_gain[axle] * travel)
        lean += parts.compliance_camber * force
        quat = parts.quat[parts.hub[w]]
        norm = math.sqrt(1.0 + 0.25 * (lean**2 + turn**2))
        quat[0], quat[1] = 1.0 / norm, 0.5 * lean / norm
        quat[2], quat[3] = 0.0, 0.5 * turn / norm


@njit(cache=True, nogil=True)
def blow(parts, wind, x):
    """Sets the force of the wind on the body, beside what it feels in still air."""
    c, s = math.cos(x[YAW]), math.sin(x[YAW])
    along, across = c * wind[0] + s * wind[1], c * wind[1] - s * wind[0]
    ahead = x[VX] - along
    pressure = 0.5 * AIR_DENSITY
    drag = pressure * parts.drag_area * (ahead * math.hypot(ahead, across) - x[VX] * abs(x[VX]))
    side = pressure * SIDE_AREA * abs(ahead) * across
    push = parts.push[parts.chassis]
    push[0], push[1] = -c * drag - s * side, -s * drag + c * side
    push[5] = pressure * YAW_VOLUME * abs(ahead) * across
