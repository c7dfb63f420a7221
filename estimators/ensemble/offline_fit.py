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
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate
from estimators.ensemble.twins import Source, parameters_of
from estimators.ensemble.unscented import BIAS_SD
from estimators.entry import Entry, Given
from estimators.priors import initial_deltas, prior_sds
from estimators.til.observer import Observer
from twin import IMU, LOAD, OUTPUTS, PARAMETER, SCALES, Drive, Twin, TwinError, Vehicle

Array = NDArray[np.float64]

# Samples per mean: at 1 kHz no motion of a car is faster than 10 ms by much
BLOCK = 10
# The fit ends once a step changes half the sum of squared residuals by less than this share: of
# the 120000 block means of two minutes, less than a tenth of one squared residual
TOLERANCE = 1e-6
MOST_STEPS = 20


class OfflineFit:
    """Fits parameters of a twin to a whole drive.

    Args:
        source: of the twin: a vehicle, or what makes a black box.
        noise_sd: (10,) standard deviation of a sample's white noise by channel; NaN: not used.
        parameters: of `twin.PARAMETERS`, p of them; the others stay as they are at the start.
        prior_sd: by parameter, instead of that of its record.

    Raises:
        TwinError: a name or a number is not allowed.
    """

    def __init__(
        self,
        source: Source,
        noise_sd: ArrayLike,
        parameters: Sequence[str] = (*LOAD, *SCALES),
        prior_sd: Mapping[str, float] | None = None,
    ) -> None:
        twin = Twin(source) if isinstance(source, Vehicle) else source()
        unknown = [name for name in parameters if name not in twin.parameters]
        if unknown:
            raise TwinError(
                f"fit: parameter {unknown[0]!r} is unknown; allowed: {', '.join(twin.parameters)}"
            )
        self.estimated = tuple(parameters)
        prior = prior_sds(parameters, prior_sd)
        self._scale = np.array([*(prior[name] for name in parameters), *BIAS_SD])
        by_channel = dict(
            zip(OUTPUTS, _checked_noise(np.asarray(noise_sd, np.float64)), strict=True)
        )
        self._noise_sd = np.array([by_channel.get(name, np.nan) for name in twin.outputs])
        self._observer = Observer(twin, [])

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return self._observer.dt

    def reset(
        self,
        speed: float,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """See `estimators.base.Estimator`; the fit starts at these parameters."""
        initial_deltas(parameters, self._observer.twin.parameters)  # checks the names
        self._start = _Start(speed, dict(parameters or {}), road)

    def run(self, drive: Drive) -> Estimate:
        """Fits a whole drive.

        Returns:
            The run of the twin with the fitted parameters, the same in all samples.

        Raises:
            TwinError: the drive does not fit the twin, or the twin blew up.
        """
        from scipy.optimize import least_squares  # not at the top: it takes its time

        p = len(self.estimated)
        problem = _Problem(
            self._observer, drive, _measured(drive, self._noise_sd), self.estimated,
            self._start, self._scale,
        )  # fmt: skip
        solution = least_squares(
            problem.residuals,
            np.zeros(self._scale.size),
            jac=problem.jacobian,  # pyright: ignore[reportArgumentType] # SciPy comes without types
            ftol=TOLERANCE,
            max_nfev=MOST_STEPS,
        )
        # in units of the prior, of which the last rows of the Jacobian are
        scale = np.outer(self._scale, self._scale)
        covariance = np.linalg.inv(solution.jac.T @ solution.jac) * scale
        sd = np.sqrt(np.diag(covariance))[:p]
        found = problem.run(solution.x)
        return replace(found, estimated=self.estimated, sd=np.broadcast_to(sd, (len(drive), p)))


class _Start(NamedTuple):
    """Where the drive begins: speed [m/s], deltas by name, (4,) heights of the road [m]."""

    speed: float
    parameters: Mapping[str, float]
    road: ArrayLike | None


class _Measured(NamedTuple):
    """Block means (M, ny) and the inverse of their standard deviation; zero: nothing measured."""

    mean: Array
    weight: Array


class _Problem:
    """Residuals and their slopes over x (q,): parameters and biases in units of their prior."""

    def __init__(
        self,
        observer: Observer,
        drive: Drive,
        measured: _Measured,
        parameters: tuple[str, ...],
        start: _Start,
        scale: Array,
    ) -> None:
        self._observer, self._drive, self._measured = observer, drive, measured
        self._parameters, self._start, self._scale = parameters, start, scale
        self._centre = np.array([start.parameters.get(name, 0.0) for name in parameters])
        self._last: tuple[Array, Estimate] | None = None
        # (6, ny) which output each of the IMU's biases enters
        outputs = observer.twin.outputs
        self._biased = np.array([np.isin(outputs, name) for name in OUTPUTS[IMU]], dtype=np.float64)

    def _simulate(self, theta: Array) -> Estimate:
        """The open-loop twin over the drive, with parameters theta (p,)."""
        fitted = dict(zip(self._parameters, theta.tolist(), strict=True))
        self._observer.reset(
            self._start.speed, {**self._start.parameters, **fitted}, self._start.road
        )
        return self._observer.run(self._drive)

    def _theta(self, x: Array) -> Array:
        return self._centre + (x * self._scale)[: len(self._parameters)]

    def run(self, x: Array) -> Estimate:
        """The twin's run at x; the last one is kept."""
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = x.copy(), self._simulate(self._theta(x))
        return self._last[1]

    def residuals(self, x: Array) -> Array:
        """(m + q,) of the m outputs, and of the prior."""
        biases = (x * self._scale)[len(self._parameters) :]
        found = _block_means(self.run(x).outputs)
        found += biases @ self._biased
        return np.append(((found - self._measured.mean) * self._measured.weight).ravel(), x)

    def jacobian(self, x: Array) -> Array:
        """(m + q, q), by one run for each parameter."""
        theta, middle = self._theta(x), _block_means(self.run(x).outputs)
        columns = []
        for i, name in enumerate(self._parameters):
            beside = theta.copy()
            step = PARAMETER[name].step
            beside[i] += step
            columns.append((_block_means(self._simulate(beside).outputs) - middle) / step)
        columns += [np.broadcast_to(row, middle.shape) for row in self._biased]
        pairs = zip(columns, self._scale, strict=True)
        stacked = [(column * self._measured.weight * s).ravel() for column, s in pairs]
        return np.vstack([np.column_stack(stacked), np.eye(x.size)])


def _checked_noise(sd: Array) -> Array:
    if sd.shape != (len(OUTPUTS),) or not (np.isnan(sd) | (sd > 0.0)).all():
        raise TwinError(
            f"fit: noise_sd is {sd.tolist()}; allowed: {len(OUTPUTS)} numbers above zero, NaN for "
            "a channel that is not used"
        )
    return sd


def _measured(drive: Drive, sd: Array) -> _Measured:
    # A block lacks a channel as soon as one of its samples does: its mean would not be the twin's
    mean = _block_means(drive.measurements[:, : sd.size])
    weight = np.sqrt(BLOCK) / sd
    return _Measured(np.nan_to_num(mean), np.nan_to_num(np.where(np.isnan(mean), 0.0, weight)))


def _block_means(values: Array) -> Array:
    """(M, k) means of (N, k) values; a last block that is not full is left out."""
    m = len(values) // BLOCK
    return values[: m * BLOCK].reshape(m, BLOCK, -1).mean(axis=1)


def _make(given: Given) -> OfflineFit:
    source = given.source()
    parameters = given.parameters or parameters_of(source, (*LOAD, *SCALES))
    return OfflineFit(source, given.noise(OUTPUTS), parameters, given.prior_sd)


ENTRY = Entry(
    name="least-squares",
    words="least squares over the whole recorded drive",
    make=_make,
    needs=frozenset(("twin", "noise_sd")),
    channels=OUTPUTS,
    gives=(*LOAD, *SCALES, "sideslip"),
    sd=True,
)
