"""The compiled part of `estimators.joint`: a Kalman filter over the parameters of a black box.

Beside twin 0 runs one twin per parameter, that parameter a little off. The differences of their
outputs are the sensitivities H, the differences of their states S: both cost black-box steps only.
Every block of samples the mean innovation corrects the parameters; and with a step d of the
parameters each twin's states move by S d, to where they would be had the parameters always been
these. Without that each step would ring the springs and the sensitivities would lie.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimators.rigid_body import project
from twin import OUTPUTS, STATES
from twin.kernel import correct, is_sound, read_states, set_parameters, step

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

IMU, NY, NX = 6, len(OUTPUTS), len(STATES)
WHEEL_SPEED = OUTPUTS.index("wheel_speed_fl")
ROLL, PITCH, VX, SPIN = (STATES.index(n) for n in ("roll", "pitch", "vx", "wheel_speed_fl"))
TRAVEL, ANGLE = STATES.index("suspension_travel_fl"), STATES.index("wheel_angle_fl")
AX, AY, ROLL_RATE, PITCH_RATE = (OUTPUTS.index(n) for n in ("ax", "ay", "roll_rate", "pitch_rate"))
EXCITING = np.array([AX, AY, ROLL_RATE, PITCH_RATE])
ABSENT = 1e12  # variance of a channel that has no measurement
# Wheels slower than this [rad/s], 1 m/s, tell nothing: the instant of a stop is a jump
LEAST_SPIN = 3.0
STANDING = 0.5  # and slower than this the car stands; chosen
WATCH, DRIVEN = 0, 1  # blocks: left to look for a change of the load; of exciting driving so far
SAMPLES, BLOCKS, TOTAL = 0, 1, 2  # what the clock counts: of the block, blocks, of all
# What is estimated of the sensors besides parameters: biases, delay, and the place of the IMU
DELAY, POSITION = IMU, IMU + 1
RING = 64  # samples: the longest delay
LARGEST_DOUBT = 1e3  # of one window
WINDOW = 16  # blocks over which innovations are summed to see whether they are white


class Setup(NamedTuple):
    """What does not change: p parameters, q estimates (parameters, then faults of sensors)."""

    index: Indices  # (p,) of each parameter among the twin's
    offset: Array  # (p,) of its twin
    fault: Indices  # (q - p,) of the sensors: channel of a bias, DELAY, POSITION + axis
    step_limit: Array  # (q,) the most an estimate may move in a block
    drift: Array  # (q,) variance per second
    noise: Array  # (ny,) variance of a sample's noise; NaN: the channel is not used
    nominal: Array  # (np,) the unloaded chassis
    block: int  # samples
    hold_off: int  # blocks before the first correction
    speed_gain: float  # of the twins' speeds [1/s]
    least_excitation: float  # [m2/s4]
    rate_weight: float  # of a roll or pitch rate in it [m2/s2]
    memory: float  # of excitation [s]
    doubt: float  # first factor of the noise's variance, before innovations prove it white
    doubt_memory: float  # [s]
    prior: Array  # (q,) standard deviations
    load: Indices  # (l,) estimates that a change of the load changes
    watch: int  # blocks of driving after a standstill in which such a change is looked for
    settle: int  # blocks of driving before the first
    change_memory: float  # of what contradicts [s]
    surprise: float  # least statistic of a change, chi-square of l degrees of freedom if there is none
    least_change: float  # and least change of any of them, of its prior sd
    dt: float  # of a sample [s]


class Memory(NamedTuple):
    """What the observer keeps from sample to sample, beside its twins."""

    theta: Array  # (np,) parameters of twin 0
    z: Array  # (q,) estimates
    covariance: Array  # (q, q)
    out: Array  # (n, ny) the twins' last outputs
    total: Array  # (n, ny) their sum over the block
    measured: Array  # (ny,) the measurements' sum
    count: Array  # (ny,) of measurements
    states: Array  # (n, nx)
    dx: Array  # (nx,)
    p: Array  # (np,) what is set
    excitation: Array  # (2, 4) means and squares of what excites
    information: Array  # (q, q) of what was used
    ring: Array  # (RING, n, ny) the twins' last outputs
    late: Array  # (n, ny) the twins' outputs of the delay ago
    edge: Array  # (ny,) of twin 0 at the end of the block before
    doubt: Array  # (ny,) factor of each channel's variance that its innovations show
    window: Array  # (3, ny) sums of innovations, of their variance; number of blocks
    window_h: Array  # (ny, q) sums of sensitivities
    recent: Array  # (q, q) information of the last seconds
    score: Array  # (q,) and what it says of the parameters' error
    kept: Array  # (q,) estimates at the last standstill
    kept_covariance: Array  # (q, q)
    kept_doubt: Array  # (ny,)
    blocks: Indices  # (2,)
    changes: Indices  # (1,) of the load, so far
    clock: Indices  # (3,)


@njit(cache=True, nogil=True)
def update(cars, setup, memory, u, y):
    """One sample of inputs (nu,) and measurements (ny,)."""
    for i in range(cars.size):
        step(cars[i], u, memory.out[i])
    _delay(setup, memory)
    for i in range(cars.size):
        for j in range(NY):
            memory.total[i, j] += memory.late[i, j]
    for j in range(NY):
        if not np.isnan(y[j]):
            memory.measured[j] += y[j]
            memory.count[j] += 1.0
    memory.clock[SAMPLES] += 1
    if memory.clock[SAMPLES] < setup.block:
        return
    memory.clock[SAMPLES] = 0
    memory.clock[BLOCKS] += 1
    _estimate(cars, setup, memory)
    _follow_speed(cars, setup, memory)
    memory.total[:] = 0.0
    memory.measured[:] = 0.0
    memory.count[:] = 0.0
    memory.edge[:] = memory.late[0]


@njit(cache=True, nogil=True)
def _delay(setup, memory):
    """Fills memory.late with what the sensors should show now, given their estimated delay."""
    k, late = memory.clock[TOTAL], 0.0
    for i in range(setup.fault.size):
        if setup.fault[i] == DELAY:
            late = memory.z[setup.index.size + i] / setup.dt
    memory.ring[k % RING] = memory.out
    whole = min(max(int(np.floor(late)), 0), RING - 2)
    part = late - whole  # below zero it extrapolates
    newer, older = min(whole, k), min(whole + 1, k)
    newer, older = (k - newer) % RING, (k - older) % RING
    for i in range(memory.late.shape[0]):
        for j in range(NY):
            new, old = memory.ring[newer, i, j], memory.ring[older, i, j]
            memory.late[i, j] = new + part * (old - new)
    if k == 0:
        memory.edge[:] = memory.late[0]
    memory.clock[TOTAL] += 1


@njit(cache=True, nogil=True)
def _sensitivity(setup, memory):
    """(ny, q) of the block's mean outputs."""
    p, q = setup.index.size, memory.z.size
    h = np.zeros((NY, q))
    for i in range(p):
        for j in range(NY):
            difference = memory.total[i + 1, j] - memory.total[0, j]
            h[j, i] = difference / (setup.block * setup.offset[i])
    seconds = setup.block * setup.dt
    change = (memory.late[0] - memory.edge) / seconds
    rates = memory.total[0, 3:IMU] / setup.block
    for i in range(p, q):
        fault = setup.fault[i - p]
        if fault < IMU:
            h[fault, i] = 1.0
        elif fault == DELAY:
            h[:, i] = -change
        else:
            arm = np.zeros(3)
            arm[fault - POSITION] = 1.0
            turning = _cross(rates, _cross(rates, arm))
            h[:3, i] = _cross(change[3:IMU], arm) + turning
    return h


@njit(cache=True, nogil=True)
def _cross(a, b):
    """Vector product of two (3,)."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


@njit(cache=True, nogil=True)
def _innovation(setup, memory, h):
    """The block's mean innovation (ny,) and the variance of its noise (ny,)."""
    r, variance = np.zeros(NY), np.full(NY, ABSENT)
    for j in range(NY):
        if memory.count[j] > 0.0 and not np.isnan(setup.noise[j]):
            r[j] = memory.measured[j] / memory.count[j] - memory.total[0, j] / setup.block
            variance[j] = setup.noise[j] / memory.count[j]
    for i in range(setup.index.size, memory.z.size):
        if setup.fault[i - setup.index.size] != DELAY:  # which is in the outputs already
            for j in range(IMU):
                if variance[j] < ABSENT:
                    r[j] -= h[j, i] * memory.z[i]
    return r, variance


@njit(cache=True, nogil=True)
def _is_excited(setup, memory):
    """Whether the twin's own motion varies enough to tell anything."""
    share = setup.block * setup.dt / setup.memory
    mean, square = memory.excitation[0], memory.excitation[1]
    total = 0.0
    for k in range(EXCITING.size):
        value = memory.total[0, EXCITING[k]] / setup.block
        if memory.clock[BLOCKS] == 1:
            mean[k], square[k] = value, value**2
        mean[k] += share * (value - mean[k])
        square[k] += share * (value**2 - square[k])
        weight = 1.0 if EXCITING[k] < ROLL_RATE else setup.rate_weight
        total += weight * (square[k] - mean[k] ** 2)
    spin = min(memory.total[0, WHEEL_SPEED:].min() / setup.block, memory.late[:, -1].min())
    return total >= setup.least_excitation and spin >= LEAST_SPIN


@njit(cache=True, nogil=True)
def _weigh(setup, memory, h, r, variance):
    """Scales the variances by what sums of innovations show of noise that is not white.

    A sum over a window has the variance of white noise and of what the parameters are not known
    by; what exceeds it is coloured noise or an error of the model, and counts as noise.
    """
    window, summed = memory.window, memory.window_h
    for j in range(NY):
        if variance[j] < ABSENT:
            window[0, j] += r[j]
            window[1, j] += variance[j]
            summed[j] += h[j]
            variance[j] *= max(memory.doubt[j], 1.0)
    window[2] += 1.0
    if window[2, 0] < WINDOW:
        return
    share = WINDOW * setup.block * setup.dt / setup.doubt_memory
    for j in range(NY):
        if window[1, j] > 0.0:
            known = summed[j] @ (memory.covariance @ summed[j])
            excess = (window[0, j] ** 2 - known) / window[1, j]
            memory.doubt[j] += share * (min(max(excess, 0.0), LARGEST_DOUBT) - memory.doubt[j])
    window[:] = 0.0
    summed[:] = 0.0


@njit(cache=True, nogil=True)
def _estimate(cars, setup, memory):
    """A Kalman step on the parameters, and the twins' states with them."""
    h = _sensitivity(setup, memory)
    r, variance = _innovation(setup, memory, h)
    _weigh(setup, memory, h, r, variance)
    q, covariance = memory.z.size, memory.covariance
    seconds = setup.block * setup.dt
    excited = _is_excited(setup, memory)
    if excited and memory.clock[BLOCKS] > setup.hold_off:
        memory.blocks[DRIVEN] += 1
        if memory.blocks[WATCH] > 0:
            memory.blocks[WATCH] -= 1
            if _load_changed(setup, memory, h, r):
                before = memory.z.copy()
                _forget_load(setup, memory)
                _move(cars, setup, memory, memory.z - before)
                return
        hp = h @ covariance
        s = hp @ h.T
        for j in range(NY):
            s[j, j] += variance[j]
        gain = np.ascontiguousarray(np.linalg.solve(s, hp).T)
        move = gain @ r
        share = 1.0
        for i in range(q):
            if share * abs(move[i]) > setup.step_limit[i]:
                share = setup.step_limit[i] / abs(move[i])
        gain *= share
        rest = np.eye(q) - gain @ h
        scaled = np.empty_like(gain)
        informed = np.empty_like(h)
        for j in range(NY):
            scaled[:, j] = gain[:, j] * variance[j]
            informed[j] = h[j] / variance[j]
        covariance[:] = rest @ covariance @ rest.T + scaled @ gain.T
        memory.information[:] += h.T @ informed
        before = memory.z.copy()
        memory.z[:] += share * move
        for i in range(setup.index.size, q):
            if setup.fault[i - setup.index.size] == DELAY:
                memory.z[i] = min(max(memory.z[i], -setup.dt), (RING - 2) * setup.dt)
        project(memory.z, covariance, setup.index, setup.nominal, memory.theta)
        _move(cars, setup, memory, memory.z - before)
    else:
        _keep(setup, memory)
    for i in range(q):
        covariance[i, i] += setup.drift[i] * seconds


@njit(cache=True, nogil=True)
def _keep(setup, memory):
    """Keeps the estimates while the car stands: its load may change now."""
    for j in range(WHEEL_SPEED, WHEEL_SPEED + 4):
        if abs(memory.late[0, j]) > STANDING or abs(memory.measured[j]) > STANDING * setup.block:
            return
    if memory.blocks[DRIVEN] < setup.settle:
        return
    memory.kept[:], memory.kept_covariance[:] = memory.z, memory.covariance
    memory.kept_doubt[:] = memory.doubt
    memory.recent[:], memory.score[:] = 0.0, 0.0
    memory.blocks[WATCH] = setup.watch


@njit(cache=True, nogil=True)
def _load_changed(setup, memory, h, r):
    """Whether what was known of the load before the stop contradicts what has been seen since.

    Of the last seconds' information A and score b = sum H' R^-1 r, no change means b ~ N(0, A +
    A P A). A contradiction that would also move a parameter noticeably is a change of the load.
    """
    load = setup.load
    keep = 1.0 - setup.block * setup.dt / setup.change_memory
    informed, weighed = np.zeros_like(h), np.zeros_like(r)
    for j in range(NY):
        if memory.count[j] > 0.0 and not np.isnan(setup.noise[j]):
            variance = setup.noise[j] / memory.count[j] * max(memory.kept_doubt[j], 1.0)
            informed[j], weighed[j] = h[j] / variance, r[j] / variance
    memory.recent[:] = keep * memory.recent + h.T @ informed
    memory.score[:] = keep * memory.score + h.T @ weighed
    if load.size == 0:
        return False
    spread = memory.recent + memory.recent @ memory.kept_covariance @ memory.recent
    a, b = np.empty((load.size, load.size)), np.empty(load.size)
    told = np.empty((load.size, load.size))
    for i in range(load.size):
        scale = setup.prior[load[i]]
        b[i] = memory.score[load[i]] * scale
        for k in range(load.size):
            both = scale * setup.prior[load[k]]
            # a little more than the parts, so that what is not told can be divided by
            a[i, k] = spread[load[i], load[k]] * both + (1e-3 if i == k else 0.0)
            told[i, k] = memory.recent[load[i], load[k]] * both + (1.0 if i == k else 0.0)
    return (
        b @ np.linalg.solve(a, b) >= setup.surprise
        and np.abs(np.linalg.solve(told, b)).max() >= setup.least_change
    )


@njit(cache=True, nogil=True)
def _forget_load(setup, memory):
    """Goes back to what was known at the standstill, of the load as uncertain as at first."""
    load, covariance = setup.load, memory.covariance
    estimates = memory.z.copy()
    memory.z[:], covariance[:] = memory.kept, memory.kept_covariance
    memory.doubt[:] = memory.kept_doubt
    for k in load:
        memory.z[k] = estimates[k]
        covariance[:, k] = 0.0
        covariance[k] = 0.0
    for k in load:
        covariance[k, k] = setup.prior[k] ** 2
    memory.window[:], memory.window_h[:] = 0.0, 0.0
    memory.blocks[WATCH] = 0
    memory.changes[0] += 1


@njit(cache=True, nogil=True)
def _move(cars, setup, memory, d):
    """Steps the parameters by d (q,) and every twin's states by S d."""
    n, p = cars.size, setup.index.size
    states, dx, theta = memory.states, memory.dx, memory.theta
    for i in range(n):
        read_states(cars[i], states[i])
    dx[:] = 0.0
    for i in range(p):
        for k in range(2, NX):
            dx[k] += (states[i + 1, k] - states[0, k]) * d[i] / setup.offset[i]
    # heading and wheel angles have no influence; a small turn about the body's axes in place of
    # the change of roll and pitch angles
    roll, pitch, angle = dx[ROLL], dx[PITCH], states[0, ROLL]
    dx[PITCH], dx[PITCH + 1] = np.cos(angle) * pitch, -np.sin(angle) * pitch
    dx[ROLL] = roll
    dx[ANGLE : ANGLE + 4] = 0.0
    for i in range(p):
        theta[setup.index[i]] = memory.z[i]
    for i in range(n):
        correct(cars[i], dx)
        memory.p[:] = theta
        if i > 0:
            memory.p[setup.index[i - 1]] += setup.offset[i - 1]
        set_parameters(cars[i], memory.p)


@njit(cache=True, nogil=True)
def _follow_speed(cars, setup, memory):
    """Draws each twin's speed weakly to its own innovation of the wheel speeds."""
    share = setup.speed_gain * setup.block * setup.dt
    if share == 0.0:
        return
    for i in range(cars.size):
        late, spin, n = 0.0, 0.0, 0
        for j in range(WHEEL_SPEED, WHEEL_SPEED + 4):
            if memory.count[j] > 0.0:
                mean = memory.total[i, j] / setup.block
                late += memory.measured[j] / memory.count[j] - mean
                spin += mean
                n += 1
        if n == 0 or spin < n * LEAST_SPIN:
            continue
        read_states(cars[i], memory.states[i])
        memory.dx[:] = 0.0
        memory.dx[VX] = share * late / spin * memory.states[i, VX]
        for k in range(SPIN, SPIN + 4):
            memory.dx[k] = share * late / spin * memory.states[i, k]
        correct(cars[i], memory.dx)


@njit(cache=True, nogil=True)
def run(cars, setup, memory, inputs, measurements, log):
    """All samples of a drive; returns how many were sound."""
    p = setup.index.size
    for k in range(inputs.shape[0]):
        read_states(cars[0], log.states[k])
        update(cars, setup, memory, inputs[k], measurements[k])
        log.parameters[k] = memory.theta
        log.outputs[k] = memory.out[0]
        log.extended[k] = cars[0].tyre_output
        for i in range(memory.z.size):
            log.sd[k, i] = np.sqrt(memory.covariance[i, i])
        log.faults[k] = memory.z[p:]
        log.changes[k] = memory.changes[0]
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
    sd: Array  # (N, q)
    faults: Array  # (N, q - p)
    changes: Indices  # (N,)
