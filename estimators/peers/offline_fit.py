"""Least squares over a whole recorded drive: what an observer could reach with all the time it has.

The twin runs open loop over the drive, settled at the start under the parameters in question. The
residuals are the differences of its outputs from the measured ones, block means in units of their
noise, and the parameters themselves in units of their prior standard deviation; biases of the IMU
enter as constants. Gauss-Newton steps within a trust region (scipy) take the Jacobian from runs of
the black box with one parameter a little off. With white noise and the vehicle's own model this is
the maximum a posteriori estimate, and the inverse of J'J its covariance.

Nothing draws the twin to the measured speed. Where the torques are known badly it drifts away from
the vehicle, and the fit then pays in its parameters.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.estimate import Estimate
from estimators.joint.observer import OFFSETS, PRIOR_SD
from estimators.parameter_estimate import ParameterEstimate
from estimators.peers.unscented import BIAS_SD
from estimators.til.observer import Observer
from twin import LOAD, OUTPUTS, PARAMETERS, SCALES, Drive, Twin, TwinError, Vehicle

Array = NDArray[np.float64]

# Samples per mean: at 1 kHz no motion of a car is faster than 10 ms by much
BLOCK = 10
# The fit ends once a step changes half the sum of squared residuals by less than this share: of
# the 120000 block means of two minutes, less than a tenth of one squared residual
TOLERANCE = 1e-6
MOST_STEPS = 20


def offline_fit(
    vehicle: Vehicle,
    drive: Drive,
    noise_sd: ArrayLike,
    parameters: Sequence[str] = (*LOAD, *SCALES),
    *,
    speed: float,
    prior_sd: Mapping[str, float] | None = None,
) -> ParameterEstimate:
    """Fits parameters of the twin to a whole drive.

    Args:
        vehicle: of the twin.
        drive: of N samples.
        noise_sd: (10,) standard deviation of a sample's white noise by channel; NaN: not used.
        parameters: of `twin.PARAMETERS`, p of them; the others stay nominal.
        speed: at the start [m/s].
        prior_sd: by parameter, instead of `estimators.joint.observer.PRIOR_SD`.

    Returns:
        The run of the twin with the fitted parameters, the same in all samples.

    Raises:
        TwinError: a name is unknown, the drive does not fit the twin, or the twin blew up.
    """
    from scipy.optimize import least_squares  # not at the top: it takes its time

    unknown = [name for name in parameters if name not in PARAMETERS]
    if unknown:
        raise TwinError(
            f"fit: parameter {unknown[0]!r} is unknown; allowed: {', '.join(PARAMETERS)}"
        )
    prior = PRIOR_SD | dict(prior_sd or {})
    scale = np.array([*(prior[name] for name in parameters), *BIAS_SD])
    measured = _measured(drive, np.asarray(noise_sd, dtype=np.float64))
    problem = _Problem(vehicle, drive, measured, tuple(parameters), speed, scale)
    solution = least_squares(
        problem.residuals,
        np.zeros(scale.size),
        jac=problem.jacobian,  # pyright: ignore[reportArgumentType] # SciPy comes without types
        ftol=TOLERANCE,
        max_nfev=MOST_STEPS,
    )
    # in units of the prior, of which the last rows of the Jacobian are
    covariance = np.linalg.inv(solution.jac.T @ solution.jac) * np.outer(scale, scale)
    estimate, p = problem.run(solution.x), len(parameters)
    return ParameterEstimate(
        time=estimate.time,
        states=estimate.states,
        parameters=estimate.parameters,
        outputs=estimate.outputs,
        extended=estimate.extended,
        nominal=estimate.nominal,
        estimated=tuple(parameters),
        sd=np.broadcast_to(np.sqrt(np.diag(covariance))[:p], (len(drive), p)),
    )


class _Measured(NamedTuple):
    """Block means (M, ny) and the inverse of their standard deviation; zero: nothing measured."""

    mean: Array
    weight: Array


class _Problem:
    """Residuals and their slopes over x (q,): parameters and biases in units of their prior."""

    def __init__(
        self,
        vehicle: Vehicle,
        drive: Drive,
        measured: _Measured,
        parameters: tuple[str, ...],
        speed: float,
        scale: Array,
    ) -> None:
        self._twin = Twin(vehicle)
        self._observer, self._drive, self._measured = Observer(self._twin, []), drive, measured
        self._parameters, self._speed, self._scale = parameters, speed, scale
        self._last: tuple[Array, Estimate] | None = None

    def _simulate(self, theta: Array) -> Estimate:
        """The open-loop twin over the drive, with parameters theta (p,)."""
        load = dict(zip(self._parameters, theta.tolist(), strict=True))
        self._observer.reset(self._speed, load)
        self._twin.reset(self._speed, self._drive.inputs[0, 9:13])
        return self._observer.run(self._drive)

    def _theta(self, x: Array) -> Array:
        return (x * self._scale)[: len(self._parameters)]

    def run(self, x: Array) -> Estimate:
        """The twin's run at x; the last one is kept."""
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = x.copy(), self._simulate(self._theta(x))
        return self._last[1]

    def residuals(self, x: Array) -> Array:
        """(m + q,) of the m outputs, and of the prior."""
        biases = (x * self._scale)[len(self._parameters) :]
        found = _block_means(self.run(x).outputs)
        found[:, : biases.size] += biases
        return np.append(((found - self._measured.mean) * self._measured.weight).ravel(), x)

    def jacobian(self, x: Array) -> Array:
        """(m + q, q), by one run for each parameter."""
        theta, middle = self._theta(x), _block_means(self.run(x).outputs)
        columns = []
        for i, name in enumerate(self._parameters):
            beside = theta.copy()
            beside[i] += OFFSETS[name]
            columns.append((_block_means(self._simulate(beside).outputs) - middle) / OFFSETS[name])
        biased = np.eye(len(OUTPUTS))[: x.size - theta.size]
        columns += [np.broadcast_to(row, middle.shape) for row in biased]
        pairs = zip(columns, self._scale, strict=True)
        stacked = [(column * self._measured.weight * s).ravel() for column, s in pairs]
        return np.vstack([np.column_stack(stacked), np.eye(x.size)])


def _measured(drive: Drive, sd: Array) -> _Measured:
    if sd.shape != (len(OUTPUTS),) or not (np.isnan(sd) | (sd > 0.0)).all():
        raise TwinError(
            f"fit: noise_sd is {sd.tolist()}; allowed: {len(OUTPUTS)} numbers above zero, NaN for "
            "a channel that is not used"
        )
    # A block lacks a channel as soon as one of its samples does: its mean would not be the twin's
    mean = _block_means(drive.measurements)
    weight = np.sqrt(BLOCK) / sd
    return _Measured(np.nan_to_num(mean), np.nan_to_num(np.where(np.isnan(mean), 0.0, weight)))


def _block_means(values: Array) -> Array:
    """(M, k) means of (N, k) values; a last block that is not full is left out."""
    m = len(values) // BLOCK
    return values[: m * BLOCK].reshape(m, BLOCK, -1).mean(axis=1)
