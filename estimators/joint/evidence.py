"""Evidence that the joint observer keeps to judge its own model: compiled sums over blocks.

A block's linearised measurement is m = H z + noise of variance v. Kept are the normal equations
sum H'H/v, sum H'm/v by segment of used driving and by channel, and for windows of several lengths
the sums of squares that the residuals' whiteness follows from at any z. Memory does not grow:
where there is no room for another segment, neighbours are merged.
"""

import numpy as np
from numba import njit

from estimators.joint.state import ABSENT, NY, SPEED

SEGMENTS = 16  # kept at most; chosen, 4 to 20 make no difference
SCALES = np.array([1, 16, 100, 500])  # blocks of a window: .01, .16, 1, 5 s
# What `State.evidence` counts: segments that are full, blocks of the current one, blocks that make
# a segment, blocks in all
FULL, FILLED, LENGTH, USED = 0, 1, 2, 3


@njit(cache=True, nogil=True)
def add_evidence(config, state, h, r, variance):
    """Adds a block; tells whether it completes a segment.

    Args:
        config: of the observer.
        state: of the observer; the evidence in it is changed.
        h: (ny, q) sensitivities.
        r: (ny,) innovations, relative to the estimates.
        variance: (ny,) of the noise and the linearisation error.
    """
    q = state.z.size
    current = min(state.evidence[FULL], SEGMENTS - 1)
    plain = h.copy()  # without the twins' speed, whose error changes from second to second
    for i in range(config.parameter.size, q):
        if config.sensor_error[i - config.parameter.size] == SPEED:
            plain[:, i] = 0.0
    for j in range(NY):
        if not variance[j] < ABSENT:
            continue
        m, clean = r[j], r[j]
        for i in range(q):
            m += h[j, i] * state.z[i]
            clean += plain[j, i] * state.z[i]
        _add(state.segment_information[current, j], state.segment_score[current, j],
             h[j], m, variance[j])  # fmt: skip
        for s in range(SCALES.size):
            state.window_sums[s, j, 0] += clean
            state.window_sums[s, j, 1] += variance[j]
            state.window_sums[s, j, 2:] += plain[j]
    state.evidence[USED] += 1
    for s in range(SCALES.size):
        if state.evidence[USED] % SCALES[s] == 0:
            _close_window(state, s)
    state.evidence[FILLED] += 1
    if state.evidence[FILLED] < state.evidence[LENGTH]:
        return False
    state.evidence[FILLED] = 0
    state.evidence[FULL] += 1
    return True


@njit(cache=True, nogil=True)
def _add(information, score, h, m, variance):
    """Adds one measurement to normal equations (q, q), (q,), in the upper triangle."""
    for i in range(h.size):
        if h[i] == 0.0:
            continue
        weighed = h[i] / variance
        score[i] += weighed * m
        for k in range(i, h.size):
            information[i, k] += weighed * h[k]


@njit(cache=True, nogil=True)
def _close_window(state, s):
    """Adds a full window's sums to the squares of its scale."""
    for j in range(NY):
        sums = state.window_sums[s, j]
        if sums[1] > 0.0:
            _add(state.scale_information[s, j], state.scale_score[s, j], sums[2:], sums[0], sums[1])
            state.scale_square[s, j, 0] += sums[0] ** 2 / sums[1]
            state.scale_square[s, j, 1] += 1.0
        sums[:] = 0.0


@njit(cache=True, nogil=True)
def merge_segments(state):
    """Merges neighbouring segments into half as many of twice the length, if there is no room."""
    if state.evidence[FULL] < SEGMENTS:
        return
    for k in range(SEGMENTS // 2):
        state.segment_information[k] = (
            state.segment_information[2 * k] + state.segment_information[2 * k + 1]
        )
        state.segment_score[k] = state.segment_score[2 * k] + state.segment_score[2 * k + 1]
    state.segment_information[SEGMENTS // 2 :] = 0.0
    state.segment_score[SEGMENTS // 2 :] = 0.0
    state.evidence[FULL] = SEGMENTS // 2
    state.evidence[LENGTH] *= 2


@njit(cache=True, nogil=True)
def forget_evidence(state, length):
    """Starts anew with segments of so many blocks."""
    state.segment_information[:] = 0.0
    state.segment_score[:] = 0.0
    state.scale_information[:] = 0.0
    state.scale_score[:] = 0.0
    state.scale_square[:] = 0.0
    state.window_sums[:] = 0.0
    state.evidence[:] = 0
    state.evidence[LENGTH] = length
