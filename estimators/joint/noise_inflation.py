"""Noise inflation where innovations are not white, and detection of a change of the load."""

import numpy as np
from numba import njit

from estimators.joint.state import (
    ABSENT,
    AFTER_WHEELS,
    DRIVEN,
    FIRST_WHEEL,
    LARGEST_INFLATION,
    NY,
    STANDING,
    WATCH,
    WINDOW,
)


@njit(cache=True, nogil=True)
def inflate_noise(config, state, h, r, variance):
    """Scales the variances by what sums of innovations show of noise that is not white.

    A sum over a window has the variance of white noise and of what the parameters are not known
    by; what exceeds it is coloured noise or an error of the model, and counts as noise.
    """
    window, summed = state.window, state.window_h
    for j in range(NY):
        if variance[j] < ABSENT:
            window[0, j] += r[j]
            window[1, j] += variance[j]
            summed[j] += h[j]
            variance[j] *= max(state.inflation[j], 1.0)
    window[2] += 1.0
    if window[2, 0] < WINDOW:
        return
    share = WINDOW * config.block * config.dt / config.inflation_time
    for j in range(NY):
        if window[1, j] > 0.0:
            known = summed[j] @ (state.covariance @ summed[j])
            excess = (window[0, j] ** 2 - known) / window[1, j]
            state.inflation[j] += share * (
                min(max(excess, 0.0), LARGEST_INFLATION) - state.inflation[j]
            )
    window[:] = 0.0
    summed[:] = 0.0


@njit(cache=True, nogil=True)
def keep(config, state):
    """Keeps the estimates while the car stands: its load may change now."""
    for j in range(FIRST_WHEEL, AFTER_WHEELS):
        if abs(state.late[0, j]) > STANDING or abs(state.measured[j]) > STANDING * config.block:
            return
    if state.blocks[DRIVEN] < config.settle:
        return
    state.kept[:], state.kept_covariance[:] = state.z, state.covariance
    state.kept_inflation[:] = state.inflation
    state.recent[:], state.score[:] = 0.0, 0.0
    state.blocks[WATCH] = config.watch


@njit(cache=True, nogil=True)
def load_changed(config, state, h, r):
    """Whether what was known of the load before the stop contradicts what has been seen since.

    Of the last seconds' information A and score b = sum H' R^-1 r, no change means b ~ N(0, A +
    A P A). A contradiction that would also move a parameter noticeably is a change of the load.
    """
    load = config.load
    share = 1.0 - config.block * config.dt / config.change_time
    informed, weighed = np.zeros_like(h), np.zeros_like(r)
    for j in range(NY):
        if state.present[j] > 0.0 and not np.isnan(config.noise[j]):
            variance = config.noise[j] / state.present[j] * max(state.kept_inflation[j], 1.0)
            informed[j], weighed[j] = h[j] / variance, r[j] / variance
    state.recent[:] = share * state.recent + h.T @ informed
    state.score[:] = share * state.score + h.T @ weighed
    if load.size == 0:
        return False
    spread = state.recent + state.recent @ state.kept_covariance @ state.recent
    a, b = np.empty((load.size, load.size)), np.empty(load.size)
    known = np.empty((load.size, load.size))
    for i in range(load.size):
        scale = config.prior[load[i]]
        b[i] = state.score[load[i]] * scale
        for k in range(load.size):
            both = scale * config.prior[load[k]]
            # a little more than the parts, so that what is not identifiable can be divided by
            a[i, k] = spread[load[i], load[k]] * both + (1e-3 if i == k else 0.0)
            known[i, k] = state.recent[load[i], load[k]] * both + (1.0 if i == k else 0.0)
    return (
        b @ np.linalg.solve(a, b) >= config.detection_threshold
        and np.abs(np.linalg.solve(known, b)).max() >= config.least_change
    )


@njit(cache=True, nogil=True)
def forget_load(config, state):
    """Goes back to what was known at the standstill, of the load as uncertain as at first."""
    load, covariance = config.load, state.covariance
    estimates = state.z.copy()
    state.z[:], covariance[:] = state.kept, state.kept_covariance
    state.inflation[:] = state.kept_inflation
    for k in load:
        state.z[k] = estimates[k]
        covariance[:, k] = 0.0
        covariance[k] = 0.0
    for k in load:
        covariance[k, k] = config.prior[k] ** 2
    state.window[:], state.window_h[:] = 0.0, 0.0
    state.blocks[WATCH] = 0
    state.changes[0] += 1
