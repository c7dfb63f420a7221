"""The joint observer: all parameters of a black box at once, with their covariance.

See `estimators.joint.kernel` for the method, and `JointSettings` for what can be chosen.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate
from estimators.black_box import settle
from estimators.drive_channels import check_measurements, given_by
from estimators.entry import Entry, Given
from estimators.joint import kernel as joint_kernel
from estimators.joint.state import RING, Log, Memory, Setup
from estimators.priors import OFFSETS, PRIOR_SD, initial_deltas
from twin import (
    LOAD,
    OUTPUTS,
    PARAMETERS,
    SCALES,
    Drive,
    Fleet,
    Snapshot,
    TwinError,
    Vehicle,
    check_inputs,
)

Array = NDArray[np.float64]

# What is estimated of the sensors: biases of the IMU, the delay of all signals, the IMU's position
# beside where the twin has it; and by how much the twins' speed is off. None of them needs a twin.
FAULTS = (*(f"bias_{name}" for name in OUTPUTS[:6]), "delay", "imu_x", "imu_y", "imu_z", "speed")
# A cheap IMU, mounted somewhere near, on a slow bus [m/s2, rad/s, s, m, m/s]
FAULT_SD = dict(
    zip(FAULTS, (0.1, 0.1, 0.1, 0.005, 0.005, 0.005, 0.01, 0.07, 0.07, 0.07, 0.1), strict=True)
)
SPEED_DRIFT = 0.0003  # of the twins' speed, what no parameter explains [m/s per root of a second]


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSettings:
    """What a joint observer estimates, and how.

    Attributes:
        parameters: of `twin.PARAMETERS`, one twin for each.
        faults: of `FAULTS`, what is estimated of the sensors along.
        prior_sd: by parameter, instead of `PRIOR_SD`.
        doubt: by which the noise's variance is first taken larger, until innovations prove white.
        doubt_memory: how fast that is seen [s].
        watch: seconds of driving after a standstill in which a change of the load is looked for.
        settle: seconds of driving before the first standstill at which the load can change.
        change_memory: how far back what contradicts the load is looked at [s].
        surprise: least statistic of a change: chi-square, one degree of freedom for each parameter
            of the load, as long as there is none and the model is right.
        least_change: of some parameter of the load, in its prior sd; less is no change of load.
        valid_share: of its prior sd that an estimate's sd has to be below to count as valid.
        drift: share of its prior sd that a parameter may wander over a second.
        step: largest share of its prior sd by which an estimate moves in a block.
        follow_time: by which the twins follow the estimates [s]: slower than the car's own modes.
        curvature: variance of the error of a sensitivity over its square, once the parameters are
            uncertain by their prior sd in one of them. Above one, as it lasts for many blocks.
        speed_curvature: the same of the sensitivity of the speed to a move of the twins.
        slip_range: share of its speed that a wheel's slip may be uncertain by. Beyond, the noise
            of its speed grows with the square of that.
        impact: least jump of the sensitivities from block to block that counts as an impact, in
            variances of the noise; what is usual of late is none.
        impact_wait: seconds after one in which nothing is corrected.
        hold_off: seconds before the first correction.
        block: samples per correction.
        speed_gain: draws each twin's speed to the measured wheel speeds [1/s].
        least_excitation: variance over a second below which nothing is learnt [m2/s4]: that of
            ax and ay, and 900 m2/s2 times that of roll and pitch rate.
    """

    parameters: tuple[str, ...] = (*LOAD, *SCALES)
    faults: tuple[str, ...] = FAULTS
    prior_sd: Mapping[str, float] = field(default_factory=dict)
    doubt: float = 3.0
    doubt_memory: float = 10.0
    watch: float = 20.0
    settle: float = 5.0
    change_memory: float = 2.0
    surprise: float = 200.0
    least_change: float = 0.15
    valid_share: float = 0.2
    drift: float = 0.0003
    step: float = 0.1
    follow_time: float = 0.4
    curvature: float = 1.5
    speed_curvature: float = 0.03
    slip_range: float = 1.6e-4
    impact: float = 0.3
    impact_wait: float = 0.2
    hold_off: float = 1.0
    block: int = 10
    speed_gain: float = 0.5
    least_excitation: float = 0.02


def _none() -> Any:
    raise TwinError("joint: an estimate needs sd and valid")


@dataclass(frozen=True, slots=True, kw_only=True)
class JointEstimate(Estimate):
    """A run of the joint observer.

    Attributes:
        prior: (p + b,) standard deviations before the first sample.
        sd: (N, p + b) standard deviation of each of `estimated`.
        valid: (N, p + b) whether it is identified.
        changes: (N,) changes of the load that were found until then.
        covariance: (p + b, p + b) at the end.
        information: (p + b, p + b) Fisher's, of all that was used.
    """

    prior: Array
    sd: Array = field(default_factory=_none)  # narrows the type
    valid: NDArray[np.bool_] = field(default_factory=_none)
    changes: NDArray[np.int64]
    covariance: Array
    information: Array


class JointSnapshot(NamedTuple):
    """Everything that decides a joint observer's future."""

    twins: tuple[Snapshot, ...]
    memory: Memory


class JointObserver:
    """Estimates parameters of a black box jointly, by twins that differ in one each.

    Args:
        vehicle: of the twins.
        noise_sd: (10,) standard deviation of a sample's white noise by channel; NaN: not used.
        settings: what is estimated, and how.

    Raises:
        TwinError: a name is unknown or given twice, or a number is out of range.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        noise_sd: ArrayLike,
        settings: JointSettings = JointSettings(),
    ) -> None:
        self.settings = settings
        names = settings.parameters
        _check(settings, np.asarray(noise_sd, dtype=np.float64))
        self.fleet = Fleet(vehicle, len(names) + 1)
        self.estimated = (*names, *settings.faults)
        prior = PRIOR_SD | dict(settings.prior_sd)
        self._prior = np.array(
            [prior[name] for name in names] + [FAULT_SD[name] for name in settings.faults]
        )
        drift = settings.drift * self._prior
        if "speed" in settings.faults:
            drift[self.estimated.index("speed")] = SPEED_DRIFT
        first = self.fleet.twins[0]
        self.dt = first.dt
        self._setup = Setup(
            parameter=np.array([PARAMETERS.index(name) for name in names], dtype=np.int64),
            offset=np.array([OFFSETS[name] for name in names]),
            fault=np.array([FAULTS.index(name) for name in settings.faults], dtype=np.int64),
            follow_time=settings.follow_time,
            curvature=settings.curvature,
            speed_curvature=settings.speed_curvature,
            slip_range=settings.slip_range,
            impact=settings.impact,
            impact_wait=settings.impact_wait,
            step_limit=settings.step * self._prior,
            drift=drift**2,
            noise=np.asarray(noise_sd, dtype=np.float64) ** 2,
            nominal=first.car.nominal.copy(),
            block=settings.block,
            hold_off=round(settings.hold_off / (settings.block * self.dt)),
            speed_gain=settings.speed_gain,
            least_excitation=settings.least_excitation,
            rate_weight=900.0,
            memory=1.0,
            doubt=settings.doubt,
            doubt_memory=settings.doubt_memory,
            prior=self._prior.copy(),
            load=np.array([i for i, n in enumerate(names) if n in LOAD], dtype=np.int64),
            watch=round(settings.watch / (settings.block * self.dt)),
            settle=round(settings.settle / (settings.block * self.dt)),
            change_memory=settings.change_memory,
            surprise=settings.surprise,
            least_change=settings.least_change,
            dt=self.dt,
        )
        n, p, q = len(self.fleet), len(PARAMETERS), self._prior.size
        ny, nx = len(OUTPUTS), len(first.states)
        self._memory = Memory(
            theta=np.zeros(p), estimate=np.zeros(p), z=np.zeros(q), covariance=np.zeros((q, q)),
            out=np.zeros((n, ny)), total=np.zeros((n, ny)), measured=np.zeros(ny),
            present=np.zeros(ny), states=np.zeros((n, nx)), dx=np.zeros(nx), p=np.zeros(p),
            rate=np.zeros(len(names)), went=np.zeros(len(names)),
            usual=np.zeros((ny, len(names))), before=np.zeros((ny, q)),
            excitation=np.zeros((2, 4)),
            information=np.zeros((q, q)), clock=np.zeros(3, dtype=np.int64),
            ring=np.zeros((RING, n, ny)), late=np.zeros((n, ny)), edge=np.zeros(ny),
            doubt=np.zeros(ny), window=np.zeros((3, ny)), window_h=np.zeros((ny, q)),
            recent=np.zeros((q, q)), score=np.zeros(q), kept=np.zeros(q),
            kept_covariance=np.zeros((q, q)), kept_doubt=np.zeros(ny),
            blocks=np.zeros(3, dtype=np.int64), changes=np.zeros(1, dtype=np.int64),
        )  # fmt: skip
        self.reset(0.0)

    def reset(
        self,
        speed: float,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """Starts anew: the twins settle at a speed, each with its own parameters.

        Args:
            speed: [m/s].
            parameters: initial deltas from the nominal values by name; zero where not given.
            road: (4,) height under each wheel [m]; zero if not given.
        """
        memory = self._memory
        for array in memory:
            array[:] = 0
        memory.theta[:] = initial_deltas(parameters)
        memory.estimate[:] = memory.theta
        memory.z[: self._setup.parameter.size] = memory.theta[self._setup.parameter]
        memory.covariance[:] = np.diag(self._prior**2)
        memory.doubt[:] = self.settings.doubt
        for i, twin in enumerate(self.fleet.twins):
            p = memory.theta.copy()
            if i > 0:
                p[self._setup.parameter[i - 1]] += self._setup.offset[i - 1]
            twin.set_parameters(p)
            settle(twin, speed, road)

    @property
    def covariance(self) -> Array:
        """(p + b, p + b) of `estimated`, now."""
        return self._memory.covariance.copy()

    def update(self, u: ArrayLike, y: ArrayLike) -> Array:
        """Takes one sample of inputs (13,) and measurements (10,); returns the parameters (15,).

        Raises:
            TwinError: a value is not finite or out of range, or a twin has blown up.
        """
        u = np.ascontiguousarray(u, dtype=np.float64)
        y = np.ascontiguousarray(y, dtype=np.float64)
        check_inputs(u[None], "update")
        check_measurements(y[None], OUTPUTS, "update", infinite=False)
        joint_kernel.update(self.fleet.cars, self._setup, self._memory, u, y)
        for twin in self.fleet.twins:
            twin.check()
        return self._memory.estimate.copy()

    def snapshot(self) -> JointSnapshot:
        """Everything that decides the future; a run from it is bit-exact."""
        return JointSnapshot(
            tuple(twin.snapshot() for twin in self.fleet.twins),
            self._memory._replace(
                **{name: array.copy() for name, array in self._memory._asdict().items()}
            ),
        )

    def restore(self, snapshot: JointSnapshot) -> None:
        """Goes back to a snapshot of an observer with the same settings and vehicle.

        Raises:
            TwinError: it estimates something else.
        """
        if snapshot.memory.out.shape != self._memory.out.shape or (
            snapshot.memory.z.shape != self._memory.z.shape
        ):
            raise TwinError(
                f"joint: the snapshot has {snapshot.memory.z.size} estimates of "
                f"{len(snapshot.twins)} twins; allowed: {self._memory.z.size} of {len(self.fleet)}"
            )
        for twin, kept in zip(self.fleet.twins, snapshot.twins, strict=True):
            twin.restore(kept)
        for array, kept in zip(self._memory, snapshot.memory, strict=True):
            array[:] = kept

    def run(self, drive: Drive) -> JointEstimate:
        """Observes a whole drive, from the state that the observer is in.

        Raises:
            TwinError: the drive does not fit the twins, or a twin has blown up.
        """
        twin = self.fleet.twins[0]
        given = given_by(drive, twin, None)
        check_measurements(given.measurements, OUTPUTS, "drive", infinite=False)
        check_inputs(given.inputs, "drive")
        n, q = len(drive), self._prior.size
        log = Log(
            states=np.empty((n, len(twin.states))),
            parameters=np.empty((n, len(PARAMETERS))),
            outputs=np.empty((n, len(OUTPUTS))),
            extended=np.empty((n, *twin.car.tyre_output.shape)),
            sd=np.empty((n, q)),
            faults=np.empty((n, q - self._setup.parameter.size)),
            changes=np.empty(n, dtype=np.int64),
        )
        done = joint_kernel.run(
            self.fleet.cars, self._setup, self._memory, given.inputs, given.measurements, log
        )
        if done < n:
            raise TwinError(f"drive: a twin blew up at t = {drive.time[done]:.3f} s")
        return JointEstimate(
            time=drive.time,
            states=log.states,
            parameters=log.parameters,
            outputs=log.outputs,
            extended=log.extended.reshape(n, -1),
            nominal=self._setup.nominal.copy(),
            estimated=self.estimated,
            sensor_error_names=self.settings.faults,
            prior=self._prior.copy(),
            sd=log.sd,
            valid=log.sd < self.settings.valid_share * self._prior,
            changes=log.changes,
            sensor_errors=log.faults,
            covariance=self._memory.covariance.copy(),
            information=self._memory.information.copy(),
        )


def _check(settings: JointSettings, noise_sd: Array) -> None:
    for name in ("follow_time", "slip_range", "doubt_memory", "change_memory"):
        if not 0.0 < (value := getattr(settings, name)) < np.inf:
            raise TwinError(f"joint: {name} is {value}; allowed: a finite number above zero")
    unknown = [name for name in settings.parameters if name not in PRIOR_SD]
    if unknown or len(set(settings.parameters)) < len(settings.parameters):
        raise TwinError(
            f"joint: parameters are {', '.join(settings.parameters)}; allowed: each at most once "
            f"of {', '.join(PRIOR_SD)}"
        )
    if not set(settings.faults) <= set(FAULTS) or len(set(settings.faults)) < len(settings.faults):
        raise TwinError(
            f"joint: faults are {', '.join(settings.faults)}; allowed: each at most once of "
            f"{', '.join(FAULTS)}"
        )
    if noise_sd.shape != (len(OUTPUTS),) or not (np.isnan(noise_sd) | (noise_sd > 0.0)).all():
        raise TwinError(
            f"joint: noise_sd is {noise_sd.tolist()}; allowed: {len(OUTPUTS)} numbers above zero, "
            "NaN for a channel that is not used"
        )


def _make(given: Given) -> JointObserver:
    settings = given.settings or JointSettings()
    if given.parameters is not None:
        settings = replace(settings, parameters=given.parameters)
    if given.prior_sd:
        settings = replace(settings, prior_sd={**settings.prior_sd, **given.prior_sd})
    return JointObserver(given.car(), given.noise(OUTPUTS), settings)


ENTRY = Entry(
    name="joint",
    words="a Kalman filter over all parameters at once, by twins that differ in one each",
    make=_make,
    needs=frozenset(("twin", "noise_sd")),
    channels=OUTPUTS,
    gives=(*LOAD, *SCALES, *FAULTS, "sideslip"),
    sd=True,
    online=True,
)
