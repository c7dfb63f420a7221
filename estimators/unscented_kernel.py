"""The compiled part of `estimators.unscented`: sigma points of the parameters, each a twin.

Twin 0 stands at the estimate, twins i and p + i at plus and minus the i-th column of the root of
the parameters' covariance. The regression of their outputs and states on their parameters gives
what the joint observer takes from fixed differences, its H and S, over as wide a range as the
estimate is uncertain by; their mean, less twin 0, the bend of the outputs over this range. After
each step of the estimate the twins move to its new sigma points, states along with S.

The biases of the sensors enter linearly and need no sigma points.
"""

import numpy as np
from numba import njit

from estimators.joint_kernel import (
    ANGLE,
    BLOCKS,
    NY,
    PITCH,
    ROLL,
    SAMPLES,
    _follow_speed,
    _innovation,
    _is_excited,
)
from estimators.rigid_body import project
from twin.kernel import correct, is_sound, read_states, set_parameters, step

# Where the sigma points stand, in standard deviations; chosen: the usual root of 3 would be further
# than most loads, and a third of the inertia of a car is as far as its body allows
SPREAD = 1.0


@njit(cache=True, nogil=True)
def place(cars, setup, memory, root, white):
    """Sets the parameters of all twins: estimate and sigma points.

    Args:
        cars: (2p + 1,).
        setup, memory: of the joint observer.
        root: (p, p) filled with the root of the covariance, times `SPREAD`.
        white: (2p, p) filled with each twin's distance from the estimate in units of the root, as
            far as a body can have it.
    """
    p = setup.index.size
    root[:] = SPREAD * np.linalg.cholesky(np.ascontiguousarray(memory.covariance[:p, :p]))
    memory.p[:] = memory.theta
    set_parameters(cars[0], memory.p)
    centre = memory.p[setup.index]
    for i in range(2 * p):
        sign = 1.0 if i < p else -1.0
        memory.p[:] = memory.theta
        for k in range(p):
            memory.p[setup.index[k]] += sign * root[k, i % p]
        set_parameters(cars[i + 1], memory.p)
        white[i] = np.linalg.solve(root, memory.p[setup.index] - centre)


@njit(cache=True, nogil=True)
def _regression(white, values):
    """(p, k) slopes of values (2p + 1, k), less those of twin 0, over the whitened parameters."""
    rest = values[1:] - values[0]
    return np.linalg.solve(white.T @ white, white.T @ rest)


@njit(cache=True, nogil=True)
def update(cars, setup, memory, root, white, u, y):
    """One sample of inputs (nu,) and measurements (ny,)."""
    for i in range(cars.size):
        step(cars[i], u, memory.out[i])
    memory.total[:] += memory.out
    for j in range(NY):
        if not np.isnan(y[j]):
            memory.measured[j] += y[j]
            memory.count[j] += 1.0
    memory.clock[SAMPLES] += 1
    if memory.clock[SAMPLES] < setup.block:
        return
    memory.clock[SAMPLES] = 0
    memory.clock[BLOCKS] += 1
    _estimate(cars, setup, memory, root, white)
    _follow_speed(cars, setup, memory)
    memory.total[:] = 0.0
    memory.measured[:] = 0.0
    memory.count[:] = 0.0


@njit(cache=True, nogil=True)
def _estimate(cars, setup, memory, root, white):
    """A Kalman step on the parameters, and all twins to their new sigma points."""
    p, q = setup.index.size, memory.z.size
    means = memory.total / setup.block
    slopes = _regression(white, means)
    h = np.zeros((NY, q))
    h[:, :p] = np.linalg.solve(root.T, slopes).T
    for i in range(p, q):
        h[setup.bias_output[i - p], i] = 1.0
    r, variance = _innovation(setup, memory, h)
    # second order: half the trace of covariance times curvature, from what is left of the line
    for i in range(2 * p):
        bend = means[i + 1] - means[0] - white[i] @ slopes
        r -= bend / (2.0 * SPREAD**2)
    excited = _is_excited(setup, memory)
    if excited and memory.clock[BLOCKS] > setup.hold_off:
        before = memory.z.copy()
        _kalman_step(setup, memory, h, r, variance)
        project(memory.z, memory.covariance, setup.index, setup.nominal, memory.theta)
        for i in range(p):
            memory.theta[setup.index[i]] = memory.z[i]
        _move(cars, setup, memory, root, white, memory.z[:p] - before[:p])
    for i in range(q):
        memory.covariance[i, i] += setup.drift[i] * setup.block * setup.dt


@njit(cache=True, nogil=True)
def _kalman_step(setup, memory, h, r, variance):
    """The estimates z and their covariance, with the joint observer's limit of a step."""
    q, covariance = memory.z.size, memory.covariance
    hp = h @ covariance
    s = hp @ h.T + np.diag(variance)
    gain = np.ascontiguousarray(np.linalg.solve(s, hp).T)
    move = gain @ r
    share = 1.0
    for i in range(q):
        if share * abs(move[i]) > setup.step_limit[i]:
            share = setup.step_limit[i] / abs(move[i])
    gain *= share
    rest = np.eye(q) - gain @ h
    covariance[:] = rest @ covariance @ rest.T + (gain * variance) @ gain.T
    memory.information[:] += h.T @ (h / variance.reshape(-1, 1))
    memory.z[:] += share * move


@njit(cache=True, nogil=True)
def _move(cars, setup, memory, root, white, d):
    """Moves all twins to the sigma points of the new estimate, d (p,) from the one before."""
    p = setup.index.size
    for i in range(cars.size):
        read_states(cars[i], memory.states[i])
    slopes = _regression(white, memory.states)
    old_root, old_white = root.copy(), white.copy()
    place(cars, setup, memory, root, white)
    for i in range(cars.size):
        change = d.copy()
        if i > 0:
            change += root @ white[i - 1] - old_root @ old_white[i - 1]
        memory.dx[:] = np.linalg.solve(old_root, change) @ slopes
        _without_heading(memory.dx, memory.states[0, ROLL])
        correct(cars[i], memory.dx)
    # the parameters in force are those that a body can have
    for k in range(p):
        memory.theta[setup.index[k]] = memory.z[k]


@njit(cache=True, nogil=True)
def _without_heading(dx, roll):
    """A change of the states that leaves position, heading and wheel angles alone."""
    dx[0:2] = 0.0
    pitch = dx[PITCH]
    dx[PITCH], dx[PITCH + 1] = np.cos(roll) * pitch, -np.sin(roll) * pitch
    dx[ANGLE : ANGLE + 4] = 0.0


@njit(cache=True, nogil=True)
def run(cars, setup, memory, root, white, inputs, measurements, log):
    """All samples of a drive; returns how many were sound."""
    p = setup.index.size
    for k in range(inputs.shape[0]):
        read_states(cars[0], log.states[k])
        update(cars, setup, memory, root, white, inputs[k], measurements[k])
        log.parameters[k] = memory.theta
        log.outputs[k] = memory.out[0]
        log.extended[k] = cars[0].tyre_output
        log.sd[k] = np.sqrt(np.diag(memory.covariance))
        log.biases[k] = memory.z[p:]
        for i in range(cars.size):
            if not is_sound(cars[i]):
                return k
    return inputs.shape[0]


