"""The compiled part of the unscented filter: sigma points of the parameters, each a twin.

Twin 0 stands at the estimate, twins i and p + i at plus and minus the i-th column of the root of
the parameters' covariance. The regression of their outputs and states on their parameters gives
what the joint observer takes from fixed differences, its H and S, over as wide a range as the
estimate is uncertain by; what their mean differs by from twin 0 is the bend of the outputs over
this range. After each step of the estimate the twins move to its new sigma points, states along
with S.

The biases of the sensors enter linearly and need no sigma points.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimators.ensemble.blocks import (
    ABSENT,
    LEAST_SPIN,
    NY,
    ROLL,
    advance,
    are_sound,
    follow_speed,
    kalman_step,
    move_states,
)
from estimators.ensemble.rigid_body import project
from estimators.ensemble.stepping import read_extended, read_states, set_parameters
from twin import OUTPUTS

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Where the sigma points stand, in standard deviations; chosen: the usual root of 3 would be further
# than most loads, and a third of the inertia of a car is as far as its body allows
SPREAD = 1.0
AX, AY, ROLL_RATE, PITCH_RATE = (OUTPUTS.index(n) for n in ("ax", "ay", "roll_rate", "pitch_rate"))
# Of the motion that tells something: weight of its channels and the seconds it is looked back on
EXCITING = ((AX, 1.0), (AY, 1.0), (ROLL_RATE, 900.0), (PITCH_RATE, 900.0))
EXCITED_FOR = 1.0
BLOCKS = 0  # what the clock counts


class Setup(NamedTuple):
    """What does not change: p parameters, q estimates (parameters, then biases of channels)."""

    column: Indices  # (p,) of each parameter among the twin's
    prior: Array  # (q,) standard deviation at the start
    step_limit: Array  # (q,) the most an estimate may move in a block
    drift: Array  # (q,) variance per second
    noise: Array  # (ny,) variance of a sample's noise; NaN: the channel is not used
    nominal: Array  # (np,) the unloaded chassis
    block: int  # samples
    hold_off: int  # blocks before the first correction
    speed_gain: float  # of the twins' speeds [1/s]
    least_excitation: float  # [m2/s4]
    dt: float  # of a sample [s]


class Memory(NamedTuple):
    """What the filter keeps from sample to sample, beside its twins."""

    theta: Array  # (np,) parameters of twin 0
    z: Array  # (q,) estimates
    covariance: Array  # (q, q)
    root: Array  # (p, p) of the parameters' covariance, times SPREAD
    white: Array  # (2p, p) of each sigma point, the distance from twin 0 in units of the root
    states: Array  # (n, nx)
    excitation: Array  # (2, 4) means and squares of what excites
    clock: Indices  # (1,)


@njit(cache=True, nogil=True)
def place(cars, setup, memory):
    """Gives all twins the parameters of estimate and sigma points, as far as a body can have them.

    Fills memory.root and memory.white.
    """
    p, root = setup.column.size, memory.root
    root[:] = SPREAD * np.linalg.cholesky(np.ascontiguousarray(memory.covariance[:p, :p]))
    wanted = memory.theta.copy()
    set_parameters(cars[0], wanted)
    centre = wanted[setup.column]
    for i in range(2 * p):
        wanted[:] = memory.theta
        for k in range(p):
            wanted[setup.column[k]] += root[k, i % p] * (1.0 if i < p else -1.0)
        set_parameters(cars[i + 1], wanted)
        memory.white[i] = np.linalg.solve(root, wanted[setup.column] - centre)


@njit(cache=True, nogil=True)
def _regression(white, values):
    """(p, k) slopes of values (2p + 1, k), less those of twin 0, over the whitened parameters."""
    rest = values[1:] - values[0]
    return np.linalg.solve(white.T @ white, white.T @ rest)


@njit(cache=True, nogil=True)
def _outputs(setup, memory, block):
    """Derivatives h (ny, q), innovations (ny,), and the variance of their noise (ny,)."""
    p, q = setup.column.size, memory.z.size
    slopes = _regression(memory.white, block.mean)
    h, r, variance = np.zeros((NY, q)), np.zeros(NY), np.full(NY, ABSENT)
    h[:, :p] = np.linalg.solve(memory.root.T, slopes).T
    for i in range(p, q):
        h[i - p, i] = 1.0
    for j in range(NY):
        if block.number[j] > 0.0 and not np.isnan(setup.noise[j]):
            bend = 0.0  # second order: half the trace of covariance times curvature
            for i in range(2 * p):
                line = memory.white[i] @ np.ascontiguousarray(slopes[:, j])
                bend += block.mean[i + 1, j] - block.mean[0, j] - line
            r[j] = block.measured[j] - block.mean[0, j] - bend / (2.0 * SPREAD**2)
            if j < q - p:
                r[j] -= memory.z[p + j]
            variance[j] = setup.noise[j] / block.number[j]
    return h, r, variance


@njit(cache=True, nogil=True)
def _is_excited(setup, memory, y):
    """Whether the twin's own motion varies enough to tell anything."""
    share = setup.block * setup.dt / EXCITED_FOR
    mean, square = memory.excitation[0], memory.excitation[1]
    total = 0.0
    for k, (channel, weight) in enumerate(EXCITING):
        if memory.clock[BLOCKS] == 1:
            mean[k], square[k] = y[channel], y[channel] ** 2
        mean[k] += share * (y[channel] - mean[k])
        square[k] += share * (y[channel] ** 2 - square[k])
        total += weight * (square[k] - mean[k] ** 2)
    return total >= setup.least_excitation


@njit(cache=True, nogil=True)
def _estimate(cars, setup, memory, block):
    """A Kalman step on the parameters, and all twins to their new sigma points."""
    memory.clock[BLOCKS] += 1
    excited = _is_excited(setup, memory, block.mean[0])
    if excited and memory.clock[BLOCKS] > setup.hold_off:
        before = memory.z.copy()
        h, r, variance = _outputs(setup, memory, block)
        kalman_step(memory.z, memory.covariance, h, r, variance, setup.step_limit)
        project(memory.z, memory.covariance, setup.column, setup.nominal, memory.theta)
        for i in range(setup.column.size):
            memory.theta[setup.column[i]] = memory.z[i]
        _move(cars, setup, memory, memory.z - before)
    for i in range(memory.z.size):
        memory.covariance[i, i] += setup.drift[i] * setup.block * setup.dt


@njit(cache=True, nogil=True)
def _move(cars, setup, memory, d):
    """Moves all twins to the sigma points of the new estimate, d (q,) from the one before."""
    for i in range(cars.size):
        read_states(cars[i], memory.states[i])
    slopes = _regression(memory.white, memory.states)
    root, white = memory.root.copy(), memory.white.copy()
    place(cars, setup, memory)
    for i in range(cars.size):
        change = d[: setup.column.size].copy()
        if i > 0:
            change += memory.root @ memory.white[i - 1] - root @ white[i - 1]
        dx = np.linalg.solve(root, change) @ slopes
        move_states(cars[i], dx, memory.states[0, ROLL])


@njit(cache=True, nogil=True)
def run(cars, setup, memory, block, inputs, measurements, log):
    """All samples of a drive; returns how many were sound."""
    p = setup.column.size
    for k in range(inputs.shape[0]):
        read_states(cars[0], log.states[k])
        if advance(cars, block, setup.block, inputs[k], measurements[k]):
            _estimate(cars, setup, memory, block)
            share = setup.speed_gain * setup.block * setup.dt
            follow_speed(cars, block.mean, block.measured, block.number, share, LEAST_SPIN)
        log.parameters[k] = memory.theta
        log.outputs[k] = block.out[0]
        read_extended(cars[0], log.extended[k])
        for i in range(p):
            log.sd[k, i] = np.sqrt(memory.covariance[i, i])
        if not are_sound(cars):
            return k
    return inputs.shape[0]


class Log(NamedTuple):
    """Histories of N samples, to be filled."""

    states: Array  # (N, nx)
    parameters: Array  # (N, np)
    outputs: Array  # (N, ny)
    extended: Array  # (N, 4, 9)
    sd: Array  # (N, p)
