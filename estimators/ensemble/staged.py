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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate
from estimators.ensemble import staged_kernel
from estimators.ensemble.blocks import new_block
from estimators.ensemble.staged_kernel import Log, Memory, Setup
from estimators.ensemble.twins import EXTENDED_SHAPE, Source, Twins, parameters_of
from estimators.ensemble.unscented import BIAS_SD, BLOCK, SPEED_GAIN, STEP
from estimators.entry import Entry, Given
from estimators.priors import initial_deltas
from estimators.til.law import ParameterLaw, compile_laws
from twin import (
    OUTPUTS,
    PARAMETER,
    PARAMETERS,
    STATES,
    Drive,
    TwinError,
)

Array = NDArray[np.float64]

CM = ("cm_x", "cm_y", "cm_z")
QUASI_STATIC = ("ax", "ay", "roll_rate", "pitch_rate", "yaw_rate")
PRIOR = np.array([*(PARAMETER[name].prior_sd for name in CM), *BIAS_SD])
# Of the yaw rate's low pass [s]; chosen: passes a driver's steering, leaves a tenth of the noise
YAW_FILTER = 0.1
_NONE = 1e-9  # s, of a stage that has nothing to estimate
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
class StagedEstimate(Estimate):
    """A run of the staged observer; each fit claims its sd as if all else were right.

    Attributes:
        stage: (N,) of `Stage`.
    """

    stage: NDArray[np.int64]


class StagedObserver:
    """Estimates mass, pitch inertia, centre of mass, roll and yaw inertia one after the other.

    Args:
        source: of the twins: a vehicle, or what makes a black box, called once for each.
        noise_sd: (10,) standard deviation of a sample's white noise by channel; NaN: not used.
        laws: one each of mass, Jyy, Jxx and Jzz, as far as the twins have them.
        settings: when which stage runs.

    Raises:
        TwinError: there are other laws.
    """

    def __init__(
        self,
        source: Source,
        noise_sd: ArrayLike,
        laws: Sequence[ParameterLaw],
        settings: StagedSettings = StagedSettings(),
    ) -> None:
        named = tuple(law.parameter for law in laws)
        self.ensemble = Twins(source, 1 + len(CM))
        own = self.ensemble.parameters
        if sorted(named) != [name for name in ("Jxx", "Jyy", "Jzz", "mass") if name in own]:
            raise TwinError(f"staged: laws are of {', '.join(named)}; allowed: mass, Jxx, Jyy, Jzz")
        # of a black box whose CM cannot be moved, none is estimated
        self.estimated = (*named, *(CM if set(CM) <= set(own) else ()))
        if self.estimated == named:
            settings = replace(settings, cm_seconds=_NONE)
        noise = self.ensemble.used(noise_sd, "staged")
        self._setup = _setup(settings, noise, self.dt)
        self._laws = compile_laws(laws, self.dt)

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
        self._memory = _memory(self._laws[1].copy(), initial_deltas(parameters))
        staged_kernel.set_all(self.ensemble.cars, self._memory.theta)
        self.ensemble.settle(speed, road)

    def run(self, drive: Drive) -> StagedEstimate:
        """Observes a whole drive, one stage after the other.

        Raises:
            TwinError: the drive does not fit the twins, or a twin blew up.
        """
        inputs, measurements = self.ensemble.given_by(drive)
        ensemble, n = self.ensemble, len(drive)
        log = Log(
            states=np.empty((n, len(STATES))),
            parameters=np.empty((n, len(PARAMETERS))),
            outputs=np.empty((n, len(OUTPUTS))),
            extended=np.empty((n, *EXTENDED_SHAPE)),
            stage=np.empty(n, dtype=np.int64),
            sd=np.empty((n, self._laws[0].size + len(CM))),
        )
        done = staged_kernel.run(
            ensemble.cars, self._setup, self._memory, new_block(len(ensemble)), self._laws[0],
            inputs, measurements, log,
        )  # fmt: skip
        if done < n:
            raise ensemble.blown_up(drive.time[done])
        return StagedEstimate(
            time=drive.time,
            **ensemble.histories(log.states, log.parameters, log.outputs, log.extended),
            stage=log.stage,
            estimated=self.estimated,
            sd=log.sd[:, : len(self.estimated)],
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


def _memory(laws: Array, theta: Array) -> Memory:
    return Memory(
        stage=np.zeros(1, dtype=np.int64),
        clock=np.zeros(len(Stage)),
        yaw_rate=np.zeros(1),
        theta=theta,
        laws=laws,
        z=np.append([theta[PARAMETERS.index(name)] for name in CM], np.zeros(len(BIAS_SD))),
        covariance=np.diag(PRIOR**2),
        slow=np.zeros((2, 2 + len(CM), len(OUTPUTS))),
        begun=np.zeros(1, dtype=np.int64),
    )


def _make(given: Given) -> StagedObserver:
    settings = given.settings or StagedSettings()
    source = given.source()
    names = parameters_of(source, [law.parameter for law in given.laws])
    laws = [law for law in given.laws if law.parameter in names]
    return StagedObserver(source, given.noise(OUTPUTS), laws, settings)


ENTRY = Entry(
    name="staged",
    words="single laws one after the other, TiL Section 4.5",
    make=_make,
    needs=frozenset(("twin", "noise_sd", "laws")),
    channels=OUTPUTS,
    gives=("mass", "Jyy", *CM, "Jxx", "Jzz", "sideslip"),
    sd=True,
)
