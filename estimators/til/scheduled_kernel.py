"""The compiled loop of `estimators.til.scheduled`: twin, gains from a covariance, corrections.

Error states are x = (v_y, r, F_front, F_rear, b_ay, b_r): what the twin lacks of lateral speed and
yaw rate, lateral forces on its axles that its tyres do not account for, offsets of two sensors.
Their covariance runs along the drive with the linear model of `estimators.til.linear_schedule`; its
gain corrects the twin's states and parameters.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimators.speed_follower import SpeedFollower, follow
from estimators.til.linear_schedule import FORCES, VY, YAW_RATE, LinearSchedule, look_up
from twin import EXTENDED, OUTPUTS, PARAMETERS, STATES
from twin.kernel import correct, is_sound, read_states, set_parameters, step

Array = NDArray[np.float64]
GRAVITY = 9.81
NX = 6
OF_AY, OF_YAW_RATE = range(2)
SLOWEST = 2.0  # [m/s]; slower, slips and angles are reckoned as at this speed
LARGEST_SLIP = 0.12  # of a wheel against the road, beyond a tyre's peak; chosen
SPEED_GAIN = 10.0  # [1/s] of the measured speed's correction; chosen
FASTEST = 30.0  # [m/s2] that this correction may be
CLIPPED = 4.0  # standard deviations of an innovation that are believed
CONSISTENCY = 1.0  # [s], of the mean squared innovations; chosen
# Mean squared innovations in their variances from which the axle forces are believed to change
# faster, and by how much at most: a twin with too little grip else slides more to get more force
SURPRISED, MOST_SURPRISED = 2.0, 30.0
LEAST_SHARE = 0.1  # of the forces' noise at g that is there straight ahead
LARGEST_FORCE = 2.0  # [m/s2] over the car's mass, of an axle's force: what is more is no error
LEAST_FORCE = 0.5  # [m/s2] over the car's mass: standard deviation of an axle's force, judging it
# Lateral speed against the kinematics v_y' = a_y - v_x r, which no tyre has a part in: over
# `KINEMATIC_TIME` gravity through roll and bank adds up to less than `LARGEST_GAP`. A twin that
# would go further is held, and not believed for `HELD_TIME`. Chosen: half of what gravity adds on a
# bank of 3 degrees is left for it; the calibrated cars stay below two thirds
KINEMATIC_TIME, LARGEST_GAP, HELD_TIME = 3.0, 1.5, 5.0  # [s], [m/s], [s]
UNSTEADY = 0.25  # share of the doubt at the start that a steady bend leaves; chosen
# A twin beyond these limits is reset
LARGEST_ROLL = 0.5  # [rad]
LARGEST_ANGLE = 0.9  # [rad] of sideslip, at more than `MOVING`
LARGEST_LAG = 3.0  # [m/s] of speed, and a fifth of the speed more
MOVING = 5.0  # [m/s]
SOUND, ROLL, ANGLE, LAG, BLOWN_UP = range(5)

_VX, _ROLL = STATES.index("vx"), STATES.index("roll")
_SPINS = STATES.index("wheel_speed_fl")
_AX, _AY, _AZ = (OUTPUTS.index(name) for name in ("ax", "ay", "az"))
_R = OUTPUTS.index("yaw_rate")
_SLIP, _FX = EXTENDED.index("slip_ratio_fl"), EXTENDED.index("fx_fl")


class Noise(NamedTuple):
    """Densities of the noises [unit over the root of s], and how long forces last."""

    vy: float = 0.3  # of v_y' [m/s2]
    yaw_rate: float = 0.1  # of r' [rad/s2]
    # of an axle's force over the car's mass [m/s2] at a lateral acceleration of g: what tyres get
    # wrong is in proportion to what they carry, but for `LEAST_SHARE`
    # more lets the forces explain what the slip of saturated tyres does, and the sideslip runs away
    front: float = 0.1
    rear: float = 0.03
    ay: float = 0.08  # of a_y, measured [m/s2 over root of Hz]
    measured_yaw_rate: float = 0.0005  # [rad/s over root of Hz]
    ay_offset: float = 0.0  # at the start [m/s2]; zero: there is none
    yaw_rate_offset: float = 0.0  # [rad/s]
    drift: float = 0.01  # of both, as a share of these over the root of s
    force_time: float = 5.0  # [s] in which a force decays
    # factor on standard deviations, as noise is not all that is wrong with a twin: what cars whose
    # tyres differ by a tenth or two from their files' need; a calibration finds it anew
    band: float = 2.5


class Memory(NamedTuple):
    """What the loop keeps."""

    p: Array  # (6, 6) covariance
    offsets: Array  # (2,) of a_y and yaw rate
    innovation: Array  # (2, 2) sums and numbers since the last correction
    consistency: Array  # (3,) mean squares of innovations and axle forces, in their variances
    speed: Array  # (2,) the last measured speed, its derivative
    parameters: Array  # (np,)
    radius: Array  # (4,) rolling radii of the wheels [m]
    kinematic: Array  # (2,) lateral speed by kinematics [m/s], for how long it need not be watched


class History(NamedTuple):
    """What the loop writes, a row per sample."""

    states: Array  # (N, nx)
    parameters: Array  # (N, np)
    outputs: Array  # (N, ny)
    extended: Array  # (N, ne)
    held: Array  # (N,) 1 where kinematics held the lateral speed within the last `HELD_TIME`
    sd: Array  # (N, 6) of v_y, yaw rate, both axles' lateral tyre forces, both axle forces
    consistency: Array  # (N, 3)


class Fixed(NamedTuple):
    """What does not change along a drive."""

    follower: SpeedFollower
    schedule: LinearSchedule
    noise: Noise
    every: int  # samples between corrections
    mass: float  # [kg]
    half_track: float  # [m]
    torqueless: bool
    levelled: bool  # whether the measured a_y has gravity through roll taken out


def new_memory(noise: Noise, parameters: Array, radius: Array, speed: float) -> Memory:
    """Memory of an observer that starts."""
    memory = Memory(
        p=np.zeros((NX, NX)),
        offsets=np.zeros(2),
        innovation=np.zeros((2, 2)),
        consistency=np.ones(3),
        speed=np.array([speed, 0.0]),
        parameters=parameters.copy(),
        radius=radius,
        kinematic=np.zeros(2),
    )
    memory.p[4, 4], memory.p[5, 5] = noise.ay_offset**2, noise.yaw_rate_offset**2
    return memory


def renew(memory: Memory, mass: float, speed: float) -> None:
    """Forgets what was known of the twin's states at a speed; offsets of the sensors stay."""
    share = min(max(speed, 0.0) / MOVING, 1.0)  # a car that hardly moves hardly slides
    sd = np.array([0.5 * share, 0.1 * share, 0.5 * mass, 0.5 * mass])
    memory.p[:4], memory.p[:, :4] = 0.0, 0.0
    memory.p[np.arange(4), np.arange(4)] = sd**2
    memory.parameters[list(FORCES)] = 0.0
    memory.innovation[:] = 0.0
    memory.kinematic[0] = 0.0


def doubt_anew(memory: Memory, mass: float, speed: float) -> None:
    """Believes the twin's states no more than a bend that was assumed to be steady tells."""
    share = min(max(speed, 0.0) / MOVING, 1.0)
    sd = UNSTEADY * np.array([0.5 * share, 0.1 * share, 0.5 * mass, 0.5 * mass])
    memory.p[np.arange(4), np.arange(4)] += sd**2
    memory.innovation[:] = 0.0
    memory.kinematic[1] = 0.0


@njit(cache=True, nogil=True)
def _levelled(y, roll):
    """The lateral acceleration without gravity."""
    return y[_AY] * math.cos(roll) - y[_AZ] * math.sin(roll)


@njit(cache=True, nogil=True)
def _speed(memory, measured, dt):
    """Keeps the measured speed and its derivative; whether there is one."""
    if np.isnan(measured):
        return False
    change = (measured - memory.speed[0]) / dt
    memory.speed[1] += min(dt / 0.1, 1.0) * (change - memory.speed[1])
    memory.speed[0] = measured
    return True


@njit(cache=True, nogil=True)
def _hold_wheels(car, radius, half_track, x, dx):
    """Keeps wheels from spinning up or locking: a bounded slip; whether one had to be held."""
    held = False
    for w in range(4):
        side = -1.0 if w % 2 == 0 else 1.0
        speed = x[_VX] + side * half_track * x[YAW_RATE]
        if w < 2:
            speed /= math.cos(math.atan2(x[VY] + 0.5 * x[YAW_RATE], max(x[_VX], SLOWEST)))
        room = LARGEST_SLIP * max(abs(speed), SLOWEST)
        slide = x[_SPINS + w] * radius[w] - speed
        if abs(slide) > room:
            dx[_SPINS + w] = (math.copysign(room, slide) - slide) / radius[w]
            held = True
    return held


@njit(cache=True, nogil=True)
def _predict(p, transition, noise, mass, share, moving, dt):
    """Covariance over one interval; returns by how much forces decay."""
    decay = math.exp(-dt / noise.force_time)
    f = np.eye(NX)
    for i in range(2):
        for j in range(4):
            f[i, j] = transition[i, j]
    f[2, 2] = f[3, 3] = decay
    p[:] = f @ p @ f.T
    p[0, 0] += (noise.vy * moving) ** 2 * dt
    p[1, 1] += (noise.yaw_rate * moving) ** 2 * dt
    p[2, 2] += (noise.front * share * mass) ** 2 * dt
    p[3, 3] += (noise.rear * share * mass) ** 2 * dt
    p[4, 4] += (noise.drift * noise.ay_offset) ** 2 * dt
    p[5, 5] += (noise.drift * noise.yaw_rate_offset) ** 2 * dt
    return decay


@njit(cache=True, nogil=True)
def _update(p, x, h, innovation, variance):
    """A scalar measurement h x; returns the square of what it says anew, in its variance.

    The covariance is updated in Joseph's form, which keeps it symmetric and positive: a model that
    grows, as a car that brakes at its limit does, else turns rounding errors into negative
    variances.
    """
    ph = p @ h
    s = h @ ph + variance
    left = innovation - h @ x
    square = left * left / s
    left = min(max(left, -CLIPPED * math.sqrt(s)), CLIPPED * math.sqrt(s))
    gain = ph / s
    x += gain * left
    rest = np.eye(NX) - np.outer(gain, h)
    joseph = rest @ p @ rest.T + variance * np.outer(gain, gain)
    p[:] = 0.5 * (joseph + joseph.T)
    return square


@njit(cache=True, nogil=True)
def _correction(fixed, memory, transition, outputs, dt):
    """The correction (6,) of one interval."""
    noise, p, x, h = fixed.noise, memory.p, np.zeros(NX), np.zeros(NX)
    for i in range(2):
        count = memory.innovation[i, 1]
        if count == 0.0:
            continue
        innovation = memory.innovation[i, 0] / count - memory.offsets[i]
        h[:] = 0.0
        if i == OF_AY:
            h[:4] = outputs[0]
            h[4] = 1.0
            variance = noise.ay**2 / dt
        else:
            h[1] = h[5] = 1.0
            variance = noise.measured_yaw_rate**2 / dt
        square = _update(p, x, h, innovation, variance)
        memory.consistency[i] += min(dt / CONSISTENCY, 1.0) * (square - memory.consistency[i])
    memory.innovation[:] = 0.0
    return x


@njit(cache=True, nogil=True)
def _judge_forces(fixed, memory, share, dt):
    """Keeps how large the axle forces are against what they were believed to be."""
    noise, largest = fixed.noise, 0.0
    for i in range(2):
        density = noise.front if i == 0 else noise.rear
        sd = fixed.mass * max(density * share * math.sqrt(0.5 * noise.force_time), LEAST_FORCE)
        largest = max(largest, (memory.parameters[FORCES[i]] / sd) ** 2)
    memory.consistency[2] += min(dt / CONSISTENCY, 1.0) * (largest - memory.consistency[2])


@njit(cache=True, nogil=True)
def _hold_to_kinematics(memory, vy, side, speed, yaw_rate, dt):
    """What the twin's lateral speed has to be changed by; keeps that of the kinematics.

    Args:
        memory: a `Memory`.
        vy: of the twin, corrected [m/s].
        side: measured lateral acceleration, NaN where it is missing [m/s2].
        speed: measured [m/s].
        yaw_rate: measured, NaN where it is missing [rad/s].
        dt: [s].
    """
    kinematic = memory.kinematic
    kinematic[1] = max(kinematic[1] - dt, 0.0)
    if np.isnan(side) or np.isnan(yaw_rate):
        kinematic[0] = vy
        return 0.0
    kinematic[0] += dt * (side - speed * yaw_rate + (vy - kinematic[0]) / KINEMATIC_TIME)
    gap = vy - kinematic[0]
    if abs(gap) <= LARGEST_GAP:
        return 0.0
    kinematic[1] = HELD_TIME
    return math.copysign(LARGEST_GAP, gap) - gap


@njit(cache=True, nogil=True)
def _fault(x, speed, known):
    """Why the twin has to be reset, if it has."""
    if abs(x[_ROLL]) > LARGEST_ROLL:
        return ROLL
    if known and abs(x[_VX] - speed) > LARGEST_LAG + 0.2 * abs(speed):
        return LAG
    if x[_VX] > MOVING and abs(math.atan2(x[VY], x[_VX])) > LARGEST_ANGLE:
        return ANGLE
    return SOUND


@njit(cache=True, nogil=True)
def _spread(memory, outputs, noise, sd):
    """Standard deviations, as in `History`."""
    p = memory.p
    sd[0], sd[1] = p[0, 0], p[1, 1]
    for i in range(2):
        total = 0.0
        for m in range(4):
            for n in range(4):
                total += outputs[1 + i, m] * p[m, n] * outputs[1 + i, n]
        sd[2 + i] = total
        sd[4 + i] = p[2 + i, 2 + i]
    for i in range(6):
        sd[i] = noise.band * math.sqrt(max(sd[i], 0.0))
    if memory.kinematic[1] > 0.0:
        sd[0] = max(sd[0], LARGEST_GAP)


@njit(cache=True, nogil=True)
def observe(car, fixed, memory, inputs, measurements, speeds, start, history):
    """Samples from `start` on; returns how far it came, and why it stopped before the end.

    Args:
        car: the twin.
        fixed: a `Fixed`.
        memory: a `Memory`.
        inputs: (N, nu).
        measurements: (N, ny), NaN where there is none.
        speeds: (N,) measured [m/s], NaN where there is none.
        start: the first sample.
        history: a `History`.
    """
    n, dt = inputs.shape[0], car.dt
    interval = fixed.every * dt
    x, y, dx = np.zeros(len(STATES)), np.zeros(len(OUTPUTS)), np.zeros(len(STATES))
    u, sd = np.zeros(inputs.shape[1]), np.zeros(6)
    p_now = np.zeros(len(PARAMETERS))
    transition, outputs = np.zeros((4, 4)), np.zeros((3, 4))
    felt = 0.0
    for k in range(start, n):
        read_states(car, x)
        known = _speed(memory, speeds[k], dt)
        history.states[k] = x
        u[:] = inputs[k]
        if fixed.torqueless:
            ax = measurements[k, _AX]
            ahead = memory.speed[1] - x[VY] * x[YAW_RATE] if np.isnan(ax) else ax
            follow(fixed.follower, x[_VX], ahead, x, u)
        step(car, u, y)
        history.outputs[k] = y
        history.extended[k] = car.tyre_output.ravel()
        side = _levelled(y, x[_ROLL]) if fixed.levelled else y[_AY]
        felt += min(dt / 0.05, 1.0) * (side - felt)
        if not np.isnan(measurements[k, _AY]):
            memory.innovation[OF_AY, 0] += measurements[k, _AY] - side
            memory.innovation[OF_AY, 1] += 1.0
        if not np.isnan(measurements[k, _R]):
            memory.innovation[OF_YAW_RATE, 0] += measurements[k, _R] - y[_R]
            memory.innovation[OF_YAW_RATE, 1] += 1.0
        dx[:] = 0.0
        moved = _hold_wheels(car, memory.radius, fixed.half_track, x, dx)
        if known:
            gap = speeds[k] - x[_VX]
            dx[_VX] = min(max(SPEED_GAIN * gap, -FASTEST), FASTEST) * dt
            moved = True
        if (k + 1) % fixed.every == 0:
            look_up(fixed.schedule, max(memory.speed[0], SLOWEST), abs(felt), transition, outputs)
            surprise = max(memory.consistency[0], memory.consistency[1]) / SURPRISED
            share = LEAST_SHARE + abs(felt) / GRAVITY
            if memory.kinematic[1] > HELD_TIME - CONSISTENCY:
                surprise = MOST_SURPRISED
            share *= min(max(surprise, 1.0), MOST_SURPRISED)
            moving = min(abs(memory.speed[0]) / MOVING, 1.0)  # a slow car rolls where it points
            decay = _predict(memory.p, transition, fixed.noise, fixed.mass, share, moving, interval)
            change = _correction(fixed, memory, transition, outputs, interval)
            dx[VY] += change[0]
            dx[YAW_RATE] += change[1]
            for i in range(2):
                memory.parameters[FORCES[i]] *= decay
                force = memory.parameters[FORCES[i]] + change[2 + i]
                most = LARGEST_FORCE * fixed.mass
                memory.parameters[FORCES[i]] = min(max(force, -most), most)
                memory.offsets[i] += change[4 + i]
            _judge_forces(fixed, memory, share, interval)
            p_now[:] = memory.parameters
            set_parameters(car, p_now)
            moved = True
            _spread(memory, outputs, fixed.noise, sd)
        back = _hold_to_kinematics(
            memory, x[VY] + dx[VY], measurements[k, _AY] - memory.offsets[0], memory.speed[0],
            measurements[k, _R] - memory.offsets[1], dt,
        )  # fmt: skip
        dx[VY] += back
        if moved or back != 0.0:
            correct(car, dx)
        history.held[k] = 1.0 if memory.kinematic[1] > 0.0 else 0.0
        history.sd[k] = sd
        history.parameters[k] = memory.parameters
        history.consistency[k] = memory.consistency
        if not is_sound(car):
            return k, BLOWN_UP
        fault = _fault(x, memory.speed[0], known)
        if fault != SOUND:
            return k, fault
    return n, SOUND
