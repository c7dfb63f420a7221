"""What a car does when it is driven: coasting, cornering, a step of the steering, pedals."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.driving.record import Manoeuvre, record
from twin import BRAKE_TORQUES, DRIVE_TORQUES, INPUTS, Drive, Twin, TwinError, U, Vehicle, X

Array = NDArray[np.float64]

GRAVITY = 9.81
CORNERING_SPEED = 80.0 / 3.6  # [m/s], of ISO 4138 (constant speed) and ISO 7401
LATERAL = 4.0  # [m/s2] of the step, as ISO 7401 has it
_RAMP = 12.0  # [s] of the ramp of the hand wheel
_RAMP_ANGLE = 0.2  # [rad] of the road wheels at its end
_LINEAR = (1.0, 4.0)  # [m/s2] between which the understeer gradient is fitted
_LIFTED = 0.01  # of the load on the inside wheels: from there on the car rolls over
_STEP_AT, _STEP_RATE = 1.0, 8.0  # [s], [rad/s] of the hand wheel: 460 degrees per second
BRAKING = 0.4  # [g] that is asked for
_HUNDRED = 100.0 / 3.6
_LONGEST = 30.0  # [s] of acceleration
_TRACTION = 0.7  # of the weight on the driven axle that the drive force is at most; chosen


class Cornering(NamedTuple):
    """A slow ramp of the hand wheel at constant speed.

    Attributes:
        lateral: (N,) acceleration in the plane of the road [m/s2].
        hand_wheel: (N,) [rad].
        roll: (N,) of the body [rad].
        understeer: gradient at the road wheels [rad per m/s2].
        roll_gradient: [rad per m/s2], positive to the outside.
        largest: lateral acceleration [m/s2], before both inside wheels lift.
        inside: share of the load that is left on the inside wheels then.
    """

    lateral: Array
    hand_wheel: Array
    roll: Array
    understeer: float
    roll_gradient: float
    largest: float
    inside: float


class StepSteer(NamedTuple):
    """A step of the hand wheel at constant speed.

    Attributes:
        time: (N,) since the hand wheel is half way [s].
        yaw_rate: (N,) [rad/s].
        lateral: (N,) acceleration as the IMU measures it, with gravity's share by roll [m/s2].
        rise: time until 90 % of the steady yaw rate [s]; NaN if it is not reached.
        overshoot: of the yaw rate over its steady value, as a share.
    """

    time: Array
    yaw_rate: Array
    lateral: Array
    rise: float
    overshoot: float


class Pedals(NamedTuple):
    """Braking and acceleration.

    Attributes:
        time, speed: (N,) of the acceleration [s], [m/s].
        braking: mean deceleration when `BRAKING` was asked for [g].
        hundred: time from 0 to 100 km/h [s]; inf if it is not reached.
    """

    time: Array
    speed: Array
    braking: float
    hundred: float


def drift_of(twin: Twin) -> float:
    """Lateral offset after 5 s at 80 km/h with the steering held straight [m]."""
    twin.reset(CORNERING_SPEED)
    inputs = np.zeros(len(INPUTS))
    for _ in range(round(5.0 / twin.dt)):
        twin.step(inputs)
    return float(twin.read_states()[X.y])


def cornering_of(vehicle: Vehicle) -> Cornering:
    """A slow ramp of the hand wheel at `CORNERING_SPEED`, after ISO 4138."""
    ratio = vehicle.figures.steering_ratio

    def steering(time: Array) -> Array:
        return ratio * _RAMP_ANGLE * time / _RAMP

    drive = _driven(vehicle, steering, _RAMP)
    yaw, speed = drive.channel("yaw_rate"), np.maximum(drive.truth["vx"], 1.0)
    lateral = _smooth(yaw * speed, 0.2, drive.dt)  # in the road's plane: no gravity by roll
    left = _load_on(drive, "fl", "rl")
    inside = left / np.maximum(left + _load_on(drive, "fr", "rr"), 1.0)
    lifted = inside < _LIFTED
    end = int(np.argmax(lifted)) if lifted.any() else lateral.size
    peak = int(np.argmax(lateral[: max(end, 1)]))
    rising = slice(0, peak + 1)
    wheel = drive.channel("steering_wheel_angle") / ratio
    excess = wheel - vehicle.figures.wheelbase * yaw / speed
    moderate = (lateral[rising] > _LINEAR[0]) & (lateral[rising] < _LINEAR[1])
    if moderate.sum() < 10:
        raise TwinError(
            f"{vehicle.source}: reaches {lateral[peak]:.2g} m/s2 in a curve at 80 km/h; allowed: "
            f"more than {_LINEAR[0]:g}, for a car that steers"
        )
    felt, roll = lateral[rising][moderate], drive.truth["roll"]
    return Cornering(
        lateral=lateral[rising],
        hand_wheel=drive.channel("steering_wheel_angle")[rising],
        roll=roll[rising],
        understeer=float(np.polyfit(felt, excess[rising][moderate], 1)[0]),
        roll_gradient=float(np.polyfit(felt, roll[rising][moderate], 1)[0]),
        largest=float(lateral[peak]),
        inside=float(inside[peak]),
    )


def _load_on(drive: Drive, *wheels: str) -> Array:
    """(N,) the load of wheels together [N]."""
    return np.sum([drive.truth[f"fz_{wheel}"] for wheel in wheels], axis=0)


def step_steer_of(vehicle: Vehicle, cornering: Cornering) -> StepSteer:
    """A step of the hand wheel to a lateral acceleration of `LATERAL`, after ISO 7401."""
    wanted = min(LATERAL, 0.5 * cornering.largest)
    first = int(np.argmax(cornering.lateral >= wanted))
    angle = float(cornering.hand_wheel[first])

    def steering(time: Array) -> Array:
        return np.clip(_STEP_RATE * (time - _STEP_AT), 0.0, angle)

    drive = _driven(vehicle, steering, _STEP_AT + 4.0)
    time = drive.time - (_STEP_AT + 0.5 * angle / _STEP_RATE)
    yaw = drive.truth["yaw_rate"]
    steady = float(yaw[-round(0.5 / drive.dt) :].mean())
    reached = (yaw >= 0.9 * steady) & (time > 0.0)
    return StepSteer(
        time=time,
        yaw_rate=yaw,
        lateral=drive.channel("ay"),
        rise=float(time[np.argmax(reached)]) if reached.any() else float("nan"),
        overshoot=float(yaw.max() / steady - 1.0),
    )


def pedals_of(twin: Twin) -> Pedals:
    """Brakes from 25 m/s by `BRAKING`, then accelerates from rest with full power."""
    car, dt = twin.vehicle.figures, twin.dt
    inputs, speeds = np.zeros(len(INPUTS)), []
    force = BRAKING * GRAVITY * car.mass
    for wheel in range(4):
        share = 0.5 * (car.brake_front if wheel < 2 else 1.0 - car.brake_front)
        inputs[U.brake_torque_fl + wheel] = share * force * car.wheel_radius[wheel // 2]
    twin.reset(25.0)
    for _ in range(round(2.0 / dt)):
        twin.step(inputs)
        speeds.append(twin.read_states()[X.vx])
    settled = round(0.5 / dt)
    braking = (speeds[settled] - speeds[-1]) / ((len(speeds) - 1 - settled) * dt * GRAVITY)
    time, speed = _speeding_up(twin)
    hundred = float(time[-1]) if speed[-1] >= _HUNDRED else float("inf")
    return Pedals(time=time, speed=speed, braking=float(braking), hundred=hundred)


def _speeding_up(twin: Twin) -> tuple[Array, Array]:
    """Times and speeds from rest to 100 km/h, or for `_LONGEST`."""
    car = twin.vehicle.figures
    shares = np.array([car.drive_front, 1.0 - car.drive_front])
    traction = min(
        _TRACTION * load / share for load, share in zip(car.axle_load, shares, strict=True) if share
    )
    inputs, speeds = np.zeros(len(INPUTS)), [0.0]
    twin.reset(0.0)
    while speeds[-1] < _HUNDRED and len(speeds) * twin.dt < _LONGEST:
        force = min(car.power / max(speeds[-1], 1.0), traction)
        torque = 0.5 * force * shares * np.array(car.wheel_radius)
        inputs[DRIVE_TORQUES] = np.repeat(torque, 2)
        inputs[BRAKE_TORQUES] = 0.0
        twin.step(inputs)
        speeds.append(float(twin.read_states()[X.vx]))
    return twin.dt * np.arange(len(speeds)), np.array(speeds)


def _driven(vehicle: Vehicle, steering, seconds: float) -> Drive:
    """A drive at `CORNERING_SPEED` with the hand wheel as a function of time."""
    dt = float(vehicle.compile().opt.timestep)
    time = dt * np.arange(round(seconds / dt))
    manoeuvre = Manoeuvre(
        name="check",
        dt=dt,
        speed=np.full(time.size, CORNERING_SPEED),
        steering=np.asarray(steering(time)),
        road=np.zeros((time.size, 4)),
    )
    return record(vehicle, manoeuvre)


def _smooth(values: Array, seconds: float, dt: float) -> Array:
    """(N,) the mean over a window."""
    n = max(round(seconds / dt), 1)
    padded = np.pad(values, (n // 2, n - 1 - n // 2), mode="edge")
    return np.convolve(padded, np.full(n, 1.0 / n), mode="valid")
