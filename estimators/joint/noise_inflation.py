"""When the joint observer doubts: noise that is not white, a load that is no longer the same."""

import numpy as np
from numba import njit

from estimators.joint.state import (
    ABSENT,
    DRIVEN,
    LARGEST_DOUBT,
    NY,
    STANDING,
    WATCH,
    WHEEL_SPEED,
    WINDOW,
)


@njit(cache=True, nogil=True)
def weigh(setup, memory, h, r, variance):
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
def keep(setup, memory):
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
def load_changed(setup, memory, h, r):
    """Whether what was known of the load before the stop contradicts what has been seen since.

    Of the last seconds' information A and score b = sum H' R^-1 r, no change means b ~ N(0, A +
    A P A). A contradiction that would also move a parameter noticeably is a change of the load.
    """
    load = setup.load
    share = 1.0 - setup.block * setup.dt / setup.change_memory
    informed, weighed = np.zeros_like(h), np.zeros_like(r)
    for j in range(NY):
        if memory.present[j] > 0.0 and not np.isnan(setup.noise[j]):
            variance = setup.noise[j] / memory.present[j] * max(memory.kept_doubt[j], 1.0)
            informed[j], weighed[j] = h[j] / variance, r[j] / variance
    memory.recent[:] = share * memory.recent + h.T @ informed
    memory.score[:] = share * memory.score + h.T @ weighed
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
def forget_load(setup, memory):
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
