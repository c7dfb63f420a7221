"""KBF Eq. (9) as it stands: the 6x6 Riccati differential equation, integrated by RK4.

With the Jacobian of the parameters it is the reference for the fast filter; without it, it is the
filter as printed: A_02 = 0, so the parameter rows of the gain stay exactly zero.
"""

from collections.abc import Mapping

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate
from estimators.benchmarks import kalman_bucy_laws as laws
from estimators.benchmarks.kalman_bucy import (
    CHANNELS,
    RATES,
    KalmanBucySettings,
    channels,
    compile_law,
    estimate,
)
from estimators.entry import Entry, Given
from twin import Drive, TruckParameters, TruckTwin, TwinError

Array = NDArray[np.float64]

RK4_LIMIT = 2.785  # |lambda dt| up to which RK4 is stable on the negative real axis


class KalmanBucyOde:
    """The Kalman-Bucy filter as a differential equation; signals are linear between samples.

    The detection of load changes and the bounds of the settings do not apply.

    Args:
        truck: what the filter assumes.
        sample_time: [s], also the step of RK4.
        settings: tuning.
        literal: whether the filter is as KBF Eqs. (8)-(9) print it: its parameters never leave
            their start. The state holds p / p_nominal instead of p, which changes units only.

    Raises:
        TwinError: a literal filter of another parametrisation than p.
    """

    def __init__(
        self,
        truck: TruckParameters,
        sample_time: float,
        settings: KalmanBucySettings,
        *,
        literal: bool = False,
    ) -> None:
        if literal and settings.parametrisation != "p":
            raise TwinError(
                f"literal filter parametrisation: {settings.parametrisation!r}, must be 'p'"
            )
        self.dt = sample_time
        self.nominal = truck.nominal.parameters
        self._law, self._literal = compile_law(truck, sample_time, settings), literal

    def reset(
        self,
        speed: float = 0.0,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """Nothing to reset: a drive begins at its first sample, with the settings' parameters."""

    def run(self, drive: Drive) -> Estimate:
        """Filters a whole drive.

        Raises:
            TwinError: bad input, or a step size at which RK4 is unstable.
        """
        law = self._law
        inputs, measured = channels(drive, law.sample_time)
        n = len(measured)
        states, covariances = np.empty((n, 6)), np.empty((n, 6, 6))
        done = _integrate(law, inputs, measured, not self._literal, states, covariances)
        if done < n:
            raise TwinError(
                f"Kalman-Bucy sample_time: {law.sample_time} s is unstable for the Riccati "
                f"equation at sample {done}; must keep P dt / R below {RK4_LIMIT}"
            )
        axis = np.arange(3)
        mean = np.stack([states[:, :3], states[:, 3:]], axis=-1)
        pairs = ((axis, axis), (axis, axis + 3), (axis + 3, axis + 3))
        covariance = np.stack([covariances[:, i, k] for i, k in pairs], axis=-1)
        return estimate(law.kind, self.nominal, drive.time, mean, covariance)


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


def _make_literal(given: Given) -> KalmanBucyOde:
    if given.dt is None:
        raise TwinError("Kalman-Bucy: has no sample time; allowed: with dt")
    settings = given.settings or KalmanBucySettings(parametrisation="p")
    return KalmanBucyOde(given.model, given.dt, settings, literal=True)


ENTRY = Entry(
    name="kalman-bucy-literal",
    words="the Kalman-Bucy filter of the truck as the paper prints it",
    make=_make_literal,
    needs=frozenset(("model", "dt")),
    channels=CHANNELS,
    gives=(*TruckTwin.parameters, *RATES),
    sd=True,
)
