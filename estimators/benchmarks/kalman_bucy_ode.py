"""KBF Eq. (9) as it stands: the 6x6 Riccati differential equation, integrated by RK4.

With the Jacobian of the parameters it is the reference for the fast filter; without it, it is the
filter as printed: A_02 = 0, so the parameter rows of the gain stay exactly zero.
"""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from estimators.benchmarks import kalman_bucy_laws as laws
from estimators.benchmarks.kalman_bucy import (
    Estimate,
    KalmanBucySettings,
    check_drive,
    compile_law,
    estimate,
)
from twin import TruckParameters, TwinError

Array = NDArray[np.float64]

RK4_LIMIT = 2.785  # |lambda dt| up to which RK4 is stable on the negative real axis


def run_riccati(
    truck: TruckParameters,
    sample_time: float,
    settings: KalmanBucySettings,
    time: ArrayLike,
    deflections: ArrayLike,
    rates: ArrayLike,
    *,
    gravity: float = 0.0,
) -> Estimate:
    """Runs the Kalman-Bucy filter with its Jacobian as a differential equation over a drive.

    Signals are linear between the samples. The detection of load changes and the bounds of the
    settings do not apply.

    Args:
        truck: what the filter believes in.
        sample_time: [s], also the step of RK4.
        settings: tuning.
        time: [s]. Shape (n,).
        deflections: four deflections [m], then four rates [m/s]. Shape (n, 8).
        rates: vertical, roll and pitch velocity [m/s, rad/s, rad/s]. Shape (n, 3).
        gravity: as in `KalmanBucy`.

    Raises:
        TwinError: bad input, or a step size at which RK4 is unstable.
    """
    law = compile_law(truck, sample_time, settings, gravity)
    return _run(law, truck, time, deflections, rates, True)


def run_literal(
    truck: TruckParameters,
    sample_time: float,
    settings: KalmanBucySettings,
    time: ArrayLike,
    deflections: ArrayLike,
    rates: ArrayLike,
) -> Estimate:
    """Runs the filter as KBF Eqs. (8)-(9) print it; its parameters never leave their start.

    Arguments and errors are those of `run_riccati`; gravity is unknown to it. The state holds
    p / p_nominal instead of p, which changes units only.
    """
    if settings.parametrisation != "p":
        raise TwinError(
            f"literal filter parametrisation: {settings.parametrisation!r}, must be 'p'"
        )
    law = compile_law(truck, sample_time, settings, 0.0)
    return _run(law, truck, time, deflections, rates, False)


def _run(law, truck, time, deflections, rates, with_jacobian: bool) -> Estimate:
    inputs, measured = check_drive(time, deflections, rates, law.sample_time)
    n = len(measured)
    states, covariances = np.empty((n, 6)), np.empty((n, 6, 6))
    done = _integrate(law, inputs, measured, with_jacobian, states, covariances)
    if done < n:
        raise TwinError(
            f"Kalman-Bucy sample_time: {law.sample_time} s is unstable for the Riccati equation "
            f"at sample {done}; must keep P dt / R below {RK4_LIMIT}"
        )
    axis = np.arange(3)
    mean = np.stack([states[:, :3], states[:, 3:]], axis=-1)
    cov = np.stack(
        [
            covariances[:, axis, axis],
            covariances[:, axis, axis + 3],
            covariances[:, axis + 3, axis + 3],
        ],
        axis=-1,
    )
    return estimate(law.kind, truck.nominal.parameters, mean, cov)


@njit(cache=True, nogil=True)
def _derivative(law, with_jacobian, x, p, forces, rates, dx, dp):
    """Right-hand side of KBF Eq. (9)."""
    gain = np.zeros((6, 3))
    a = np.zeros((6, 6))
    for axis in range(3):
        gain[:, axis] = p[:, axis] / law.measurement_density[axis]
        acceleration, h = laws.jacobian(law.kind, forces[axis], x[axis + 3])
        if with_jacobian:
            a[axis, axis + 3] = h
        dx[axis] = acceleration - law.gravity[axis]
        dx[axis + 3] = 0.0
    dx += gain @ (rates - x[:3])
    dp[:] = a @ p + p @ a.T - gain @ np.ascontiguousarray(p[:3])
    for axis in range(3):
        dp[axis, axis] += law.velocity_density
        dp[axis + 3, axis + 3] += law.parameter_density


@njit(cache=True, nogil=True)
def _integrate(law, with_inputs, measured, with_jacobian, states, covariances):
    """RK4 over all samples; returns how many were stable."""
    dt = law.sample_time
    x, p = np.zeros(6), np.zeros((6, 6))
    before, after = np.empty(3), np.empty(3)
    laws.axis_forces(law, with_inputs[0], before)
    for axis in range(3):
        x[axis] = measured[0, axis]
        x[axis + 3] = laws.to_state(law.kind, law.start[axis])
        p[axis, axis] = law.measurement_density[axis] / dt
        p[axis + 3, axis + 3] = law.start_variance[axis]
    states[0], covariances[0] = x, p
    dx, dp = np.zeros((4, 6)), np.zeros((4, 6, 6))
    for k in range(1, len(measured)):
        laws.axis_forces(law, with_inputs[k], after)
        for stage in range(4):
            weight = 0.5 * ((stage + 1) // 2)
            x_stage, p_stage = x.copy(), p.copy()
            if stage > 0:
                x_stage += weight * dt * dx[stage - 1]
                p_stage += weight * dt * dp[stage - 1]
            forces = (1 - weight) * before + weight * after
            rates = (1 - weight) * measured[k - 1] + weight * measured[k]
            _derivative(law, with_jacobian, x_stage, p_stage, forces, rates, dx[stage], dp[stage])
        x += dt / 6 * (dx[0] + 2 * dx[1] + 2 * dx[2] + dx[3])
        p += dt / 6 * (dp[0] + 2 * dp[1] + 2 * dp[2] + dp[3])
        before[:] = after
        for axis in range(3):
            if not 0 <= p[axis, axis] * dt / law.measurement_density[axis] <= RK4_LIMIT:
                return k
        states[k], covariances[k] = x, p
    return len(measured)
