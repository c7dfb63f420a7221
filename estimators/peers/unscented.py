"""An unscented Kalman filter over the parameters of a black box: its twins are the sigma points.

It looks twice as often as the joint observer, to both sides and as far as the estimate is uncertain
by. See `estimators.peers.unscented_kernel` for the method. Of the sensors it estimates the biases
of the IMU along.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.ensemble.blocks import new_block
from estimators.joint.observer import PRIOR_SD
from estimators.parameter_estimate import ParameterEstimate
from estimators.peers import unscented_kernel
from estimators.peers.unscented_kernel import Log, Memory, Setup
from twin import (
    LOAD,
    OUTPUTS,
    PARAMETERS,
    SCALES,
    STATES,
    Drive,
    Fleet,
    TwinError,
    Vehicle,
    check_inputs,
)

Array = NDArray[np.float64]

# Of a cheap IMU [m/s2, rad/s]
BIAS_SD = (0.1, 0.1, 0.1, 0.005, 0.005, 0.005)
# By which the noise's variance is taken larger than it is, for what the regression leaves out
NOISE_FACTOR = 1.5
DRIFT = 0.001  # share of its prior sd that an estimate may wander over a second
STEP = 0.1  # largest share of its prior sd by which an estimate moves in a block
HOLD_OFF = 1.0  # s before the first correction, in which the sigma points' twins come apart
BLOCK = 10  # samples per correction
SPEED_GAIN = 0.5  # 1/s, draws each twin's speed to the measured wheel speeds
LEAST_EXCITATION = 0.02  # m2/s4, variance over a second below which nothing is learnt


def unscented(
    vehicle: Vehicle,
    drive: Drive,
    noise_sd: ArrayLike,
    parameters: Sequence[str] = (*LOAD, *SCALES),
    *,
    speed: float,
) -> ParameterEstimate:
    """Estimates p parameters over a whole drive by 2p + 1 twins.

    Args:
        vehicle: of the twins.
        drive: of N samples.
        noise_sd: (10,) standard deviation of a sample's white noise by channel; NaN: not used.
        parameters: of `twin.PARAMETERS`; the others stay nominal.
        speed: at the start [m/s].

    Raises:
        TwinError: a name is unknown or given twice, the drive does not fit the twins, or a twin has
            blown up.
    """
    if not set(parameters) <= set(PARAMETERS) or len(set(parameters)) < len(parameters):
        raise TwinError(
            f"unscented: parameters are {', '.join(parameters)}; allowed: each at most once of "
            f"{', '.join(PARAMETERS)}"
        )
    check_inputs(drive.inputs, "drive")
    fleet = Fleet(vehicle, 2 * len(parameters) + 1)
    setup = _setup(fleet, parameters, np.asarray(noise_sd, dtype=np.float64))
    memory = _memory(setup)
    unscented_kernel.place(fleet.cars, setup, memory)
    for twin in fleet.twins:
        twin.reset(speed, drive.inputs[0, 9:13])
    n = len(drive)
    log = Log(
        states=np.empty((n, len(STATES))),
        parameters=np.empty((n, len(PARAMETERS))),
        outputs=np.empty((n, len(OUTPUTS))),
        extended=np.empty((n, *fleet.cars[0].tyre_output.shape)),
        sd=np.empty((n, len(parameters))),
    )
    done = unscented_kernel.run(
        fleet.cars, setup, memory, new_block(len(fleet)), drive.inputs, drive.measurements, log
    )
    if done < n:
        raise TwinError(f"drive: a twin blew up at t = {drive.time[done]:.3f} s")
    return ParameterEstimate(
        time=drive.time,
        states=log.states,
        parameters=log.parameters,
        outputs=log.outputs,
        extended=log.extended.reshape(n, -1),
        nominal=setup.nominal,
        estimated=tuple(parameters),
        sd=log.sd,
    )


def _setup(fleet: Fleet, parameters: Sequence[str], noise_sd: Array) -> Setup:
    prior = np.array([*(PRIOR_SD[name] for name in parameters), *BIAS_SD])
    twin = fleet.twins[0]
    return Setup(
        column=np.array([PARAMETERS.index(name) for name in parameters], dtype=np.int64),
        prior=prior,
        step_limit=STEP * prior,
        drift=(DRIFT * prior) ** 2,
        noise=NOISE_FACTOR * noise_sd**2,
        nominal=twin.car.nominal.copy(),
        block=BLOCK,
        hold_off=round(HOLD_OFF / (BLOCK * twin.dt)),
        speed_gain=SPEED_GAIN,
        least_excitation=LEAST_EXCITATION,
        dt=twin.dt,
    )


def _memory(setup: Setup) -> Memory:
    p, q = setup.column.size, setup.prior.size
    return Memory(
        theta=np.zeros(len(PARAMETERS)),
        z=np.zeros(q),
        covariance=np.diag(setup.prior**2),
        root=np.zeros((p, p)),
        white=np.zeros((2 * p, p)),
        states=np.zeros((2 * p + 1, len(STATES))),
        excitation=np.zeros((2, 4)),
        clock=np.zeros(1, dtype=np.int64),
    )
