"""One parameter after the other: the flow of TiL Section 4.5 and Fig. 12.

A state machine orders the single laws: mass on straights, then pitch inertia on straights, then the
centre of mass, then roll and yaw inertia in bends. Each stage lasts for a time of its own kind of
driving; thresholds on the yaw rate tell straights from bends.

The paper leaves the law of the CM to others. Ours is a recursive least-squares fit of static and
quasi-static load transfer against the twin's: the residuals of the accelerations in the plane and
of the three rates, through a low pass below which the car is in balance, are regressed on what the
same low-passed outputs of three twins, each with its CM a little off, differ by. A CM off its place
tilts the car at rest and tilts it further under braking and cornering, which the accelerometers see
as gravity, and changes how it answers the steering. Constant offsets of the sensors are fitted
along. The fit runs only under load, braking or cornering: at rest a tilt of the car and an offset
of its sensor are one and the same.

Nothing that is wrong in an earlier stage, or in the products of inertia, which have no law, is
repaired in a later one: that is what joint estimation is for.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.ensemble.blocks import new_block
from estimators.joint.observer import PRIOR_SD
from estimators.parameter_estimate import ParameterEstimate
from estimators.peers import staged_kernel
from estimators.peers.staged_kernel import Log, Memory, Setup
from estimators.peers.unscented import BIAS_SD, BLOCK, SPEED_GAIN, STEP
from estimators.til.law import ParameterLaw, compile_laws
from twin import OUTPUTS, PARAMETERS, STATES, Drive, Fleet, TwinError, Vehicle, check_inputs

Array = NDArray[np.float64]

CM = ("cm_x", "cm_y", "cm_z")
QUASI_STATIC = ("ax", "ay", "roll_rate", "pitch_rate", "yaw_rate")
PRIOR = np.array([*(PRIOR_SD[name] for name in CM), *BIAS_SD])
# Of the yaw rate's low pass [s]; chosen: passes a driver's steering, leaves a tenth of the noise
YAW_FILTER = 0.1
LEAST_WHEEL_SPEED = 3.0  # rad/s, 1 m/s, as in the mass law


class Stage(IntEnum):
    """What is estimated."""

    MASS = staged_kernel.MASS
    PITCH = staged_kernel.PITCH
    CM = staged_kernel.CM
    ROLL_YAW = staged_kernel.ROLL_YAW


@dataclass(frozen=True, slots=True, kw_only=True)
class StagedSettings:
    """When which stage runs. All chosen, on drives of other seeds than are reported.

    Attributes:
        mass_seconds: of straight driving, before the pitch inertia's turn.
        pitch_seconds: of straight driving, before that of the CM.
        cm_seconds: of braking and cornering, before that of roll and yaw inertia.
        straight: largest yaw rate of straight driving [rad/s].
        loaded: least low-passed acceleration in the plane of braking and cornering [m/s2].
        corner: of the quasi-static range [Hz].
    """

    mass_seconds: float = 5.0
    pitch_seconds: float = 5.0
    cm_seconds: float = 15.0
    straight: float = 0.05
    loaded: float = 1.0
    corner: float = 0.5

    def __post_init__(self) -> None:
        """Checks the numbers."""
        for name in self.__slots__:
            if not 0.0 < getattr(self, name) < np.inf:
                raise TwinError(f"staged: {name} is {getattr(self, name)}; allowed: more than 0")


@dataclass(frozen=True, slots=True, kw_only=True)
class StagedEstimate(ParameterEstimate):
    """A run of the staged observer; each fit claims its sd as if all else were right.

    Attributes:
        stage: (N,) of `Stage`.
    """

    stage: NDArray[np.int64]


def staged(
    vehicle: Vehicle,
    drive: Drive,
    noise_sd: ArrayLike,
    laws: Sequence[ParameterLaw],
    settings: StagedSettings = StagedSettings(),
    *,
    speed: float,
) -> StagedEstimate:
    """Observes a whole drive, one stage after the other.

    Args:
        vehicle: of the twins.
        drive: of N samples.
        noise_sd: (10,) standard deviation of a sample's white noise by channel; NaN: not used.
        laws: one each of mass, Jyy, Jxx and Jzz.
        settings: when which stage runs.
        speed: at the start [m/s].

    Raises:
        TwinError: there are other laws, the drive does not fit the twins, or a twin blew up.
    """
    named = tuple(law.parameter for law in laws)
    if sorted(named) != ["Jxx", "Jyy", "Jzz", "mass"]:
        raise TwinError(f"staged: laws are of {', '.join(named)}; allowed: mass, Jxx, Jyy, Jzz")
    check_inputs(drive.inputs, "drive")
    fleet, n = Fleet(vehicle, 1 + len(CM)), len(drive)
    setup = _setup(settings, np.asarray(noise_sd, dtype=np.float64), fleet.twins[0].dt)
    table, law_memory = compile_laws(laws, setup.dt)
    memory = _memory(law_memory)
    staged_kernel.set_all(fleet.cars, memory.theta)
    for twin in fleet.twins:
        twin.reset(speed, drive.inputs[0, 9:13])
    log = Log(
        states=np.empty((n, len(STATES))),
        parameters=np.empty((n, len(PARAMETERS))),
        outputs=np.empty((n, len(OUTPUTS))),
        extended=np.empty((n, *fleet.cars[0].tyre_output.shape)),
        stage=np.empty(n, dtype=np.int64),
        sd=np.empty((n, len(laws) + len(CM))),
    )
    done = staged_kernel.run(
        fleet.cars, setup, memory, new_block(len(fleet)), table,
        drive.inputs, drive.measurements, log,
    )  # fmt: skip
    if done < n:
        raise TwinError(f"drive: a twin blew up at t = {drive.time[done]:.3f} s")
    return StagedEstimate(
        time=drive.time,
        states=log.states,
        parameters=log.parameters,
        outputs=log.outputs,
        extended=log.extended.reshape(n, -1),
        nominal=fleet.cars[0].nominal.copy(),
        stage=log.stage,
        estimated=(*named, *CM),
        sd=log.sd,
    )


def _setup(settings: StagedSettings, noise_sd: Array, dt: float) -> Setup:
    return Setup(
        seconds=np.array(
            [settings.mass_seconds, settings.pitch_seconds, settings.cm_seconds, np.inf]
        ),
        straight=settings.straight,
        yaw_filter=YAW_FILTER,
        loaded=settings.loaded,
        quasi_static=1.0 / (2.0 * np.pi * settings.corner),
        least_wheel_speed=LEAST_WHEEL_SPEED,
        noise=np.where(np.isin(OUTPUTS, QUASI_STATIC), noise_sd, np.nan) ** 2,
        step_limit=STEP * PRIOR,
        block=BLOCK,
        speed_gain=SPEED_GAIN,
        dt=dt,
    )


def _memory(laws: Array) -> Memory:
    return Memory(
        stage=np.zeros(1, dtype=np.int64),
        clock=np.zeros(len(Stage)),
        yaw_rate=np.zeros(1),
        theta=np.zeros(len(PARAMETERS)),
        laws=laws,
        z=np.zeros(PRIOR.size),
        covariance=np.diag(PRIOR**2),
        slow=np.zeros((2, 2 + len(CM), len(OUTPUTS))),
        begun=np.zeros(1, dtype=np.int64),
    )
