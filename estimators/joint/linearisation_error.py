"""The linearisation error of the joint observer's sensitivities, which are finite differences.

A sensitivity changes with the parameters by about its own size over a prior's standard deviation.
As long as the estimates are uncertain, or far from the twins, that error is proportional to the
sensitivities, lasts longer than a block, and would count as information in each of them; in
the direction in which all masses, stiffnesses and torques grow together, and the motion hardly
changes, it would be all the information there is. Its variance, of second order, adds to the noise
and vanishes as the estimates become certain and the twins catch up.

Two things are less smooth than that: a wheel about to lock, and a suspension that meets its stop.
"""

import numpy as np
from numba import njit

from estimators.joint.state import ABSENT, AFTER_WHEELS, DRIVEN, FIRST_WHEEL, LEAST_SPIN, NY, WAIT


@njit(cache=True, nogil=True)
def add_linearisation_error(config, state, h, variance):
    """Adds to the noise (ny,) the variance of what the sensitivities h (ny, q) leave out."""
    p = config.parameter.size
    uncertain, far = np.empty(p), 0.0
    for i in range(p):
        ahead = state.z[i] - state.theta[config.parameter[i]]
        uncertain[i] = state.covariance[i, i] + ahead**2
        far += uncertain[i] / config.prior[i] ** 2
    share = config.block * config.dt / config.excitation_time
    for j in range(NY):
        second = 0.0
        for i in range(p):
            state.usual[j, i] += share * (h[j, i] ** 2 - state.usual[j, i])
            second += state.usual[j, i] * uncertain[i]
        if variance[j] < ABSENT:
            variance[j] += config.curvature * far * second
            if FIRST_WHEEL <= j < AFTER_WHEELS:
                variance[j] += _slip_variance(config, state, h, j)


@njit(cache=True, nogil=True)
def _own(h, j):
    """(q,) sensitivity of a wheel's own speed: what the wheels have in common is the car's."""
    own = h[j].copy()
    for k in range(FIRST_WHEEL, AFTER_WHEELS):
        own -= h[k] / (AFTER_WHEELS - FIRST_WHEEL)
    return own


@njit(cache=True, nogil=True)
def _slip_variance(config, state, h, j):
    """Variance of what a wheel's speed is beside its sensitivity: it may lock, or not.

    What the wheels have in common is the car's speed; the rest is slip. Near the peak of its tyre's
    force a wheel's slip depends on everything, ten times more than usual, and not linearly.
    """
    own = _own(h, j)
    ahead = 0.0
    for i in range(config.parameter.size):
        ahead += own[i] * (state.z[i] - state.theta[config.parameter[i]])
    uncertain = own @ (state.covariance @ own) + ahead**2
    limit = config.slip_range * max(state.total[0, j] / config.block, LEAST_SPIN)
    return (uncertain / limit) ** 2


@njit(cache=True, nogil=True)
def _is_impact(config, state, h, variance):
    """Whether sensitivities jump from block to block: the twins meet a stop one by one."""
    for j in range(NY):
        jump, usual = 0.0, 0.0
        for i in range(config.parameter.size):
            certainty = state.covariance[i, i]
            jump += (h[j, i] - state.last_h[j, i]) ** 2 * certainty
            usual += state.usual[j, i] * certainty
        if jump > max(usual, config.impact * variance[j]):
            return True
    return False


@njit(cache=True, nogil=True)
def wait_after_impact(config, state, h, variance):
    """Has the observer wait a little after an impact."""
    if state.blocks[DRIVEN] > 0 and _is_impact(config, state, h, variance):
        state.blocks[WAIT] = round(config.impact_wait / (config.block * config.dt))
    state.last_h[:] = h
