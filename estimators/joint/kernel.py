"""The compiled joint observer: a Kalman filter over the parameters of a black box.

Beside twin 0 runs one twin per parameter, that parameter a little off. The differences of their
outputs are the sensitivities H, the differences of their states S: both cost black-box steps only.
Every block of samples the mean innovation, relative to where the twins stand, corrects the
estimates, as far as the sensitivities can be trusted (`estimators.joint.linearisation_error`); the
twins follow smoothly (`estimators.joint.parameter_tracking`).
"""

import numpy as np
from numba import njit

from estimators.ensemble.blocks import kalman_step
from estimators.ensemble.rigid_body import project
from estimators.joint.linearisation_error import doubt_linearity, wait_after_impact
from estimators.joint.noise_inflation import forget_load, keep, load_changed, weigh
from estimators.joint.parameter_tracking import follow, follow_speed
from estimators.joint.state import (
    ABSENT,
    BLOCKS,
    DELAY,
    DRIVEN,
    EXCITING,
    IMU,
    LEAST_SPIN,
    NY,
    POSITION,
    RING,
    ROLL_RATE,
    SAMPLES,
    SPEED,
    TOTAL,
    VX,
    WAIT,
    WATCH,
    WHEEL_SPEED,
)
from twin.kernel import is_sound, read_states, step


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
            memory.present[j] += 1.0
    memory.clock[SAMPLES] += 1
    if memory.clock[SAMPLES] < setup.block:
        return
    memory.clock[SAMPLES] = 0
    memory.clock[BLOCKS] += 1
    _estimate(cars, setup, memory)
    follow_speed(cars, setup, memory)
    memory.total[:] = 0.0
    memory.measured[:] = 0.0
    memory.present[:] = 0.0
    memory.edge[:] = memory.late[0]


@njit(cache=True, nogil=True)
def _delay(setup, memory):
    """Fills memory.late with what the sensors should show now, given their estimated delay."""
    k, late = memory.clock[TOTAL], 0.0
    for i in range(setup.fault.size):
        if setup.fault[i] == DELAY:
            late = memory.z[setup.parameter.size + i] / setup.dt
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
    p, q = setup.parameter.size, memory.z.size
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
        elif fault == SPEED:
            for j in range(WHEEL_SPEED, WHEEL_SPEED + 4):
                h[j, i] = memory.total[0, j] / setup.block / max(memory.states[0, VX], 1.0)
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
        if memory.present[j] > 0.0 and not np.isnan(setup.noise[j]):
            r[j] = memory.measured[j] / memory.present[j] - memory.total[0, j] / setup.block
            variance[j] = setup.noise[j] / memory.present[j]
    for i in range(setup.parameter.size, memory.z.size):
        if setup.fault[i - setup.parameter.size] != DELAY:  # which is in the outputs already
            for j in range(NY):
                if variance[j] < ABSENT:
                    r[j] -= h[j, i] * memory.z[i]
    for i in range(setup.parameter.size):
        ahead = memory.z[i] - memory.theta[setup.parameter[i]]
        for j in range(NY):
            if variance[j] < ABSENT:
                r[j] -= h[j, i] * ahead
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
def _estimate(cars, setup, memory):
    """A Kalman step on the parameters, and the twins after them."""
    read_states(cars[0], memory.states[0])
    h = _sensitivity(setup, memory)
    r, variance = _innovation(setup, memory, h)
    weigh(setup, memory, h, r, variance)
    wait_after_impact(setup, memory, h, variance)
    doubt_linearity(setup, memory, h, variance)
    excited = _is_excited(setup, memory)
    if memory.blocks[WAIT] > 0:
        memory.blocks[WAIT] -= 1
        excited = False
    if not excited or memory.clock[BLOCKS] <= setup.hold_off:
        keep(setup, memory)
    elif _changed(setup, memory, h, r):
        forget_load(setup, memory)
        for i in range(setup.parameter.size):
            memory.estimate[setup.parameter[i]] = memory.z[i]
        follow(cars, setup, memory)
    else:
        kalman_step(memory.z, memory.covariance, h, r, variance, setup.step_limit)
        informed = np.empty_like(h)
        for j in range(NY):
            informed[j] = h[j] / variance[j]
        memory.information[:] += h.T @ informed
        for i in range(setup.parameter.size, memory.z.size):
            if setup.fault[i - setup.parameter.size] == DELAY:
                memory.z[i] = min(max(memory.z[i], -setup.dt), (RING - 2) * setup.dt)
        project(memory.z, memory.covariance, setup.parameter, setup.nominal, memory.estimate)
        follow(cars, setup, memory)
    _drift(setup, memory)


@njit(cache=True, nogil=True)
def _changed(setup, memory, h, r):
    """Whether the load is another since the last standstill; looked for a while after it."""
    memory.blocks[DRIVEN] += 1
    if memory.blocks[WATCH] == 0:
        return False
    memory.blocks[WATCH] -= 1
    return load_changed(setup, memory, h, r)


@njit(cache=True, nogil=True)
def _drift(setup, memory):
    """What a block's time adds to the variances; the twins' speeds are held, and forget."""
    seconds, covariance = setup.block * setup.dt, memory.covariance
    for i in range(memory.z.size):
        fault = i - setup.parameter.size
        if fault >= 0 and setup.fault[fault] == SPEED:
            left = 1.0 - setup.speed_gain * seconds
            memory.z[i] *= left
            covariance[i] *= left
            covariance[:, i] *= left
        covariance[i, i] += setup.drift[i] * seconds


@njit(cache=True, nogil=True)
def run(cars, setup, memory, inputs, measurements, log):
    """All samples of a drive; returns how many were sound."""
    p = setup.parameter.size
    for k in range(inputs.shape[0]):
        read_states(cars[0], log.states[k])
        update(cars, setup, memory, inputs[k], measurements[k])
        log.parameters[k] = memory.estimate
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
