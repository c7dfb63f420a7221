"""An extended Kalman filter over a dynamic bicycle model: the usual sideslip observer.

States are the lateral speed and the yaw rate at the centre of mass, a lateral disturbance d [m/s2]
and a yaw disturbance w [rad/s2], both first-order Gauss-Markov processes:

    v_y' = (F_f cos(delta) + F_r) / m + d - v_x r
    r'   = (l_f F_f cos(delta) - l_r F_r) / J_zz + w

An axle's lateral force is D sin(C arctan(alpha K / (C D))) (Pacejka, Tyre and Vehicle Dynamics,
2nd ed., Eq. 4.49 without curvature); D is what the longitudinal force leaves of the friction
circle, and the loads move with the measured longitudinal acceleration. Measurements are the yaw
rate and the lateral acceleration, which feels gravity through the body's roll by a constant share.
The measured longitudinal speed is an input.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate
from estimators.entry import Entry
from estimators.least_squares import Fit, fit
from twin import Drive, TwinError

Array = NDArray[np.float64]
GRAVITY = 9.81
SHAPE = 1.3  # C; Pacejka's for side force
SLOWEST = 1.0  # [m/s]; slip angles are those at this speed where the car is slower
LONGEST_STEP = 0.0025  # [s] of the Euler steps: stiff tyres at a low speed
LOAD_FILTER = 0.1  # [s], of the acceleration that moves the loads; chosen
RATE = 20.0  # [Hz] at which errors are taken: above what a driver excites
ERROR_SIZE = math.radians(0.2)  # what a good observer leaves of the sideslip's error; chosen
MEMORY = 0.5  # [s], of the errors: what a sample says against a prior; chosen
BLOCK = 2.0  # [s], see `estimators.least_squares`


class Bicycle(NamedTuple):
    """Numbers of the car, its sensors and the filter's noises."""

    mass: float  # [kg]
    front: float  # from the centre of mass to the front axle [m]
    rear: float  # ... to the rear axle [m]
    yaw_inertia: float  # [kg m2]
    height: float = 0.45  # of the centre of mass [m]
    drive_front: float = 0.0  # share of the front axle in driving
    brake_front: float = 0.6  # ... and in braking
    steering_ratio: float = 1.0  # of the steering input to the road wheels' mean angle
    front_stiffness: float = 20.0  # of the axle over its load [1/rad]
    rear_stiffness: float = 25.0
    front_friction: float = 1.1
    rear_friction: float = 1.1
    steering_offset: float = 0.0  # [rad] at the road wheels
    sideslip_offset: float = 0.0  # [rad] of the reference
    lever: float = 0.0  # of the reference before the centre of mass [m]
    ay_offset: float = 0.0  # [m/s2]
    ay_roll: float = 0.0  # share of gravity through roll in the measured a_y
    yaw_rate_offset: float = 0.0  # [rad/s]
    # Natural logarithms of the noises' densities [unit over the root of s] ...
    log_vy: float = math.log(0.1)  # of v_y' [m/s2]
    log_yaw: float = math.log(0.05)  # of r' [rad/s2]
    log_side: float = math.log(0.5)  # of d'
    log_turn: float = math.log(0.3)  # of w'
    log_ay: float = math.log(0.05)  # of a_y [m/s2 over root of Hz]
    yaw_rate_noise: float = 0.0005  # of the yaw rate [rad/s over root of Hz]
    side_time: float = 5.0  # [s], in which d decays
    turn_time: float = 2.0  # [s], in which w decays
    band: float = 1.0  # factor on standard deviations, as `fit_filter` scales them


class Tuned(NamedTuple):
    """A number that may be fitted: how far it is believed to lie from its start, and bounds."""

    sd: float
    low: float
    high: float


# Chosen; relative ones are of passenger and racing cars alike
FREE: Mapping[str, Tuned] = {
    "front_stiffness": Tuned(10.0, 3.0, 80.0),
    "rear_stiffness": Tuned(10.0, 3.0, 80.0),
    "front_friction": Tuned(0.3, 0.5, 2.5),
    "rear_friction": Tuned(0.3, 0.5, 2.5),
    "yaw_inertia": Tuned(400.0, 200.0, 9000.0),
    "steering_offset": Tuned(0.005, -0.05, 0.05),
    "sideslip_offset": Tuned(0.005, -0.03, 0.03),
    "ay_offset": Tuned(0.3, -2.0, 2.0),
    "ay_roll": Tuned(0.05, -0.2, 0.3),
    "yaw_rate_offset": Tuned(0.01, -0.1, 0.1),
    "lever": Tuned(0.2, -1.0, 1.0),
    "brake_front": Tuned(0.1, 0.3, 1.0),
    "height": Tuned(0.1, 0.1, 1.2),
    **{f"log_{name}": Tuned(1.5, -9.0, 4.0) for name in ("vy", "yaw", "side", "turn", "ay")},
}


class Sideslip(NamedTuple):
    """What the filter finds, (N,) each."""

    sideslip: Array  # [rad]
    sd: Array  # [rad]
    yaw_rate: Array  # [rad/s]
    yaw_rate_sd: Array  # [rad/s]
    lateral_force: Array  # [m/s2], the disturbance d
    front_force: Array  # [N], of the front axle's tyres, across the wheel
    rear_force: Array  # [N]


def run(bicycle: Bicycle, drive: Drive) -> Sideslip:
    """Observes a drive.

    Args:
        bicycle: its numbers.
        drive: with `steering_wheel_angle`, `vx`, `yaw_rate` and `ay`, if possible `ax`; a NaN
            among measurements corrects nothing, a NaN in `vx` keeps the last speed.

    Raises:
        TwinError: the drive has no measured vx.
    """
    if "vx" not in drive.output_names or not np.isfinite(drive.channel("vx")).any():
        raise TwinError("bicycle EKF: the drive has no measured vx; allowed: a drive that has it")
    steering = drive.channel("steering_wheel_angle") / bicycle.steering_ratio
    measured = np.column_stack([drive.channel(name) for name in ("vx", "ax", "ay", "yaw_rate")])
    out = np.empty((len(drive), len(Sideslip._fields)))
    numbers = Bicycle(*(float(value) for value in bicycle))  # one type, one compilation
    _run(numbers, drive.dt, np.ascontiguousarray(steering), measured, out)
    return Sideslip(*np.ascontiguousarray(out.T))


class BicycleFilter:
    """The filter over drives with steering_wheel_angle, vx, yaw_rate and ay.

    Args:
        bicycle: its numbers.
    """

    def __init__(self, bicycle: Bicycle) -> None:
        self.bicycle = bicycle

    def reset(
        self,
        speed: float,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """Nothing to reset: each drive begins straight ahead at its first yaw rate."""

    def run(self, drive: Drive) -> Estimate:
        """Sideslip, lateral speed and yaw rate over a whole drive, with standard deviations.

        Raises:
            TwinError: the drive lacks a channel.
        """
        found = run(self.bicycle, drive)
        vx = drive.channel("vx")
        nothing = np.empty((len(drive), 0))
        return Estimate(
            time=drive.time,
            states=np.column_stack([vx, vx * np.tan(found.sideslip), found.yaw_rate]),
            states_sd=np.column_stack([np.full_like(vx, np.nan), vx * found.sd, found.yaw_rate_sd]),
            parameters=nothing,
            outputs=found.sideslip[:, None],
            extended=nothing,
            nominal=np.empty(0),
            state_names=("vx", "vy", "yaw_rate"),
            parameter_names=(),
            output_names=("sideslip",),
            extended_names=(),
            sideslip_sd=found.sd,
        )


def fit_filter(
    start: Bicycle, drives: Sequence[Drive], free: Sequence[str], *, evaluations: int = 15
) -> tuple[Bicycle, Fit]:
    """Fits the car and the filter's noises together to measured sideslips, and scales the band.

    Args:
        start: where the fit starts, and what it believes.
        drives: each with the sideslip among its truth.
        free: names of `FREE`.
        evaluations: the most, derivatives aside.

    Raises:
        TwinError: a name is unknown, or a drive is too short.
    """
    for name in free:
        if name not in FREE:
            raise TwinError(f"bicycle EKF: {name!r} is unknown; allowed: {', '.join(FREE)}")
    strides = [max(round(1.0 / RATE / drive.dt), 1) for drive in drives]

    def errors(point: Array) -> Array:
        car = start._replace(**dict(zip(free, point.tolist(), strict=True)))
        rows = [
            (run(car, drive).sideslip - drive.truth["sideslip"])[::stride]
            for drive, stride in zip(drives, strides, strict=True)
        ]
        found = np.nan_to_num(np.concatenate(rows) / ERROR_SIZE, nan=0.0, posinf=20.0)
        return np.clip(found, -20.0, 20.0)[:, None]

    found = fit(
        lambda points: [errors(point) for point in points],
        [getattr(start, name) for name in free],
        ([FREE[name].low for name in free], [FREE[name].high for name in free]),
        [FREE[name].sd for name in free],
        block=round(BLOCK * RATE),
        memory=round(MEMORY * RATE),
        prior_sd=[FREE[name].sd for name in free],
        evaluations=evaluations,
    )
    car = start._replace(**dict(zip(free, found.values.tolist(), strict=True)))
    return car._replace(band=car.band * _spread(car, drives)), found


def _spread(car: Bicycle, drives: Sequence[Drive]) -> float:
    """Errors in standard deviations: what 95 % of them stay below, over that of a normal one."""
    scaled = []
    for drive in drives:
        found = run(car, drive)
        scaled.append(np.abs(found.sideslip - drive.truth["sideslip"]) / found.sd)
    return max(float(np.nanquantile(np.concatenate(scaled), 0.95)) / 1.96, 1e-3)


@njit(cache=True)
def _axles(car, x, delta, v, ahead, forces):
    """Lateral forces of both axles [N], across the wheels."""
    wheelbase = car.front + car.rear
    slips = (
        delta - math.atan2(x[0] + car.front * x[1], v),
        -math.atan2(x[0] - car.rear * x[1], v),
    )
    moved = car.mass * ahead * car.height / wheelbase
    weight = car.mass * GRAVITY / wheelbase
    loads = weight * car.rear - moved, weight * car.front + moved
    share = car.drive_front if ahead > 0.0 else car.brake_front
    along = car.mass * ahead * share, car.mass * ahead * (1.0 - share)
    stiffness = car.front_stiffness, car.rear_stiffness
    friction = car.front_friction, car.rear_friction
    for i in range(2):
        load = max(loads[i], 0.1 * weight)
        most = friction[i] * load
        used = min(abs(along[i]) / most, 0.95)
        peak = most * math.sqrt(1.0 - used * used)
        slope = stiffness[i] * load / (SHAPE * peak)
        forces[i] = peak * math.sin(SHAPE * math.atan(slope * slips[i]))


@njit(cache=True)
def _rates(car, x, delta, v, speed, ahead, forces, rates):
    """Derivatives of the states (4,) and, behind them, the specific force felt (1,)."""
    _axles(car, x, delta, v, ahead, forces)
    front = forces[0] * math.cos(delta)
    side = (front + forces[1]) / car.mass + x[2]
    rates[0] = side - speed * x[1]
    rates[1] = (car.front * front - car.rear * forces[1]) / car.yaw_inertia + x[3]
    rates[2] = -x[2] / car.side_time
    rates[3] = -x[3] / car.turn_time
    rates[4] = (1.0 + car.ay_roll) * side


@njit(cache=True)
def _slopes(car, x, delta, v, speed, ahead, forces, rates, slopes):
    """Derivatives (5, 4) of `_rates` by differences; leaves the rates at x."""
    there = np.empty(5)
    _rates(car, x, delta, v, speed, ahead, forces, rates)
    for j in range(4):
        step = 1e-4
        kept = x[j]
        x[j] = kept + step
        _rates(car, x, delta, v, speed, ahead, forces, there)
        x[j] = kept
        for i in range(5):
            slopes[i, j] = (there[i] - rates[i]) / step
    _axles(car, x, delta, v, ahead, forces)


@njit(cache=True)
def _correct(x, p, h, innovation, variance):
    """A scalar measurement h x."""
    ph = p @ h
    gain = ph / (h @ ph + variance)
    x += gain * innovation
    p -= np.outer(gain, ph)


@njit(cache=True, nogil=True)
def _run(car, dt, steering, measured, out):
    noise = np.exp(np.array([car.log_vy, car.log_yaw, car.log_side, car.log_turn])) ** 2
    p = np.diag(np.array([0.1, 0.01, 0.5, 0.1]) ** 2)
    x, forces, rates, slopes = np.zeros(4), np.zeros(2), np.zeros(5), np.zeros((5, 4))
    of_yaw_rate, eye = np.array([0.0, 1.0, 0.0, 0.0]), np.eye(4)
    r_ay, r_yaw = math.exp(car.log_ay) ** 2 / dt, car.yaw_rate_noise**2 / dt
    parts = max(math.ceil(dt / LONGEST_STEP), 1)
    h = dt / parts
    speed, ahead = 0.0, 0.0
    if not np.isnan(measured[0, 3]):
        x[1] = measured[0, 3] - car.yaw_rate_offset
    for k in range(steering.size):
        vx, ax, ay, yaw_rate = measured[k]
        if not np.isnan(vx):
            speed = vx
        if not np.isnan(ax):
            ahead += min(dt / LOAD_FILTER, 1.0) * (ax - ahead)
        v = max(speed, SLOWEST)
        delta = steering[k] + car.steering_offset
        _slopes(car, x, delta, v, speed, ahead, forces, rates, slopes)
        if not np.isnan(ay):
            _correct(x, p, slopes[4].copy(), ay - car.ay_offset - rates[4], r_ay)
        if not np.isnan(yaw_rate):
            _correct(x, p, of_yaw_rate, yaw_rate - car.yaw_rate_offset - x[1], r_yaw)
        vy = x[0] + car.lever * x[1]
        spread = p[0, 0] + 2.0 * car.lever * p[0, 1] + car.lever**2 * p[1, 1]
        out[k, 0] = math.atan2(vy, v) + car.sideslip_offset
        out[k, 1] = car.band * math.sqrt(max(spread, 0.0)) / v
        out[k, 2] = x[1]
        out[k, 3] = car.band * math.sqrt(max(p[1, 1], 0.0))
        out[k, 4] = x[2]
        out[k, 5], out[k, 6] = forces
        for _ in range(parts):
            _slopes(car, x, delta, v, speed, ahead, forces, rates, slopes)
            step = eye + h * slopes[:4]
            x += h * rates[:4]
            p[:] = step @ p @ step.T
            for i in range(4):
                p[i, i] += h * noise[i]


ENTRY = Entry(
    name="bicycle-ekf",
    words="sideslip by an extended Kalman filter over a dynamic bicycle model with disturbances",
    make=lambda given: BicycleFilter(given.model),
    needs=frozenset(("model",)),
    channels=("yaw_rate", "ay", "vx"),
    gives=("sideslip",),
)
