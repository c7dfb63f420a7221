"""The benchmark of TiL Section 5.2: a planar double-track model under the same corrections.

States are v_x, v_y, yaw rate and the missing mass; hand wheel and measured wheel speeds drive it.
What differs from print:

* Eq. (28): the fourth term of the yaw moment has l_f, the front wheels' lever.
* Eq. (30): velocities are those of the wheel's hub in the wheel's frame, and the slip angle is
  alpha = -atan(w_y / w_x), so that F_y = +F_z mu(alpha) points to the left where the wheel slides
  to the right. As printed the model blows up within seconds.
* Eq. (31): an accelerometer shows the specific forces F_x / M and F_y / M, without v_y w_z.
* Drag and downforce, of which the paper does not speak, act as they do on the twin: at 230 km/h
  they are worth more than the mass that is looked for.

Wheel loads come from the measured accelerations and the estimated mass, as the paper has them. The
forces are then in proportion to that mass, F / M is free of it, and nothing ties the estimate of
the mass down: it is an open ramp. Only drag keeps a trace of it.
"""

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate
from estimators.entry import Entry
from estimators.priors import initial_deltas
from estimators.til.state_and_mass import LARGEST_YAW_RATE
from twin import OUTPUTS, WHEEL_SPEEDS, Drive, TwinError, Y

Array = NDArray[np.float64]
GRAVITY = 9.81
AIR_DENSITY = 1.2  # [kg/m3]
SLOWEST = 1.0  # [m/s], below which slips are taken at this speed
FRONT_WHEELS, REAR_WHEELS, AFTER_WHEELS = Y.wheel_speed_fl, Y.wheel_speed_rl, WHEEL_SPEEDS.stop
LARGEST_SHARE = 0.7  # of its mass that a car can lose before the model has none
STATES = ("vx", "vy", "yaw_rate")
# As of TiL Eq. (32), the range in which to look; the paper gives none that hold its optima
BOUNDS = {
    "ax_vx": (1e-3, 0.5),  # [-]
    "ay_vy": (1e-3, 0.5),  # [-]
    "yaw_rate": (0.1, 300.0),  # [1/s]
    "mass": (0.1, 2000.0),  # [kg/s per m/s2]
}


class MagicFormula(NamedTuple):
    """mu = D sin(C atan(B s - E (B s - atan(B s)))), TiL Eq. (29)."""

    b: float
    c: float
    d: float
    e: float


class Axle(NamedTuple):
    """Wheels of an axle."""

    x: float  # of the hubs, from the centre of mass [m]
    track: float  # [m]
    radius: float  # effective rolling radius [m]
    roll_share: float  # of the load transfer in a turn
    lift_area: float  # positive presses down [m2]
    along: MagicFormula
    across: MagicFormula


class DoubleTrack(NamedTuple):
    """A car."""

    mass: float  # M_tot [kg]
    yaw_inertia: float  # J_zz [kg m2]
    height: float  # of the centre of mass [m]
    steering_ratio: float
    drag_area: float  # c_D A [m2]
    front: Axle
    rear: Axle


class Gains(NamedTuple):
    """TiL Eq. (32)."""

    ax_vx: float  # [-]
    ay_vy: float  # [-]
    yaw_rate: float  # [1/s]
    mass: float  # [kg/s per m/s2]


def load(path: Path) -> DoubleTrack:
    """A car from its TOML file.

    Raises:
        TwinError: no such file, or one that describes no double track.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        front, rear = (
            Axle(
                **{n: float(content[axle][n]) for n in Axle._fields[:5]},
                along=MagicFormula(**content[axle]["along"]),
                across=MagicFormula(**content[axle]["across"]),
            )
            for axle in ("front", "rear")
        )
        numbers = {name: float(content[name]) for name in DoubleTrack._fields[:5]}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise TwinError(f"{path}: describes no double track: {error!r}") from None
    return DoubleTrack(**numbers, front=front, rear=rear)


class DoubleTrackObserver:
    """The model with its corrections.

    Args:
        car: the model.
        gains: of its corrections.
    """

    def __init__(self, car: DoubleTrack, gains: Gains) -> None:
        self.car, self.gains = car, gains
        self.reset(0.0)

    def reset(
        self,
        speed: float,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """See `estimators.base.Estimator`; the only parameter is the mass, missing [kg]."""
        (mass,) = initial_deltas(parameters, ("mass",))
        self._x = np.array([speed, 0.0, 0.0, mass])

    def run(self, drive: Drive) -> Estimate:
        """Observes a whole drive; a measurement that is NaN corrects nothing.

        Raises:
            TwinError: the drive has other measurements, or the model has blown up.
        """
        if drive.output_names[: len(OUTPUTS)] != OUTPUTS:
            raise TwinError(f"drive: has {drive.output_names}, the double track needs {OUTPUTS}")
        n = len(drive)
        states, masses, outputs = np.empty((n, 3)), np.empty((n, 1)), np.empty((n, 3))
        steering = np.ascontiguousarray(drive.channel("steering_wheel_angle"))
        measurements = np.ascontiguousarray(drive.measurements[:, : len(OUTPUTS)])
        done = _run(
            self.car, self.gains, drive.dt, self._x, steering, measurements, states, masses, outputs
        )
        if done < n:
            raise TwinError(f"drive: the double track blew up at t = {drive.time[done]:.3f} s")
        return Estimate(
            time=drive.time,
            states=states,
            parameters=masses,
            outputs=outputs,
            extended=np.empty((n, 0)),
            nominal=np.array([self.car.mass]),
            state_names=STATES,
            parameter_names=("mass",),
            output_names=("ax", "ay", "yaw_rate"),
            extended_names=(),
            estimated=("mass",),
        )


@njit(cache=True)
def friction(curve, slip):
    """Force over load at a slip, TiL Eq. (29)."""
    s = curve.b * slip
    return curve.d * math.sin(curve.c * math.atan(s - curve.e * (s - math.atan(s))))


@njit(cache=True)
def slips(x, y, radius, angle, spin, vx, vy, yaw_rate):
    """Slip ratio and slip angle of a wheel, TiL Eq. (30).

    Args:
        x: of its hub, from the centre of mass [m].
        y: likewise.
        radius: [m].
        angle: by which it is steered [rad].
        spin: its speed [rad/s]; NaN: it rolls freely.
        vx: of the car [m/s].
        vy: likewise.
        yaw_rate: [rad/s].
    """
    ahead, left = vx - y * yaw_rate, vy + x * yaw_rate
    along = max(ahead * math.cos(angle) + left * math.sin(angle), SLOWEST)
    across = left * math.cos(angle) - ahead * math.sin(angle)
    ratio = 0.0
    if not np.isnan(spin):
        ratio = (radius * spin - along) / max(radius * spin, along)
    return ratio, -math.atan(across / along)


@njit(cache=True)
def _axle(car, axle, other, angle, spins, state, mass, ax, ay):
    """Forces in the car's axes and moment about its z axis of an axle's two wheels."""
    vx, vy, yaw_rate = state[0], state[1], state[2]
    wheelbase = abs(axle.x - other.x)
    pressure = 0.5 * AIR_DENSITY * vx * vx
    half = 0.5 * (mass * GRAVITY * abs(other.x) / wheelbase + pressure * axle.lift_area)
    half -= 0.5 * math.copysign(mass * ax * car.height / wheelbase, axle.x)
    transfer = axle.roll_share * mass * ay * car.height / axle.track
    fx, fy, mz = 0.0, 0.0, 0.0
    for k in range(2):
        y = 0.5 * axle.track if k == 0 else -0.5 * axle.track
        load = max(half - transfer if k == 0 else half + transfer, 0.0)
        ratio, alpha = slips(axle.x, y, axle.radius, angle, spins[k], vx, vy, yaw_rate)
        along, across = load * friction(axle.along, ratio), load * friction(axle.across, alpha)
        ahead = along * math.cos(angle) - across * math.sin(angle)
        left = along * math.sin(angle) + across * math.cos(angle)
        fx += ahead
        fy += left
        mz += axle.x * left - y * ahead  # TiL Eq. (28), corrected
    return fx, fy, mz


@njit(cache=True)
def _innovation(measured, own):
    return 0.0 if np.isnan(measured) else measured - own


@njit(cache=True, nogil=True)
def _run(car, gains, dt, x, steering, measurements, states, masses, outputs):
    """All samples of a drive from x = (vx, vy, yaw rate, missing mass); how many were sound."""
    ax, ay = 0.0, 0.0
    for k in range(steering.size):
        y = measurements[k]
        ax, ay = ax if np.isnan(y[Y.ax]) else y[Y.ax], ay if np.isnan(y[Y.ay]) else y[Y.ay]
        mass = max(car.mass + x[3], (1.0 - LARGEST_SHARE) * car.mass)
        angle = steering[k] / car.steering_ratio
        front = _axle(car, car.front, car.rear, angle, y[FRONT_WHEELS:REAR_WHEELS], x, mass, ax, ay)
        rear = _axle(car, car.rear, car.front, 0.0, y[REAR_WHEELS:AFTER_WHEELS], x, mass, ax, ay)
        drag = 0.5 * AIR_DENSITY * car.drag_area * x[0] * abs(x[0])
        # TiL Eq. (31), corrected: specific forces
        own_ax, own_ay = (front[0] + rear[0] - drag) / mass, (front[1] + rear[1]) / mass
        states[k, 0], states[k, 1], states[k, 2] = x[0], x[1], x[2]
        outputs[k, 0], outputs[k, 1], outputs[k, 2] = own_ax, own_ay, x[2]
        lacking = _innovation(y[Y.ax], own_ax)
        vx, vy, yaw_rate = x[0], x[1], x[2]
        x[0] += dt * (own_ax + vy * yaw_rate + gains.ax_vx * lacking)
        x[1] += dt * (own_ay - vx * yaw_rate + gains.ay_vy * _innovation(y[Y.ay], own_ay))
        turn = (front[2] + rear[2]) / car.yaw_inertia
        x[2] += dt * (turn + gains.yaw_rate * _innovation(y[Y.yaw_rate], yaw_rate))
        if abs(y[Y.yaw_rate]) <= LARGEST_YAW_RATE:
            x[3] -= dt * gains.mass * np.sign(ax) * lacking  # TiL Eq. (24), corrected in sign
        masses[k, 0] = x[3]
        if not (abs(x[0]) < 1e3 and abs(x[1]) < 1e3 and abs(x[2]) < 1e3):
            return k
    return steering.size


ENTRY = Entry(
    name="double-track",
    words="a planar double-track model under the same corrections, TiL Section 5.2",
    make=lambda given: DoubleTrackObserver(given.model, given.settings),
    needs=frozenset(("model", "settings")),
    channels=OUTPUTS,
    gives=("mass", "sideslip"),
)
