"""Compiled step of the Kalman-Bucy filter: three independent axes of velocity and parameter.

The model of each axis is dv/dt = F / rho - g with rho = p / p_nominal and F = f / p_nominal the
acceleration that the measured suspension force f = (H_2 u)_i, KBF Eq. (6), would give the nominal
load; g is gravity on the vertical axis. The parameter state s is rho, 1 / rho or log rho; its
Jacobian h = d(dv/dt)/ds is what KBF Eq. (9) leaves out, and what makes a parameter observable.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

PARAMETRISATIONS = {"p": 0, "1/p": 1, "log p": 2}
_P, _INVERSE = PARAMETRISATIONS["p"], PARAMETRISATIONS["1/p"]


class Law(NamedTuple):
    """Constants of the filter.

    Attributes:
        kind: parametrisation, a value of `PARAMETRISATIONS`.
        sample_time: [s].
        excitation: rows of H_2 by p_nominal. Shape (3, 8).
        offset: acceleration of the preload at the nominal load [m/s2]. Shape (3,).
        gravity: [m/s2]. Shape (3,).
        measurement_density: R of KBF Eq. (9), per axis [(m/s)^2 s, (rad/s)^2 s]. Shape (3,).
        velocity_density: Q_v [(m/s2)^2 s, (rad/s2)^2 s].
        parameter_density: Q_p by p_nominal^2 [1/s].
        start: relative parameter rho at the start. Shape (3,).
        start_variance: of the state s at the start. Shape (3,).
        lowest: lower bound of s.
        highest: upper bound of s.
        gate: standard deviations of the window's mean innovation that reveal a load change.
        inflation: variance of s added then.
    """

    kind: int
    sample_time: float
    excitation: Array
    offset: Array
    gravity: Array
    measurement_density: Array
    velocity_density: float
    parameter_density: float
    start: Array
    start_variance: Array
    lowest: float
    highest: float
    gate: float
    inflation: float


class State(NamedTuple):
    """State of the filter, changed in place.

    Attributes:
        mean: velocity v and parameter s per axis. Shape (3, 2).
        covariance: P_vv, P_vs, P_ss per axis. Shape (3, 3).
        force: F of the last sample [m/s2, rad/s2]. Shape (3,).
        innovations: the last normalised ones, newest last. Shape (3, window).
        samples: how many were seen. Shape (1,).
    """

    mean: Array
    covariance: Array
    force: Array
    innovations: Array
    samples: NDArray[np.int64]


@njit(cache=True, nogil=True)
def to_state(kind, rho):
    """Parameter state s of a relative parameter rho."""
    if kind == _P:
        return rho
    return 1.0 / rho if kind == _INVERSE else np.log(rho)


@njit(cache=True, nogil=True)
def from_state(kind, s):
    """Relative parameter rho of a parameter state s, and d rho / d s."""
    if kind == _P:
        return s, 1.0
    if kind == _INVERSE:
        return 1.0 / s, -1.0 / (s * s)
    return np.exp(s), np.exp(s)


@njit(cache=True, nogil=True)
def jacobian(kind, force, s):
    """Acceleration F / rho(s) and its derivative h with respect to s."""
    if kind == _P:
        return force / s, -force / (s * s)
    if kind == _INVERSE:
        return force * s, force
    return force * np.exp(-s), -force * np.exp(-s)


@njit(cache=True, nogil=True)
def axis_forces(law, deflections, forces):
    """Fills F per axis [m/s2, rad/s2] from eight deflections and rates."""
    for axis in range(3):
        total = law.offset[axis]
        for channel in range(8):
            total += law.excitation[axis, channel] * deflections[channel]
        forces[axis] = total


@njit(cache=True, nogil=True)
def predict(law, state, axis, force):
    """Moves one axis on by a sample, with the mean of the forces at its two ends."""
    dt, q = law.sample_time, law.parameter_density
    mean, cov = state.mean[axis], state.covariance[axis]
    acceleration, h = jacobian(law.kind, 0.5 * (state.force[axis] + force), mean[1])
    mean[0] += (acceleration - law.gravity[axis]) * dt
    vv, vs, ss = cov[0], cov[1], cov[2]
    a = h * dt
    cov[0] = vv + 2 * a * vs + a * a * ss + law.velocity_density * dt + a * a * q * dt / 3
    cov[1] = vs + a * ss + a * q * dt / 2
    cov[2] = ss + q * dt


@njit(cache=True, nogil=True)
def correct(law, state, axis, rate):
    """Corrects one axis with its measured velocity, in Joseph's form; keeps s within bounds."""
    mean, cov = state.mean[axis], state.covariance[axis]
    noise = law.measurement_density[axis] / law.sample_time
    innovation = rate - mean[0]
    variance = cov[0] + noise
    k_v, k_s = cov[0] / variance, cov[1] / variance
    mean[0] += k_v * innovation
    mean[1] = min(max(mean[1] + k_s * innovation, law.lowest), law.highest)
    vv, vs, ss = cov[0], cov[1], cov[2]
    keep = 1 - k_v
    cov[0] = keep * keep * vv + k_v * k_v * noise
    cov[1] = keep * (vs - k_s * vv) + k_v * k_s * noise
    cov[2] = ss - 2 * k_s * vs + k_s * k_s * vv + k_s * k_s * noise
    detect(law, state, axis, innovation / np.sqrt(variance))


@njit(cache=True, nogil=True)
def detect(law, state, axis, normalised):
    """Inflates P_ss where the last innovations have a mean that noise does not explain."""
    window = state.innovations[axis]
    window[:-1] = window[1:].copy()
    window[-1] = normalised
    if abs(window.sum()) > law.gate * np.sqrt(window.size):
        state.covariance[axis, 2] += law.inflation
        window[:] = 0.0


@njit(cache=True, nogil=True)
def begin(law, state, rates, forces):
    """The first sample: its velocities start the filter, as sure as the sensors are."""
    for axis in range(3):
        state.mean[axis, 0] = rates[axis]
        state.mean[axis, 1] = to_state(law.kind, law.start[axis])
        state.covariance[axis, 0] = law.measurement_density[axis] / law.sample_time
        state.covariance[axis, 1] = 0.0
        state.covariance[axis, 2] = law.start_variance[axis]
        state.force[axis] = forces[axis]
    state.innovations[:] = 0.0


@njit(cache=True, nogil=True)
def step(law, state, deflections, rates):
    """One sample of the continuous-discrete filter: eight deflections, three velocities."""
    forces = np.empty(3)
    axis_forces(law, deflections, forces)
    if state.samples[0] == 0:
        begin(law, state, rates, forces)
    else:
        for axis in range(3):
            predict(law, state, axis, forces[axis])
            correct(law, state, axis, rates[axis])
            state.force[axis] = forces[axis]
    state.samples[0] += 1


@njit(cache=True, nogil=True)
def steps(law, state, deflections, rates, means, covariances):
    """Runs `step` over all rows and keeps mean (n, 3, 2) and covariance (n, 3, 3) of each."""
    for k in range(len(rates)):
        step(law, state, deflections[k], rates[k])
        means[k] = state.mean
        covariances[k] = state.covariance
