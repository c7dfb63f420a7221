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
from estimators.ensemble.stepping import read_states, set_parameters
from estimators.joint.state import (
    NX,
    ROLL,
    SPEED,
    VX,
)


@njit(cache=True, nogil=True)
def track_parameters(cars, config, state):
    """Moves the twins' parameters towards the estimates and every twin's states by S d."""
    n, p = cars.size, config.parameter.size
    seconds = config.block * config.dt
    share = seconds / config.tracking_time
    d = np.empty(p)
    for i in range(p):
        ahead = state.z[i] - state.theta[config.parameter[i]]
        state.rate[i] += share * (ahead - 2.0 * state.rate[i])
        d[i] = share * state.rate[i]
        state.went[i] += d[i] - config.speed_gain * seconds * state.went[i]
    states, dx, theta = state.states, state.dx, state.theta
    for i in range(n):
        read_states(cars[i], states[i])
    _bound_speed_certainty(config, state)
    dx[:] = 0.0
    for i in range(p):
        for k in range(NX):
            dx[k] += (states[i + 1, k] - states[0, k]) * d[i] / config.step[i]
    for i in range(p):
        theta[config.parameter[i]] += d[i]
    for i in range(n):
        move_states(cars[i], dx.copy(), states[0, ROLL])
        state.p[:] = theta
        if i > 0:
            state.p[config.parameter[i - 1]] += config.step[i - 1]
        set_parameters(cars[i], state.p)


@njit(cache=True, nogil=True)
def _bound_speed_certainty(config, state):
    """Lets the common error of the twins' speeds be no smaller than what following leaves.

    Speed is the state that forgets last: with 1 / speed_gain. What the parameters went in that
    time, S of the speed had not followed.
    """
    moved, uncertain = 0.0, 0.0
    for i in range(config.parameter.size):
        slope = (state.states[i + 1, VX] - state.states[0, VX]) / config.step[i]
        moved += (state.went[i] / config.prior[i]) ** 2
        uncertain += slope**2 * (state.covariance[i, i] + state.went[i] ** 2)
    for i in range(config.parameter.size, state.z.size):
        if config.sensor_error[i - config.parameter.size] == SPEED:
            least = config.speed_curvature * moved * uncertain
            state.covariance[i, i] = max(state.covariance[i, i], least)
