"""The compiled part of `estimators.staged`: a state machine that runs one law after the other.

    MASS  --(straight for long enough)-->  PITCH  --(straight)-->  CM  --(loaded)-->  ROLL_YAW

Each stage has its own condition on the drive, under which alone it estimates and its clock runs;
when the clock reaches the stage's time, the next one begins. The last one stays.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimators.joint_kernel import (
    AX,
    AY,
    BLOCKS,
    NY,
    SAMPLES,
    _estimate,
    _follow_speed,
    _sensitivity,
)
from estimators.law import advance_law
from twin import OUTPUTS, PARAMETERS
from twin.kernel import is_sound, read_states, set_parameters, step

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MASS, PITCH, CM, ROLL_YAW = range(4)
YAW_RATE, WHEEL_SPEED = OUTPUTS.index("yaw_rate"), OUTPUTS.index("wheel_speed_fl")
# The stage of each parameter that a law corrects; those of the CM have no law
STAGE_OF = np.array(
    [{"mass": MASS, "Jyy": PITCH, "Jxx": ROLL_YAW, "Jzz": ROLL_YAW}.get(n, -1) for n in PARAMETERS]
)


class Machine(NamedTuple):
    """When which stage runs."""

    seconds: Array  # (4,) of each stage's own condition before the next one begins
    straight: float  # largest yaw rate of straight driving [rad/s]
    yaw_filter: float  # time constant of the yaw rate's low pass [s]
    loaded: float  # least quasi-static acceleration in the plane that tells of the CM [m/s2]
    quasi_static: float  # time constant of each of two low passes [s]
    least_wheel_speed: float  # of a car that moves [rad/s]


class Progress(NamedTuple):
    """Where the machine stands, beside the joint observer's memory."""

    stage: Indices  # (1,)
    clock: Array  # (4,) seconds that each stage has run
    yaw_rate: Array  # (1,) low-passed [rad/s]
    slow: Array  # (2, n + 1, ny) two low passes of the twins' outputs and, last, the measured ones
    laws: Array  # memory of each law


@njit(cache=True, nogil=True)
def _condition(machine, progress, y):
    """Whether the drive is, now, what the stage wants."""
    for k in range(WHEEL_SPEED, WHEEL_SPEED + 4):
        if y[k] < machine.least_wheel_speed:  # NaN is not
            return False
    stage = progress.stage[0]
    straight = abs(progress.yaw_rate[0]) < machine.straight
    if stage == CM:
        slow = progress.slow[1, 0]
        return np.hypot(slow[AX], slow[AY]) >= machine.loaded
    return not straight if stage == ROLL_YAW else straight


@njit(cache=True, nogil=True)
def _advance(machine, progress, y, dt):
    """One sample of the machine; whether its stage is to estimate."""
    if not np.isnan(y[YAW_RATE]):
        progress.yaw_rate[0] += dt / machine.yaw_filter * (y[YAW_RATE] - progress.yaw_rate[0])
    active = _condition(machine, progress, y)
    if active:
        stage = progress.stage[0]
        progress.clock[stage] += dt
        if stage < ROLL_YAW and progress.clock[stage] >= machine.seconds[stage]:
            progress.stage[0] = stage + 1
            return False
    return active


@njit(cache=True, nogil=True)
def _single_laws(cars, setup, memory, machine, progress, laws, y, active):
    """The laws of the stage correct all twins; the filters of the others go on."""
    changed = False
    for k in range(laws.size):
        mine = active and STAGE_OF[laws[k].parameter] == progress.stage[0]
        d = advance_law(laws[k], progress.laws[k], y, memory.out[0], setup.dt, mine)
        if d != 0.0:
            memory.theta[laws[k].parameter] += d
            changed = True
    if not changed:
        return
    memory.p[:] = memory.theta
    set_parameters(cars[0], memory.p)
    memory.theta[:] = memory.p  # what a body can have
    for i in range(setup.index.size):
        memory.p[:] = memory.theta
        memory.p[setup.index[i]] += setup.offset[i]
        set_parameters(cars[i + 1], memory.p)


@njit(cache=True, nogil=True)
def _low_pass(setup, memory, machine, progress):
    """A block of the twins' and the measured outputs through both low passes."""
    n = memory.total.shape[0]
    share = setup.block * setup.dt / (machine.quasi_static + setup.block * setup.dt)
    for i in range(n + 1):
        for j in range(NY):
            if i < n:
                value = memory.total[i, j] / setup.block
            elif memory.count[j] > 0.0:
                value = memory.measured[j] / memory.count[j]
            else:
                value = progress.slow[0, n, j]
            if memory.clock[BLOCKS] == 1:
                progress.slow[:, i, j] = value
            progress.slow[0, i, j] += share * (value - progress.slow[0, i, j])
            progress.slow[1, i, j] += share * (progress.slow[0, i, j] - progress.slow[1, i, j])


@njit(cache=True, nogil=True)
def _find_cm(cars, setup, memory, progress):
    """A step of the fit of the CM to the low-passed outputs.

    The filters are moved along with the twins, by their own sensitivities: else they would show the
    old CM for a while, and the fit would correct it twice.
    """
    n, p = memory.total.shape[0], setup.index.size
    memory.total[:] = progress.slow[1, :n] * setup.block
    memory.measured[:] = progress.slow[1, n] * memory.count
    before = memory.z.copy()
    _estimate(cars, setup, memory)
    for stage in range(2):
        slow = progress.slow[stage]
        change = np.zeros(NY)
        for i in range(p):
            change += (slow[i + 1] - slow[0]) * ((memory.z[i] - before[i]) / setup.offset[i])
        for i in range(n):
            slow[i] += change


@njit(cache=True, nogil=True)
def _update(cars, setup, memory, machine, progress, laws, u, y):
    """One sample of inputs (nu,) and measurements (ny,)."""
    for i in range(cars.size):
        step(cars[i], u, memory.out[i])
    memory.total[:] += memory.out
    for j in range(NY):
        if not np.isnan(y[j]):
            memory.measured[j] += y[j]
            memory.count[j] += 1.0
    active = _advance(machine, progress, y, setup.dt)
    _single_laws(cars, setup, memory, machine, progress, laws, y, active)
    memory.clock[SAMPLES] += 1
    if memory.clock[SAMPLES] < setup.block:
        return
    memory.clock[SAMPLES] = 0
    memory.clock[BLOCKS] += 1
    _low_pass(setup, memory, machine, progress)
    _follow_speed(cars, setup, memory)
    if active and progress.stage[0] == CM:
        _find_cm(cars, setup, memory, progress)
    memory.total[:] = 0.0
    memory.measured[:] = 0.0
    memory.count[:] = 0.0


@njit(cache=True, nogil=True)
def run(cars, setup, memory, machine, progress, laws, inputs, measurements, log):
    """All samples of a drive; returns how many were sound."""
    for k in range(inputs.shape[0]):
        read_states(cars[0], log.states[k])
        _update(cars, setup, memory, machine, progress, laws, inputs[k], measurements[k])
        log.parameters[k] = memory.theta
        log.outputs[k] = memory.out[0]
        log.extended[k] = cars[0].tyre_output
        log.stage[k] = progress.stage[0]
        log.sd[k, : laws.size] = np.sqrt(progress.laws[:, 0])
        for i in range(setup.index.size):
            log.sd[k, laws.size + i] = np.sqrt(memory.covariance[i, i])
        for i in range(cars.size):
            if not is_sound(cars[i]):
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
