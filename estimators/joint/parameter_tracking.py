"""How the joint observer's twins follow its estimates: smoothly, and near the measured speed.

A step d of the parameters moves the states of all twins by S d, to where they would be had the
parameters always been these. But S changes with d, and the twins do not know: had they jumped, the
differences between them would ring with the body on its springs, at the start more than anything
else that moves them, and that would count as information. So the twins follow like a critically
damped oscillator, slower than the body's own modes; the innovations are always relative to where
the twins stand.
"""

import numpy as np
from numba import njit

from estimators.ensemble.blocks import move_states
from estimators.joint.state import LEAST_SPIN, NX, ROLL, SPEED, SPIN, VX, WHEEL_SPEED
from twin.kernel import correct, read_states, set_parameters


@njit(cache=True, nogil=True)
def follow(cars, setup, memory):
    """Moves the twins' parameters towards the estimates and every twin's states by S d."""
    n, p = cars.size, setup.parameter.size
    seconds = setup.block * setup.dt
    share = seconds / setup.follow_time
    d = np.empty(p)
    for i in range(p):
        ahead = memory.z[i] - memory.theta[setup.parameter[i]]
        memory.rate[i] += share * (ahead - 2.0 * memory.rate[i])
        d[i] = share * memory.rate[i]
        memory.went[i] += d[i] - setup.speed_gain * seconds * memory.went[i]
    states, dx, theta = memory.states, memory.dx, memory.theta
    for i in range(n):
        read_states(cars[i], states[i])
    _doubt_speed(setup, memory)
    dx[:] = 0.0
    for i in range(p):
        for k in range(NX):
            dx[k] += (states[i + 1, k] - states[0, k]) * d[i] / setup.offset[i]
    for i in range(p):
        theta[setup.parameter[i]] += d[i]
    for i in range(n):
        move_states(cars[i], dx.copy(), states[0, ROLL])
        memory.p[:] = theta
        if i > 0:
            memory.p[setup.parameter[i - 1]] += setup.offset[i - 1]
        set_parameters(cars[i], memory.p)


@njit(cache=True, nogil=True)
def _doubt_speed(setup, memory):
    """Lets the common error of the twins' speeds be no smaller than what following leaves.

    Speed is the state that forgets last: with 1 / speed_gain. What the parameters went in that
    time, S of the speed had not followed.
    """
    moved, uncertain = 0.0, 0.0
    for i in range(setup.parameter.size):
        slope = (memory.states[i + 1, VX] - memory.states[0, VX]) / setup.offset[i]
        moved += (memory.went[i] / setup.prior[i]) ** 2
        uncertain += slope**2 * (memory.covariance[i, i] + memory.went[i] ** 2)
    for i in range(setup.parameter.size, memory.z.size):
        if setup.fault[i - setup.parameter.size] == SPEED:
            least = setup.speed_curvature * moved * uncertain
            memory.covariance[i, i] = max(memory.covariance[i, i], least)


@njit(cache=True, nogil=True)
def follow_speed(cars, setup, memory):
    """Draws each twin's speed weakly to its own innovation of the wheel speeds."""
    share = setup.speed_gain * setup.block * setup.dt
    if share == 0.0:
        return
    for i in range(cars.size):
        late, spin, n = 0.0, 0.0, 0
        for j in range(WHEEL_SPEED, WHEEL_SPEED + 4):
            if memory.present[j] > 0.0:
                mean = memory.total[i, j] / setup.block
                late += memory.measured[j] / memory.present[j] - mean
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
