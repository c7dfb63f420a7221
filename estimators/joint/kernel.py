"""The compiled joint observer: a Kalman filter over the parameters of a black box.

Beside twin 0 runs one twin per parameter, that parameter a little off. The differences of their
outputs are the sensitivities H, the differences of their states S: both cost black-box steps only.
Every block of samples the mean innovation, relative to where the twins stand, corrects the
estimates, as far as the sensitivities can be trusted (`estimators.joint.linearisation_error`); the
twins follow smoothly (`estimators.joint.parameter_tracking`).
"""

import numpy as np
from numba import njit

from estimators.ensemble.blocks import are_sound, follow_speed, kalman_step, step_all
from estimators.ensemble.rigid_body import project
from estimators.ensemble.stepping import read_extended, read_states
from estimators.joint.evidence import FULL, add_evidence, forget_evidence
from estimators.joint.linearisation_error import add_linearisation_error, wait_after_impact
from estimators.joint.noise_inflation import forget_load, inflate_noise, keep, load_changed
from estimators.joint.parameter_tracking import track_parameters
from estimators.joint.state import (
    ABSENT,
    AFTER_WHEELS,
    BLOCKS,
    DELAY,
    DRIVEN,
    EXCITING,
    FIRST_WHEEL,
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
)


@njit(cache=True, nogil=True)
def update(cars, config, state, u, y):
    """One sample of inputs (nu,) and measurements (ny,); tells if a segment is complete."""
    step_all(cars, u, state.out)
    _delay(config, state)
    for i in range(cars.size):
        for j in range(NY):
            state.total[i, j] += state.late[i, j]
    for j in range(NY):
        if not np.isnan(y[j]):
            state.measured[j] += y[j]
            state.present[j] += 1.0
    state.clock[SAMPLES] += 1
    if state.clock[SAMPLES] < config.block:
        return False
    state.clock[SAMPLES] = 0
    state.clock[BLOCKS] += 1
    complete = _estimate(cars, config, state)
    share = config.speed_gain * config.block * config.dt
    means, measured = state.total / config.block, state.measured / state.present
    follow_speed(cars, means, measured, state.present, share, LEAST_SPIN)
    state.total[:] = 0.0
    state.measured[:] = 0.0
    state.present[:] = 0.0
    state.edge[:] = state.late[0]
    return complete


@njit(cache=True, nogil=True)
def start_evidence(config, state):
    """Begins to collect evidence beyond what is known now."""
    forget_evidence(state, config.segment)
    state.prior_mean[:], state.prior_covariance[:] = state.z, state.covariance
    if state.widening[0] > 0.0:
        state.prior_covariance[:] *= state.widening[0]
        for k in config.load:  # forgotten, not known badly
            state.prior_covariance[k, k] = config.prior[k] ** 2
    state.widening[0] = 0.0


@njit(cache=True, nogil=True)
def _delay(config, state):
    """Fills state.late with what the sensors should show now, given their estimated delay."""
    k, late = state.clock[TOTAL], 0.0
    for i in range(config.sensor_error.size):
        if config.sensor_error[i] == DELAY:
            late = state.z[config.parameter.size + i] / config.dt
    state.ring[k % RING] = state.out
    whole = min(max(int(np.floor(late)), 0), RING - 2)
    part = late - whole  # below zero it extrapolates
    newer, older = min(whole, k), min(whole + 1, k)
    newer, older = (k - newer) % RING, (k - older) % RING
    for i in range(state.late.shape[0]):
        for j in range(NY):
            new, old = state.ring[newer, i, j], state.ring[older, i, j]
            state.late[i, j] = new + part * (old - new)
    if k == 0:
        state.edge[:] = state.late[0]
    state.clock[TOTAL] += 1


@njit(cache=True, nogil=True)
def _sensitivity(config, state):
    """(ny, q) of the block's mean outputs."""
    p, q = config.parameter.size, state.z.size
    h = np.zeros((NY, q))
    for i in range(p):
        for j in range(NY):
            difference = state.total[i + 1, j] - state.total[0, j]
            h[j, i] = difference / (config.block * config.step[i])
    seconds = config.block * config.dt
    change = (state.late[0] - state.edge) / seconds
    rates = state.total[0, ROLL_RATE:IMU] / config.block
    for i in range(p, q):
        error = config.sensor_error[i - p]
        if error < IMU:
            h[error, i] = 1.0
        elif error == DELAY:
            h[:, i] = -change
        elif error == SPEED:
            for j in range(FIRST_WHEEL, AFTER_WHEELS):
                h[j, i] = state.total[0, j] / config.block / max(state.states[0, VX], 1.0)
        else:
            arm = np.zeros(3)
            arm[error - POSITION] = 1.0
            turning = _cross(rates, _cross(rates, arm))
            h[:3, i] = _cross(change[ROLL_RATE:IMU], arm) + turning
    return h


@njit(cache=True, nogil=True)
def _cross(a, b):
    """Vector product of two (3,)."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


@njit(cache=True, nogil=True)
def _innovation(config, state, h):
    """The block's mean innovation (ny,) and the variance of its noise (ny,)."""
    r, variance = np.zeros(NY), np.full(NY, ABSENT)
    for j in range(NY):
        if state.present[j] > 0.0 and not np.isnan(config.noise[j]):
            r[j] = state.measured[j] / state.present[j] - state.total[0, j] / config.block
            variance[j] = config.noise[j] / state.present[j]
    for i in range(config.parameter.size, state.z.size):
        if (
            config.sensor_error[i - config.parameter.size] != DELAY
        ):  # which is in the outputs already
            for j in range(NY):
                if variance[j] < ABSENT:
                    r[j] -= h[j, i] * state.z[i]
    for i in range(config.parameter.size):
        ahead = state.z[i] - state.theta[config.parameter[i]]
        for j in range(NY):
            if variance[j] < ABSENT:
                r[j] -= h[j, i] * ahead
    return r, variance


@njit(cache=True, nogil=True)
def _is_excited(config, state):
    """Whether the twin's own motion varies enough to learn from it."""
    share = config.block * config.dt / config.excitation_time
    mean, square = state.excitation[0], state.excitation[1]
    total = 0.0
    for k in range(EXCITING.size):
        value = state.total[0, EXCITING[k]] / config.block
        if state.clock[BLOCKS] == 1:
            mean[k], square[k] = value, value**2
        mean[k] += share * (value - mean[k])
        square[k] += share * (value**2 - square[k])
        weight = 1.0 if EXCITING[k] < ROLL_RATE else config.rate_weight
        total += weight * (square[k] - mean[k] ** 2)
    spin = min(
        state.total[0, FIRST_WHEEL:AFTER_WHEELS].min() / config.block,
        state.late[:, AFTER_WHEELS - 1].min(),
    )
    return total >= config.least_excitation and spin >= LEAST_SPIN


@njit(cache=True, nogil=True)
def _estimate(cars, config, state):
    """A Kalman step on the parameters, and the twins after them; tells if a segment is complete."""
    complete = False
    read_states(cars[0], state.states[0])
    h = _sensitivity(config, state)
    r, variance = _innovation(config, state, h)
    white = variance.copy()
    inflate_noise(config, state, h, r, variance)
    inflated = variance.copy()
    wait_after_impact(config, state, h, variance)
    add_linearisation_error(config, state, h, variance)
    excited = _is_excited(config, state)
    if state.blocks[WAIT] > 0:
        state.blocks[WAIT] -= 1
        excited = False
    if not excited or state.clock[BLOCKS] <= config.hold_off:
        keep(config, state)
    elif _changed(config, state, h, r):
        forget_load(config, state)
        start_evidence(config, state)
        for i in range(config.parameter.size):
            state.estimate[config.parameter[i]] = state.z[i]
        track_parameters(cars, config, state)
    else:
        for j in range(NY):
            if white[j] < ABSENT:
                white[j] += variance[j] - inflated[j]
        complete = add_evidence(config, state, h, r, white)
        kalman_step(state.z, state.covariance, h, r, variance, config.step_limit)
        informed = np.empty_like(h)
        for j in range(NY):
            informed[j] = h[j] / variance[j]
        state.information[:] += h.T @ informed
        for i in range(config.parameter.size, state.z.size):
            if config.sensor_error[i - config.parameter.size] == DELAY:
                state.z[i] = min(max(state.z[i], -config.dt), (RING - 2) * config.dt)
        project(state.z, state.covariance, config.parameter, config.nominal, state.estimate)
        track_parameters(cars, config, state)
    _drift(config, state)
    return complete


@njit(cache=True, nogil=True)
def _changed(config, state, h, r):
    """Whether the load is another since the last standstill; looked for a while after it."""
    state.blocks[DRIVEN] += 1
    if state.blocks[WATCH] == 0:
        return False
    state.blocks[WATCH] -= 1
    return load_changed(config, state, h, r)


@njit(cache=True, nogil=True)
def _drift(config, state):
    """What a block's time adds to the variances; the twins' speeds are held, and forget."""
    seconds, covariance = config.block * config.dt, state.covariance
    for i in range(state.z.size):
        error = i - config.parameter.size
        if error >= 0 and config.sensor_error[error] == SPEED:
            left = 1.0 - config.speed_gain * seconds
            state.z[i] *= left
            covariance[i] *= left
            covariance[:, i] *= left
        covariance[i, i] += config.drift[i] * seconds


@njit(cache=True, nogil=True)
def run(cars, config, state, inputs, measurements, log, first):
    """Samples of a drive from the first on, up to the end of a segment.

    Returns:
        The sample after the last that was taken, and whether all cars are sound.
    """
    p = config.parameter.size
    for k in range(first, inputs.shape[0]):
        read_states(cars[0], log.states[k])
        complete = update(cars, config, state, inputs[k], measurements[k])
        log.parameters[k] = state.estimate
        log.outputs[k] = state.out[0]
        read_extended(cars[0], log.extended[k])
        _standard_deviations(config, state, log.sd[k])
        log.sensor_errors[k] = state.z[p:]
        log.changes[k] = state.changes[0]
        log.segments[k] = state.evidence[FULL]
        if not are_sound(cars):
            return k, False
        if complete:
            return k + 1, True
    return inputs.shape[0], True


@njit(cache=True, nogil=True)
def claim(config, state, log, k):
    """Writes again what is known at a sample, after its evidence was weighed."""
    log.parameters[k] = state.estimate
    log.sensor_errors[k] = state.z[config.parameter.size :]
    _standard_deviations(config, state, log.sd[k])


@njit(cache=True, nogil=True)
def take_over(config, state, z, covariance, noise):
    """Goes on from weighed estimates (q,), (q, q) and factors of the noise (ny,).

    The twins' speed is another in every segment: it stays as the filter has it.
    """
    q = z.size
    for i in range(q):
        error = i - config.parameter.size
        if error >= 0 and config.sensor_error[error] == SPEED:
            z[i] = state.z[i]
            own = state.covariance[i, i]
            covariance[i] = 0.0
            covariance[:, i] = 0.0
            covariance[i, i] = own
    state.z[:], state.covariance[:] = z, covariance
    for j in range(NY):
        state.inflation[j] = max(state.inflation[j], noise[j])
    for i in range(config.parameter.size, q):
        if config.sensor_error[i - config.parameter.size] == DELAY:
            state.z[i] = min(max(state.z[i], -config.dt), (RING - 2) * config.dt)
    project(state.z, state.covariance, config.parameter, config.nominal, state.estimate)


@njit(cache=True, nogil=True)
def _standard_deviations(config, state, sd):
    """Fills sd (q,) with what is claimed: the prior's until segments can be compared."""
    for i in range(state.z.size):
        known = state.widening[0] * state.covariance[i, i]
        prior = config.prior[i] ** 2
        sd[i] = np.sqrt(min(known, prior) if state.widening[0] > 0.0 else prior)
