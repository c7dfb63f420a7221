"""Kalman-Bucy filter for mass, roll and pitch inertia of a truck, KBF with its Jacobian mended.

As printed, KBF Eq. (9) never moves its parameters: see `estimators.benchmarks.kalman_bucy_ode`.
Here the parameter enters the linearisation, the 6x6 filter falls into three 2x2 ones, and each
sample is a continuous-discrete Kalman step: R / dt as the variance of a sample, the force averaged
over it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate
from estimators.benchmarks import kalman_bucy_laws as laws
from estimators.entry import Entry, Given
from estimators.priors import initial_deltas
from twin import WHEELS, Drive, TruckParameters, TruckTwin, TwinError

Array = NDArray[np.float64]

LONGEST_SAMPLE_TIME = 0.02  # four samples in a period of the wheel hop (12 Hz) [s]
# Measured channels: velocities of the chassis, y_02 of KBF Eq. (8), and the suspensions'
# deflections [m] and their rates [m/s], u_02
RATES = TruckTwin.outputs
DEFLECTIONS = tuple(f"{kind}_{w}" for kind in ("deflection", "deflection_rate") for w in WHEELS)
CHANNELS = (*RATES, *DEFLECTIONS)


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
        gravity: [m/s2]; 0 is the paper's model. Otherwise deflections are counted from the rest at
            the nominal load, and the filter weighs the load: dv/dt = F / m - g.
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
    gravity: float = 0.0

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
        for name in ("velocity_density", "parameter_density", "inflation", "gravity"):
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


class KalmanBucy:
    """The filter, sample by sample or over a drive: the same compiled step.

    Args:
        truck: geometry, springs, dampers and nominal load that the filter assumes.
        sample_time: [s], above 0 and at most 0.02.
        settings: tuning.

    Raises:
        TwinError: the sample time is too long.
    """

    def __init__(
        self,
        truck: TruckParameters,
        sample_time: float,
        settings: KalmanBucySettings | None = None,
    ) -> None:
        _require(
            0 < sample_time <= LONGEST_SAMPLE_TIME,
            "sample_time",
            sample_time,
            f"above 0 and at most {LONGEST_SAMPLE_TIME} s, or wheel hop is missed",
        )
        self.dt = sample_time
        self.settings = settings or KalmanBucySettings()
        self.nominal = truck.nominal.parameters
        self.law = compile_law(truck, sample_time, self.settings)
        self._default_start = self.law.start.copy()
        self.state = laws.State(
            mean=np.zeros((3, 2)),
            covariance=np.zeros((3, 3)),
            force=np.zeros(3),
            innovations=np.zeros((3, self.settings.window)),
            samples=np.zeros(1, dtype=np.int64),
        )

    def reset(
        self,
        speed: float = 0.0,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """Forgets all samples; the next one is the first.

        Args:
            speed: not used.
            parameters: deltas of the start from nominal; those of the settings if not given.
            road: not used.
        """
        self.state.samples[0] = 0
        self.law.start[:] = self._default_start
        if parameters is not None:
            deltas = initial_deltas(parameters, TruckTwin.parameters)
            self.law.start[:] = 1.0 + deltas / self.nominal

    def update(self, u: ArrayLike, y: ArrayLike) -> Array:
        """Takes one sample; returns the parameters' deltas from nominal (3,).

        Args:
            u: not used.
            y: measurements in the order of `CHANNELS`. Shape (11,).

        Raises:
            TwinError: a channel is missing or not finite.
        """
        measured = _checked(y, (len(CHANNELS),), CHANNELS)
        rates, deflections = measured[: len(RATES)], measured[len(RATES) :]
        laws.step(self.law, self.state, deflections, rates)
        rho, _ = _relative(self.law.kind, self.state.mean)
        return (rho - 1.0) * self.nominal

    def run(self, drive: Drive) -> Estimate:
        """Takes all samples of a drive with `CHANNELS`; the first is the start.

        Raises:
            TwinError: a channel or a sample is missing, or a value is not finite.
        """
        inputs, measured = channels(drive, self.law.sample_time)
        self.state.samples[0] = 0
        n = len(measured)
        means, covariances = np.empty((n, 3, 2)), np.empty((n, 3, 3))
        laws.steps(self.law, self.state, inputs, measured, means, covariances)
        return estimate(self.law.kind, self.nominal, drive.time, means, covariances)


def compile_law(
    truck: TruckParameters, sample_time: float, settings: KalmanBucySettings
) -> laws.Law:
    """Puts truck and settings into the constants of the compiled step.

    Args:
        truck: what the filter assumes.
        sample_time: [s].
        settings: tuning.
    """
    kind = laws.PARAMETRISATIONS[settings.parametrisation]
    start = np.asarray(settings.start, dtype=float)
    slope = np.array([laws.from_state(kind, laws.to_state(kind, rho))[1] for rho in start])
    low, high = sorted(laws.to_state(kind, bound) for bound in settings.bounds)
    weight = np.array([settings.gravity, 0.0, 0.0])
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


def _relative(kind: int, mean: Array) -> tuple[Array, Array]:
    """Parameters over their nominal values (..., 3) and their slope over the axis states."""
    s = mean[..., 1]
    if kind == laws.PARAMETRISATIONS["p"]:
        return s, np.ones_like(s)
    if kind == laws.PARAMETRISATIONS["1/p"]:
        return 1 / s, 1 / s**2
    return np.exp(s), np.exp(s)


def estimate(kind: int, nominal: Array, time: Array, mean: Array, covariance: Array) -> Estimate:
    """Turns axis states and their covariances into an estimate.

    Args:
        kind: of `laws.PARAMETRISATIONS`.
        nominal: (3,) mass [kg], roll and pitch inertia [kg m2].
        time: (n,) [s].
        mean: (n, 3, 2) velocity and parameter of each axis.
        covariance: (n, 3, 3) variance, covariance, variance of each axis.
    """
    rho, slope = _relative(kind, mean)
    return Estimate(
        time=time,
        states=mean[..., 0],
        parameters=rho * nominal - nominal,
        outputs=mean[..., 0],
        extended=np.empty((time.size, 0)),
        nominal=nominal,
        state_names=RATES,
        parameter_names=TruckTwin.parameters,
        output_names=RATES,
        extended_names=(),
        estimated=TruckTwin.parameters,
        sd=np.sqrt(covariance[..., 2]) * slope * nominal,
        states_sd=np.sqrt(covariance[..., 0]),
    )


def channels(drive: Drive, sample_time: float) -> tuple[Array, Array]:
    """Deflections (n, 8) and rates (n, 3) of a drive.

    Args:
        drive: with `CHANNELS`.
        sample_time: that the filter was made for [s].

    Raises:
        TwinError: a channel or a sample is missing, or a value is not finite.
    """
    deflections, rates = (
        _checked(np.column_stack([drive.channel(name) for name in names]), None, names)
        for names in (DEFLECTIONS, RATES)
    )
    wrong = np.flatnonzero(~(np.abs(np.diff(drive.time) - sample_time) <= 0.01 * sample_time))
    if wrong.size:
        raise TwinError(
            f"Kalman-Bucy time: {drive.time[wrong[0] + 1]} s follows {drive.time[wrong[0]]} s; "
            f"samples must be {sample_time} s apart"
        )
    return deflections, rates


def _checked(values: ArrayLike, shape: tuple[int, ...] | None, names: tuple[str, ...]) -> Array:
    array = np.ascontiguousarray(values, dtype=float)
    if shape is not None and array.shape != shape:
        raise TwinError(f"Kalman-Bucy measurements: shape {array.shape}, must be {shape}")
    if not np.isfinite(array).all():
        *row, column = np.argwhere(~np.isfinite(array))[0].tolist()
        where = f" in sample {row[0]}" if row else ""
        raise TwinError(
            f"Kalman-Bucy {names[column]}: {array[(*row, column)]}{where}, must be finite"
        )
    return array


def _require(condition: bool, name: str, value: object, allowed: str) -> None:
    if not condition:
        raise TwinError(f"Kalman-Bucy {name}: {value}, must be {allowed}")


def _filter(given: Given, settings: Callable[[Given], KalmanBucySettings]) -> KalmanBucy:
    if given.dt is None:
        raise TwinError("Kalman-Bucy: has no sample time; allowed: with dt")
    return KalmanBucy(given.model, given.dt, given.settings or settings(given))


def _matched(given: Given) -> KalmanBucySettings:
    sd = given.noise(RATES)
    return matched((sd[0], sd[1], sd[2]), given.dt or 0.0)


def _entry(
    name: str, words: str, settings: Callable[[Given], KalmanBucySettings], *needs: str
) -> Entry:
    return Entry(
        name=name,
        words=words,
        make=partial(_filter, settings=settings),
        needs=frozenset(("model", "dt", *needs)),
        channels=CHANNELS,
        gives=(*TruckTwin.parameters, *RATES),
        sd=True,
        online=True,
    )


_PAPER = "the Kalman-Bucy filter of the truck with the paper's noise"
_MATCHED = "the Kalman-Bucy filter of the truck with the sensors' noise"
ENTRIES = (
    _entry("kalman-bucy", _PAPER, lambda _: KalmanBucySettings()),
    _entry(
        "kalman-bucy-p",
        f"{_PAPER}, p as its state",
        lambda _: KalmanBucySettings(parametrisation="p"),
    ),
    _entry(
        "kalman-bucy-log",
        f"{_PAPER}, log p as its state",
        lambda _: KalmanBucySettings(parametrisation="log p"),
    ),
    _entry("kalman-bucy-matched", _MATCHED, _matched, "noise_sd"),
    _entry(
        "kalman-bucy-detecting",
        f"{_MATCHED}, detecting load changes",
        lambda given: detecting(_matched(given)),
        "noise_sd",
    ),
    _entry(
        "kalman-bucy-sharp",
        f"{_MATCHED}, detecting load changes without room for model error",
        lambda given: detecting(_matched(given), robust=False),
        "noise_sd",
    ),
)
