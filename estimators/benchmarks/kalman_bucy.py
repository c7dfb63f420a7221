"""Kalman-Bucy filter for mass, roll and pitch inertia of a truck, KBF with its Jacobian mended.

As printed, KBF Eq. (9) never moves its parameters: see `estimators.kalman_bucy_literal`. Here the
parameter enters the linearisation, the 6x6 filter falls into three 2x2 ones, and each sample is a
continuous-discrete Kalman step: R / dt as the variance of a sample, the force averaged over it.
"""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.benchmarks import kalman_bucy_laws as laws
from twin import TruckParameters, TwinError

Array = NDArray[np.float64]

LONGEST_SAMPLE_TIME = 0.02  # four samples in a period of the wheel hop (12 Hz) [s]
_DEFLECTION_CHANNELS = 8
_RATE_CHANNELS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class KalmanBucySettings:
    """Tuning of the filter; the defaults are the paper's R with a Q that reproduces its Table 2.

    Attributes:
        parametrisation: what is estimated; 1/p makes the model linear and forgives bad starts.
        measurement_density: R of KBF Eq. (9) per axis [(m/s)^2 s, (rad/s)^2 s].
        velocity_density: Q of the velocities [(m/s2)^2 s, (rad/s2)^2 s]; the paper's is 1.
        parameter_density: Q of the parameters (of 1/p or log p) by their nominal values squared
            [1/s]. The paper's Q = I, in kg^2/s, reproduces its Table 2 in no parametrisation.
        start: parameters at the start by their nominal values; 2 in the paper.
        start_deviation: standard deviation of that start, by its own value.
        bounds: parameters, by their nominal values, stay within; chosen.
        gate: a load change is seen when the mean of the last `window` innovations is this many
            standard deviations from zero; infinity turns the detection off.
        window: number of innovations.
        inflation: what a load change adds to P_ss, the relative variance of the parameter.
    """

    parametrisation: Literal["p", "1/p", "log p"] = "1/p"
    measurement_density: tuple[float, float, float] = (5e-5, 5e-4, 5e-4)
    velocity_density: float = 1.0
    parameter_density: float = 1500.0
    start: tuple[float, float, float] = (2.0, 2.0, 2.0)
    start_deviation: float = 1.0
    bounds: tuple[float, float] = (0.05, 20.0)
    gate: float = np.inf
    window: int = 5
    inflation: float = 0.0

    def __post_init__(self):
        """Refuses values that make no filter."""
        choices = laws.PARAMETRISATIONS
        _require(
            self.parametrisation in choices,
            "parametrisation",
            self.parametrisation,
            f"one of {', '.join(choices)}",
        )
        _require(
            len(self.measurement_density) == 3 and min(self.measurement_density) > 0,
            "measurement_density",
            self.measurement_density,
            "three positive numbers",
        )
        for name in ("velocity_density", "parameter_density", "inflation"):
            _require(0 <= getattr(self, name) < np.inf, name, getattr(self, name), "at least 0")
        _require(
            0 < self.bounds[0] < self.bounds[1] < np.inf,
            "bounds",
            self.bounds,
            "two rising positive numbers",
        )
        _require(
            len(self.start) == 3
            and all(self.bounds[0] <= start <= self.bounds[1] for start in self.start),
            "start",
            self.start,
            f"three numbers within {self.bounds}",
        )
        _require(
            0 < self.start_deviation < np.inf, "start_deviation", self.start_deviation, "positive"
        )
        _require(self.gate > 0, "gate", self.gate, "positive")
        _require(self.window >= 1, "window", self.window, "at least 1")


def matched(
    sensor_deviation: tuple[float, float, float],
    sample_time: float,
    *,
    parameter_density: float = 1.5e-3,
) -> KalmanBucySettings:
    """Settings with R from the sensors: a sample has the variance R / dt = sensor_deviation^2.

    Args:
        sensor_deviation: standard deviation of the three rates [m/s, rad/s, rad/s].
        sample_time: [s].
        parameter_density: as in the settings; noisier sensors want a larger one, since the same
            drift then takes longer to be seen.
    """
    r_z, r_roll, r_pitch = (sigma**2 * sample_time for sigma in sensor_deviation)
    return KalmanBucySettings(
        measurement_density=(r_z, r_roll, r_pitch),
        velocity_density=1e-8,
        parameter_density=parameter_density,
    )


def detecting(settings: KalmanBucySettings, *, robust: bool = True) -> KalmanBucySettings:
    """Adds the detection of load changes by the innovation to some (matched) settings.

    Args:
        settings: what to add it to.
        robust: True leaves room for model error (Q_v = 1e-4, q = 0.1, small inflation). False is
            sharp: the best figures where springs and dampers are known exactly, but it breaks
            under model error (20-30 % with a damper 10 % off, where the others have 6-7 %),
            because it takes every misfit for a new load.
    """
    if not robust:
        return replace(settings, parameter_density=1e-5, gate=4.0, inflation=0.3)
    return replace(settings, velocity_density=1e-4, parameter_density=0.1, gate=4.0, inflation=0.1)


class Estimate(NamedTuple):
    """Estimates after one sample (shape (3,)) or after each sample of a drive (shape (n, 3)).

    Attributes:
        velocity: of the chassis [m/s, rad/s, rad/s].
        velocity_sd: its standard deviation.
        parameters: mass [kg], roll and pitch inertia [kg m2].
        parameters_sd: their standard deviation, to first order.
    """

    velocity: Array
    velocity_sd: Array
    parameters: Array
    parameters_sd: Array


class KalmanBucy:
    """The filter: `update` sample by sample, or `run` over a drive, the same compiled step."""

    def __init__(
        self,
        truck: TruckParameters,
        sample_time: float,
        settings: KalmanBucySettings | None = None,
        *,
        gravity: float = 0.0,
    ):
        """Prepares the filter.

        Args:
            truck: geometry, springs, dampers and nominal load that the filter believes in.
            sample_time: [s], above 0 and at most 0.02.
            settings: tuning.
            gravity: [m/s2]; 0 is the paper's model. Otherwise deflections are counted from the
                rest at the nominal load, and the filter weighs the load: dv/dt = F / m - g.
        """
        _require(
            0 < sample_time <= LONGEST_SAMPLE_TIME,
            "sample_time",
            sample_time,
            f"above 0 and at most {LONGEST_SAMPLE_TIME} s, or wheel hop is missed",
        )
        self.settings = settings or KalmanBucySettings()
        self.nominal = truck.nominal.parameters
        self.law = compile_law(truck, sample_time, self.settings, gravity)
        self.state = laws.State(
            mean=np.zeros((3, 2)),
            covariance=np.zeros((3, 3)),
            force=np.zeros(3),
            innovations=np.zeros((3, self.settings.window)),
            samples=np.zeros(1, dtype=np.int64),
        )

    def reset(self) -> None:
        """Forgets all samples; the next one is the first."""
        self.state.samples[0] = 0

    def update(self, deflections: ArrayLike, rates: ArrayLike) -> Estimate:
        """Takes one sample.

        Args:
            deflections: four deflections [m], then four rates [m/s]. Shape (8,).
            rates: vertical, roll and pitch velocity of the chassis [m/s, rad/s]. Shape (3,).

        Raises:
            TwinError: a channel is missing or not finite.
        """
        inputs = _channels(deflections, (_DEFLECTION_CHANNELS,), "deflections")
        measured = _channels(rates, (_RATE_CHANNELS,), "rates")
        laws.step(self.law, self.state, inputs, measured)
        return self._estimate(self.state.mean.copy(), self.state.covariance)

    def run(self, time: ArrayLike, deflections: ArrayLike, rates: ArrayLike) -> Estimate:
        """Takes all samples of a drive, from the beginning.

        Args:
            time: of the samples [s], a sample time apart. Shape (n,).
            deflections: as in `update`. Shape (n, 8).
            rates: as in `update`. Shape (n, 3).

        Raises:
            TwinError: a channel or a sample is missing, or a value is not finite.
        """
        inputs, measured = check_drive(time, deflections, rates, self.law.sample_time)
        self.reset()
        n = len(measured)
        means, covariances = np.empty((n, 3, 2)), np.empty((n, 3, 3))
        laws.steps(self.law, self.state, inputs, measured, means, covariances)
        return self._estimate(means, covariances)

    def _estimate(self, mean: Array, covariance: Array) -> Estimate:
        return estimate(self.law.kind, self.nominal, mean, covariance)


def compile_law(
    truck: TruckParameters, sample_time: float, settings: KalmanBucySettings, gravity: float
) -> laws.Law:
    """Puts truck and settings into the constants of the compiled step."""
    kind = laws.PARAMETRISATIONS[settings.parametrisation]
    start = np.asarray(settings.start, dtype=float)
    slope = np.array([laws.from_state(kind, laws.to_state(kind, rho))[1] for rho in start])
    low, high = sorted(laws.to_state(kind, bound) for bound in settings.bounds)
    weight = np.array([gravity, 0.0, 0.0])
    return laws.Law(
        kind=kind,
        sample_time=float(sample_time),
        excitation=np.ascontiguousarray(truck.excitation() / truck.nominal.parameters[:, None]),
        offset=weight,
        gravity=weight,
        measurement_density=np.asarray(settings.measurement_density, dtype=float),
        velocity_density=float(settings.velocity_density),
        parameter_density=float(settings.parameter_density),
        start=start,
        start_variance=(settings.start_deviation * start / slope) ** 2,
        lowest=low,
        highest=high,
        gate=float(settings.gate),
        inflation=float(settings.inflation),
    )


def estimate(kind: int, nominal: Array, mean: Array, covariance: Array) -> Estimate:
    """Turns axis states (..., 3, 2) and covariances (..., 3, 3) into an estimate."""
    s = mean[..., 1]
    if kind == laws.PARAMETRISATIONS["p"]:
        rho, slope = s, np.ones_like(s)
    elif kind == laws.PARAMETRISATIONS["1/p"]:
        rho, slope = 1 / s, 1 / s**2
    else:
        rho, slope = np.exp(s), np.exp(s)
    return Estimate(
        velocity=mean[..., 0],
        velocity_sd=np.sqrt(covariance[..., 0]),
        parameters=rho * nominal,
        parameters_sd=np.sqrt(covariance[..., 2]) * slope * nominal,
    )


def check_drive(
    time: ArrayLike, deflections: ArrayLike, rates: ArrayLike, sample_time: float
) -> tuple[Array, Array]:
    """Returns deflections and rates as arrays, or says which channel or sample is wrong."""
    stamps = np.asarray(time, dtype=float)
    n = len(stamps)
    inputs = _channels(deflections, (n, _DEFLECTION_CHANNELS), "deflections")
    measured = _channels(rates, (n, _RATE_CHANNELS), "rates")
    wrong = np.flatnonzero(~(np.abs(np.diff(stamps) - sample_time) <= 0.01 * sample_time))
    if wrong.size:
        raise TwinError(
            f"Kalman-Bucy time: {stamps[wrong[0] + 1]} s follows {stamps[wrong[0]]} s; samples "
            f"must be {sample_time} s apart"
        )
    return inputs, measured


def _channels(values: ArrayLike, shape: tuple[int, ...], name: str) -> Array:
    array = np.ascontiguousarray(values, dtype=float)
    if array.shape != shape:
        raise TwinError(f"Kalman-Bucy {name}: shape {array.shape}, must be {shape}")
    if not np.isfinite(array).all():
        at = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise TwinError(f"Kalman-Bucy {name}: {array[at]} at index {at}, must be finite")
    return array


def _require(condition: bool, name: str, value: object, allowed: str) -> None:
    if not condition:
        raise TwinError(f"Kalman-Bucy {name}: {value}, must be {allowed}")
