"""The compiled staged observer: a state machine that runs one law after the other.

    MASS  --(straight for long enough)-->  PITCH  --(straight)-->  CM  --(loaded)-->  ROLL_YAW

Each stage has its own condition on the drive, under which alone it estimates and its clock runs;
when the clock reaches the stage's time, the next one begins. The last one stays.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimators.ensemble.blocks import (
    ABSENT,
    AFTER_WHEELS,
    FIRST_WHEEL,
    LEAST_SPIN,
    NX,
    NY,
    ROLL,
    advance,
    are_sound,
    follow_speed,
    kalman_step,
    move_states,
)
from estimators.ensemble.stepping import read_extended, read_states, set_parameters
from estimators.til.law import advance_law
from twin import IMU, PARAMETER, PARAMETERS, P, Y

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MASS, PITCH, CM, ROLL_YAW = range(4)
BIASES = IMU.stop  # of the first channels
AX, AY, YAW_RATE = Y.ax, Y.ay, Y.yaw_rate
CM_X = P.cm_x  # cm_y and cm_z come after
# The stage of each parameter that a law corrects; those of the CM have no law
STAGE_OF = np.array(
    [{"mass": MASS, "Jyy": PITCH, "Jxx": ROLL_YAW, "Jzz": ROLL_YAW}.get(n, -1) for n in PARAMETERS]
)
OFFSET = PARAMETER["cm_x"].step  # of the CM of each twin [m]


class Setup(NamedTuple):
    """What does not change."""

    seconds: Array  # (4,) of each stage's own condition before the next one begins
    straight: float  # largest yaw rate of straight driving [rad/s]
    yaw_filter: float  # time constant of the yaw rate's low pass [s]
    loaded: float  # least quasi-static acceleration in the plane that tells of the CM [m/s2]
    quasi_static: float  # time constant of each of two low passes [s]
    least_wheel_speed: float  # of a car that moves [rad/s]
    noise: Array  # (ny,) variance of a sample's noise; NaN: the CM's fit does not use the channel
    step_limit: Array  # (9,) the most that CM and biases may move in a block
    block: int  # samples
    speed_gain: float  # of the twins' speeds [1/s]
    dt: float  # of a sample [s]


class Memory(NamedTuple):
    """Where the machine stands, beside its four twins: at the estimate and off in one of the CM."""

    stage: Indices  # (1,)
    clock: Array  # (4,) seconds that each stage has run
    yaw_rate: Array  # (1,) low-passed [rad/s]
    theta: Array  # (np,) parameters of twin 0
    laws: Array  # memory of each law
    z: Array  # (9,) CM and biases of the IMU's channels
    covariance: Array  # (9, 9)
    slow: Array  # (2, 5, ny) two low passes of the twins' outputs and, last, the measured ones
    begun: Indices  # (1,) whether these have


@njit(cache=True, nogil=True)
def _condition(setup, memory, y):
    """Whether the drive is, now, what the stage wants."""
    if setup.seconds[memory.stage[0]] < setup.dt:  # nothing to wait for
        return True
    for k in range(FIRST_WHEEL, AFTER_WHEELS):
        if y[k] < setup.least_wheel_speed:  # NaN is not
            return False
    straight = abs(memory.yaw_rate[0]) < setup.straight
    if memory.stage[0] == CM:
        slow = memory.slow[1, 0]
        return np.hypot(slow[AX], slow[AY]) >= setup.loaded
    return not straight if memory.stage[0] == ROLL_YAW else straight


@njit(cache=True, nogil=True)
def _advance(setup, memory, y):
    """One sample of the machine; whether its stage is to estimate."""
    if not np.isnan(y[YAW_RATE]):
        share = setup.dt / (setup.yaw_filter + setup.dt)
        memory.yaw_rate[0] += share * (y[YAW_RATE] - memory.yaw_rate[0])
    active, stage = _condition(setup, memory, y), memory.stage[0]
    if active:
        memory.clock[stage] += setup.dt
        if memory.clock[stage] >= setup.seconds[stage]:
            memory.stage[0] = stage + 1
            return False
    return active


@njit(cache=True, nogil=True)
def set_all(cars, theta):
    """Gives every twin the parameters (np,), and three of them their offset."""
    for i in range(cars.size):
        p = theta.copy()
        if i > 0:
            p[CM_X + i - 1] += OFFSET
        set_parameters(cars[i], p)


@njit(cache=True, nogil=True)
def _single_laws(cars, setup, memory, laws, y, out, active):
    """The laws of the stage correct the twins; the filters of the others go on."""
    changed = False
    for k in range(laws.size):
        i = laws[k].parameter
        mine = active and STAGE_OF[i] == memory.stage[0]
        d = advance_law(laws[k], memory.laws[k], y, out, setup.dt, mine)
        if d != 0.0:
            p = memory.theta.copy()
            p[i] += d
            set_parameters(cars[0], p)
            memory.theta[i] = p[i]  # what a body can have
            changed = True
    if changed:
        set_all(cars, memory.theta)


@njit(cache=True, nogil=True)
def _low_pass(setup, memory, block):
    """A block of the twins' and the measured outputs through both low passes."""
    time = setup.block * setup.dt
    share = time / (setup.quasi_static + time)
    n = block.mean.shape[0]
    for i in range(n + 1):
        for j in range(NY):
            value = block.mean[i, j] if i < n else block.measured[j]
            if np.isnan(value):
                continue
            if memory.begun[0] == 0:
                memory.slow[:, i, j] = value
            memory.slow[0, i, j] += share * (value - memory.slow[0, i, j])
            memory.slow[1, i, j] += share * (memory.slow[0, i, j] - memory.slow[1, i, j])
    memory.begun[0] = 1


@njit(cache=True, nogil=True)
def _find_cm(cars, setup, memory, block):
    """A step of the fit of CM and biases to the low-passed outputs.

    States and filters of the twins move along, by their own sensitivities: else they would show the
    old CM for a while, and the fit would correct it twice.
    """
    slow, n = memory.slow[1], cars.size
    h, r, variance = np.zeros((NY, 3 + BIASES)), np.zeros(NY), np.full(NY, ABSENT)
    for j in range(NY):
        for i in range(3):
            h[j, i] = (slow[i + 1, j] - slow[0, j]) / OFFSET
        if j < BIASES:
            h[j, 3 + j] = 1.0
        if block.number[j] > 0.0 and not np.isnan(setup.noise[j]):
            r[j] = slow[n, j] - slow[0, j] - (memory.z[3 + j] if j < BIASES else 0.0)
            variance[j] = setup.noise[j] / block.number[j]
    before = memory.z[:3].copy()
    kalman_step(memory.z, memory.covariance, h, r, variance, setup.step_limit)
    d = (memory.z[:3] - before) / OFFSET
    memory.theta[CM_X : CM_X + 3] = memory.z[:3]
    for filtered in memory.slow:
        change = d @ (filtered[1:n] - filtered[0])
        for i in range(n):
            filtered[i] += change
    states = np.zeros((n, NX))
    for i in range(n):
        read_states(cars[i], states[i])
    change = d @ (states[1:] - states[0])
    for i in range(n):
        move_states(cars[i], change.copy(), states[0, ROLL])
    set_all(cars, memory.theta)


@njit(cache=True, nogil=True)
def run(cars, setup, memory, block, laws, inputs, measurements, log):
    """All samples of a drive; returns how many were sound."""
    for k in range(inputs.shape[0]):
        read_states(cars[0], log.states[k])
        y = measurements[k]
        full = advance(cars, block, setup.block, inputs[k], y)
        active = _advance(setup, memory, y)
        _single_laws(cars, setup, memory, laws, y, block.out[0], active)
        if full:
            _low_pass(setup, memory, block)
            share = setup.speed_gain * setup.block * setup.dt
            follow_speed(cars, block.mean, block.measured, block.number, share, LEAST_SPIN)
            if active and memory.stage[0] == CM:
                _find_cm(cars, setup, memory, block)
        log.parameters[k] = memory.theta
        log.outputs[k] = block.out[0]
        read_extended(cars[0], log.extended[k])
        log.stage[k] = memory.stage[0]
        log.sd[k, : laws.size] = np.sqrt(memory.laws[:, 0])
        for i in range(3):
            log.sd[k, laws.size + i] = np.sqrt(memory.covariance[i, i])
        if not are_sound(cars):
            return k
    return inputs.shape[0]


class Log(NamedTuple):
    """Histories of N samples, to be filled."""

    states: Array  # (N, nx)
    parameters: Array  # (N, np)
    outputs: Array  # (N, ny)
    extended: Array  # (N, 4, 9)
    stage: Indices  # (N,)
    sd: Array  # (N, laws + 3)
