"""An unscented Kalman filter over the parameters of a black box: its twins are the sigma points.

It has twice as many twins as the joint observer, on both sides of the estimate and as far away as
it is uncertain: see `estimators.ensemble.unscented_kernel`. Biases of the IMU are estimated along.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate
from estimators.ensemble import unscented_kernel
from estimators.ensemble.blocks import new_block
from estimators.ensemble.twins import EXTENDED_SHAPE, Source, Twins, parameters_of
from estimators.ensemble.unscented_kernel import Log, Memory, Setup
from estimators.entry import Entry, Given
from estimators.priors import initial_deltas, prior_sds
from twin import (
    CHANNEL,
    IMU,
    LOAD,
    OUTPUTS,
    PARAMETERS,
    SCALES,
    STATES,
    Drive,
)

Array = NDArray[np.float64]

BIAS_SD = tuple(CHANNEL[name].bias_sd for name in OUTPUTS[IMU])
# By which the noise's variance is taken larger than it is, for what the regression leaves out
NOISE_FACTOR = 1.5
DRIFT = 0.001  # share of its prior sd that an estimate may wander over a second
STEP = 0.1  # largest share of its prior sd by which an estimate moves in a block
HOLD_OFF = 1.0  # s before the first correction, in which the sigma points' twins come apart
BLOCK = 10  # samples per correction
SPEED_GAIN = 0.5  # 1/s, draws each twin's speed to the measured wheel speeds
LEAST_EXCITATION = 0.02  # m2/s4, variance over a second below which nothing is learnt


class UnscentedObserver:
    """Estimates p parameters by 2p + 1 twins.

    Args:
        source: of the twins: a vehicle, or what makes a black box, called once for each.
        noise_sd: (10,) standard deviation of a sample's white noise by channel; NaN: not used.
        parameters: of `twin.PARAMETERS`; the others stay nominal.
        prior_sd: by parameter, instead of that of its record.

    Raises:
        TwinError: a name is unknown or given twice.
    """

    def __init__(
        self,
        source: Source,
        noise_sd: ArrayLike,
        parameters: Sequence[str] = (*LOAD, *SCALES),
        prior_sd: Mapping[str, float] | None = None,
    ) -> None:
        self.estimated = tuple(parameters)
        self.ensemble = Twins(source, 2 * len(parameters) + 1)
        self.ensemble.require("unscented", parameters)
        noise = self.ensemble.used(noise_sd, "unscented")
        self._setup = _setup(self.ensemble, parameters, noise, prior_sds(parameters, prior_sd))

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return self.ensemble.dt

    def reset(
        self,
        speed: float,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """See `estimators.base.Estimator`."""
        self._memory = _memory(self._setup, initial_deltas(parameters))
        unscented_kernel.place(self.ensemble.cars, self._setup, self._memory)
        self.ensemble.settle(speed, road)

    def run(self, drive: Drive) -> Estimate:
        """Observes a whole drive.

        Raises:
            TwinError: the drive does not fit the twins, or a twin has blown up.
        """
        inputs, measurements = self.ensemble.given_by(drive)
        ensemble, n = self.ensemble, len(drive)
        log = Log(
            states=np.empty((n, len(STATES))),
            parameters=np.empty((n, len(PARAMETERS))),
            outputs=np.empty((n, len(OUTPUTS))),
            extended=np.empty((n, *EXTENDED_SHAPE)),
            sd=np.empty((n, len(self.estimated))),
        )
        done = unscented_kernel.run(
            ensemble.cars, self._setup, self._memory, new_block(len(ensemble)), inputs,
            measurements, log,
        )  # fmt: skip
        if done < n:
            raise ensemble.blown_up(drive.time[done])
        return Estimate(
            time=drive.time,
            **ensemble.histories(log.states, log.parameters, log.outputs, log.extended),
            estimated=self.estimated,
            sd=log.sd,
        )


def _setup(
    ensemble: Twins, parameters: Sequence[str], noise_sd: Array, prior_sd: Mapping[str, float]
) -> Setup:
    prior = np.array([*(prior_sd[name] for name in parameters), *BIAS_SD])
    return Setup(
        column=np.array([PARAMETERS.index(name) for name in parameters], dtype=np.int64),
        prior=prior,
        step_limit=STEP * prior,
        drift=(DRIFT * prior) ** 2,
        noise=NOISE_FACTOR * noise_sd**2,
        nominal=ensemble.nominal.copy(),
        block=BLOCK,
        hold_off=round(HOLD_OFF / (BLOCK * ensemble.dt)),
        speed_gain=SPEED_GAIN,
        least_excitation=LEAST_EXCITATION,
        dt=ensemble.dt,
    )


def _memory(setup: Setup, theta: Array) -> Memory:
    p, q = setup.column.size, setup.prior.size
    return Memory(
        theta=theta,
        z=np.append(theta[setup.column], np.zeros(q - p)),
        covariance=np.diag(setup.prior**2),
        root=np.zeros((p, p)),
        white=np.zeros((2 * p, p)),
        states=np.zeros((2 * p + 1, len(STATES))),
        excitation=np.zeros((2, 4)),
        clock=np.zeros(1, dtype=np.int64),
    )


def _make(given: Given) -> UnscentedObserver:
    source = given.source()
    parameters = given.parameters or parameters_of(source, (*LOAD, *SCALES))
    return UnscentedObserver(source, given.noise(OUTPUTS), parameters, given.prior_sd)


ENTRY = Entry(
    name="unscented",
    words="an unscented Kalman filter over the parameters, its twins the sigma points",
    make=_make,
    needs=frozenset(("twin", "noise_sd")),
    channels=OUTPUTS,
    gives=(*LOAD, *SCALES, "sideslip"),
    sd=True,
)
