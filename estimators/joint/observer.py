"""The joint observer: all parameters of a black box at once, with their covariance.

See `estimators.joint.kernel` for the method, and `JointSettings` for what can be chosen.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate
from estimators.drive_channels import check_measurements
from estimators.ensemble.twins import EXTENDED_SHAPE, Source, Twins, parameters_of
from estimators.entry import Entry, Given
from estimators.joint import kernel as joint_kernel
from estimators.joint.evidence import FILLED, FULL, SEGMENTS, USED, merge_segments
from estimators.joint.evidence import SCALES as WINDOWS
from estimators.joint.model_error import DIFFERS, budget
from estimators.joint.sensor_errors import SENSOR_ERROR, SENSOR_ERRORS
from estimators.joint.state import RING, Configuration, Log, State
from estimators.joint.validity import REASONS, judge
from estimators.priors import initial_deltas
from twin import (
    LOAD,
    OUTPUTS,
    PARAMETER,
    PARAMETERS,
    SCALES,
    STATES,
    Drive,
    Snapshot,
    TwinError,
    Vehicle,
)

Array = NDArray[np.float64]

# Settings and what they may be: the least, and whether that itself is allowed
_POSITIVE = (
    *("tracking_time", "slip_range", "inflation_time", "change_time", "step_limit"),
    *("valid_share", "impact", "segment"),
)
_NOT_NEGATIVE = (
    *("noise_inflation", "watch", "settle", "detection_threshold", "least_change", "drift"),
    *("curvature", "speed_curvature", "impact_wait", "hold_off", "speed_gain", "least_excitation"),
)
RATE_WEIGHT = 900.0  # of the variance of a roll or pitch rate in the excitation [m2/s2]; chosen
EXCITATION_TIME = 1.0  # over which the motion's variance is taken [s]; chosen


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSettings:
    """What a joint observer estimates, and how.

    Attributes:
        parameters: of `twin.PARAMETERS`, one twin for each.
        sensor_errors: of `SENSOR_ERRORS`, nuisance parameters that are estimated along.
        prior_sd: by parameter, instead of that of its record.
        noise_inflation: factor of the noise's variance before innovations have proved white.
        inflation_time: over which the innovations' whiteness is judged [s].
        watch: seconds of driving after a standstill in which a change of the load is looked for.
        settle: seconds of driving before the first standstill at which the load can change.
        change_time: over which evidence of a change of the load is summed [s].
        detection_threshold: least statistic of a change: chi-square, one degree of freedom for
            each parameter of the load, if there is none and the model is right.
        least_change: of some parameter of the load, in its prior sd; less is no change of load.
        valid_share: of its prior sd; an estimate is valid while its sd is below.
        drift: share of its prior sd by which a parameter may change [1 over the root of s].
        step_limit: largest share of its prior sd by which an estimate moves in a block.
        tracking_time: time constant of the twins' parameters behind the estimates [s]: longer than
            the periods of the car's own modes.
        curvature: variance of the error of a sensitivity over its square, if the parameters are
            uncertain by their prior sd in one of them. Above one, as it lasts for many blocks.
        speed_curvature: the same of the sensitivity of the speed to a move of the twins.
        slip_range: share of its speed that a wheel's slip may be uncertain by. Beyond, the noise
            of its speed grows with the square of that.
        impact: least jump of the sensitivities from block to block that counts as an impact, in
            variances of the noise, unless such jumps are usual.
        impact_wait: seconds after an impact without corrections.
        hold_off: seconds before the first correction.
        block: samples per correction.
        segment: seconds of used driving that are compared with one another.
        speed_gain: draws each twin's speed to the measured wheel speeds [1/s].
        least_excitation: variance over a second below which nothing is corrected [m2/s4]: that of
            ax and ay, and 900 m2/s2 times that of roll and pitch rate.
    """

    parameters: tuple[str, ...] = (*LOAD, *SCALES)
    sensor_errors: tuple[str, ...] = SENSOR_ERRORS
    prior_sd: Mapping[str, float] = field(default_factory=dict)
    noise_inflation: float = 3.0
    inflation_time: float = 10.0
    watch: float = 20.0
    settle: float = 5.0
    change_time: float = 2.0
    detection_threshold: float = 200.0
    least_change: float = 0.15
    valid_share: float = 0.2
    drift: float = 0.0003
    step_limit: float = 0.1
    tracking_time: float = 0.4
    curvature: float = 1.5
    speed_curvature: float = 0.03
    slip_range: float = 1.6e-4
    impact: float = 0.3
    impact_wait: float = 0.2
    hold_off: float = 1.0
    block: int = 10
    segment: float = 2.5
    speed_gain: float = 0.5
    least_excitation: float = 0.02

    def __post_init__(self) -> None:
        """Checks names and numbers."""
        estimated = [name for name in PARAMETERS if PARAMETER[name].prior_sd > 0.0]
        for kind, names, allowed in (
            ("parameters", self.parameters, estimated),
            ("sensor_errors", self.sensor_errors, SENSOR_ERRORS),
            ("prior_sd", tuple(self.prior_sd), estimated),
        ):
            if not set(names) <= set(allowed) or len(set(names)) < len(names):
                raise TwinError(
                    f"joint: {kind} are {', '.join(names)}; allowed: each at most once of "
                    f"{', '.join(allowed)}"
                )
        for name, value in self.prior_sd.items():
            if not 0.0 < value < np.inf:
                raise TwinError(f"joint: prior_sd of {name} is {value}; allowed: above 0, finite")
        for name in (*_POSITIVE, *_NOT_NEGATIVE):
            value = getattr(self, name)
            if not 0.0 <= value < np.inf or (value == 0.0 and name in _POSITIVE):
                least = "above 0" if name in _POSITIVE else "0 or more"
                raise TwinError(f"joint: {name} is {value}; allowed: {least}, finite")
        if not isinstance(self.block, int) or self.block < 1:
            raise TwinError(f"joint: block is {self.block}; allowed: a whole number, 1 or more")


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
    state: State


class JointObserver:
    """Estimates parameters of a black box jointly, by twins that differ in one each.

    Args:
        source: of the twins: a vehicle, or what makes a black box, called once for each.
        noise_sd: (10,) standard deviation of a sample's white noise by channel; NaN: not used.
        settings: what is estimated, and how.

    Raises:
        TwinError: a name is unknown or given twice, or a number is out of range.
    """

    def __init__(
        self,
        source: Source,
        noise_sd: ArrayLike,
        settings: JointSettings = JointSettings(),
    ) -> None:
        self.settings = settings
        names = settings.parameters
        self.ensemble = Twins(source, len(names) + 1)
        self.ensemble.require("joint", names)
        noise = self.ensemble.used(noise_sd, "joint")
        self.estimated = (*names, *settings.sensor_errors)
        prior = {name: PARAMETER[name].prior_sd for name in names} | dict(settings.prior_sd)
        errors = [SENSOR_ERROR[name] for name in settings.sensor_errors]
        self._prior = np.array(
            [*(prior[name] for name in names), *(error.prior_sd for error in errors)]
        )
        drift = settings.drift * self._prior
        for i, error in enumerate(errors, len(names)):
            if error.drift is not None:
                drift[i] = error.drift
        self.dt = self.ensemble.dt
        self._config = Configuration(
            parameter=np.array([PARAMETERS.index(name) for name in names], dtype=np.int64),
            step=np.array([PARAMETER[name].step for name in names]),
            sensor_error=np.array(
                [SENSOR_ERRORS.index(name) for name in settings.sensor_errors], dtype=np.int64
            ),
            tracking_time=settings.tracking_time,
            curvature=settings.curvature,
            speed_curvature=settings.speed_curvature,
            slip_range=settings.slip_range,
            impact=settings.impact,
            impact_wait=settings.impact_wait,
            step_limit=settings.step_limit * self._prior,
            drift=drift**2,
            noise=noise**2,
            nominal=self.ensemble.nominal.copy(),
            block=settings.block,
            segment=max(1, round(settings.segment / (settings.block * self.dt))),
            hold_off=round(settings.hold_off / (settings.block * self.dt)),
            speed_gain=settings.speed_gain,
            least_excitation=settings.least_excitation,
            rate_weight=RATE_WEIGHT,
            excitation_time=EXCITATION_TIME,
            inflation_time=settings.inflation_time,
            prior=self._prior.copy(),
            load=np.array([i for i, n in enumerate(names) if n in LOAD], dtype=np.int64),
            watch=round(settings.watch / (settings.block * self.dt)),
            settle=round(settings.settle / (settings.block * self.dt)),
            change_time=settings.change_time,
            detection_threshold=settings.detection_threshold,
            least_change=settings.least_change,
            dt=self.dt,
        )
        n, p, q = len(self.ensemble), len(PARAMETERS), self._prior.size
        ny, nx = len(OUTPUTS), len(STATES)
        self._state = State(
            theta=np.zeros(p), estimate=np.zeros(p), z=np.zeros(q), covariance=np.zeros((q, q)),
            out=np.zeros((n, ny)), total=np.zeros((n, ny)), measured=np.zeros(ny),
            present=np.zeros(ny), states=np.zeros((n, nx)), dx=np.zeros(nx), p=np.zeros(p),
            rate=np.zeros(len(names)), went=np.zeros(len(names)),
            usual=np.zeros((ny, len(names))), last_h=np.zeros((ny, q)),
            excitation=np.zeros((2, 4)),
            information=np.zeros((q, q)), clock=np.zeros(3, dtype=np.int64),
            ring=np.zeros((RING, n, ny)), late=np.zeros((n, ny)), edge=np.zeros(ny),
            inflation=np.zeros(ny), window=np.zeros((3, ny)), window_h=np.zeros((ny, q)),
            recent=np.zeros((q, q)), score=np.zeros(q), kept=np.zeros(q),
            kept_covariance=np.zeros((q, q)), kept_inflation=np.zeros(ny),
            blocks=np.zeros(3, dtype=np.int64), changes=np.zeros(1, dtype=np.int64),
            widening=np.zeros(1), segment_information=np.zeros((SEGMENTS, ny, q, q)),
            segment_score=np.zeros((SEGMENTS, ny, q)),
            scale_information=np.zeros((WINDOWS.size, ny, q, q)),
            scale_score=np.zeros((WINDOWS.size, ny, q)),
            scale_square=np.zeros((WINDOWS.size, ny, 2)),
            window_sums=np.zeros((WINDOWS.size, ny, 2 + q)), prior_mean=np.zeros(q),
            prior_covariance=np.zeros((q, q)), evidence=np.zeros(4, dtype=np.int64),
        )  # fmt: skip
        self.budget = None
        if isinstance(source, Vehicle):  # others may not know how to stand
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
        state = self._state
        for array in state:
            array[:] = 0
        state.theta[:] = initial_deltas(parameters)
        state.estimate[:] = state.theta
        state.z[: self._config.parameter.size] = state.theta[self._config.parameter]
        state.covariance[:] = np.diag(self._prior**2)
        state.inflation[:] = self.settings.noise_inflation
        joint_kernel.start_evidence(self._config, state)
        self.budget = None
        for i in range(len(self.ensemble)):
            p = state.theta.copy()
            if i > 0:
                p[self._config.parameter[i - 1]] += self._config.step[i - 1]
            self.ensemble.set_parameters(i, p)
        self.ensemble.settle(speed, road)

    def _weigh(self) -> None:
        """Weighs the evidence at the end of a segment, and goes on from what it says."""
        config, state = self._config, self._state
        if state.evidence[FULL] < 2:
            return
        used = float(state.evidence[USED]) * config.block * self.dt
        names = self.settings.sensor_errors
        speed = config.parameter.size + names.index("speed") if "speed" in names else None
        found = budget(state, self._prior, state.prior_mean, state.prior_covariance, speed, used)
        state.widening[0] = found.widening
        joint_kernel.take_over(
            config, state, found.z.copy(), found.covariance.copy(), found.noise_factor
        )
        merge_segments(state)
        self.budget = found

    def notes(self) -> tuple[str, ...]:
        """What is to be said of the drive so far, in sentences."""
        if self.budget is None:
            return (
                f"Nothing is known yet: {2 * self.settings.segment:g} s of driving that excites "
                "the car are needed before its parts can be compared.",
            )
        worst = np.nan_to_num(np.nanmax(np.nan_to_num(self.budget.whiteness), axis=0))
        channel = int(np.argmax(worst))
        if worst[channel] < DIFFERS:
            return ()
        return (
            f"The car differs from its twin: the residual of {OUTPUTS[channel]} varies "
            f"{np.sqrt(worst[channel]):.2g} times as much as its noise explains. The standard "
            f"deviations are {np.sqrt(self.budget.widening):.2g} times those of noise alone.",
        )

    @property
    def prior(self) -> Array:
        """(p + b,) standard deviations of `estimated` before the first sample."""
        return self._prior.copy()

    @property
    def segment_information(self) -> Array:
        """(10, p + b, p + b) Fisher's of the segment that is being driven, by channel."""
        upper = self._state.segment_information[min(int(self._state.evidence[FULL]), SEGMENTS - 1)]
        return upper + np.swapaxes(np.triu(upper, 1), 1, 2)

    @property
    def covariance(self) -> Array:
        """(p + b, p + b) of `estimated`, now, errors of the model included."""
        return self._state.covariance * max(float(self._state.widening[0]), 1.0)

    def update(self, u: ArrayLike, y: ArrayLike) -> Array:
        """Takes one sample of inputs (13,) and measurements (10,); returns the parameters (15,).

        Raises:
            TwinError: a value is not finite or out of range, or a twin has blown up.
        """
        u = np.ascontiguousarray(u, dtype=np.float64)
        y = np.ascontiguousarray(y, dtype=np.float64)
        self.ensemble.check_inputs(u[None], "update")
        check_measurements(y[None], OUTPUTS, "update", infinite=False)
        if joint_kernel.update(self.ensemble.cars, self._config, self._state, u, y):
            self._weigh()
        self.ensemble.check()
        return self._state.estimate.copy()

    def snapshot(self) -> JointSnapshot:
        """Everything that decides the future; a run from it is bit-exact."""
        return JointSnapshot(
            self.ensemble.snapshot(),
            self._state._replace(
                **{name: array.copy() for name, array in self._state._asdict().items()}
            ),
        )

    def restore(self, snapshot: JointSnapshot) -> None:
        """Goes back to a snapshot of an observer with the same settings and vehicle.

        Raises:
            TwinError: it estimates something else.
        """
        if snapshot.state.out.shape != self._state.out.shape or (
            snapshot.state.z.shape != self._state.z.shape
        ):
            raise TwinError(
                f"joint: the snapshot has {snapshot.state.z.size} estimates of "
                f"{len(snapshot.twins)} twins; allowed: {self._state.z.size} of "
                f"{len(self.ensemble)}"
            )
        self.ensemble.restore(snapshot.twins)
        for array, kept in zip(self._state, snapshot.state, strict=True):
            array[:] = kept
        self.budget = None

    def run(self, drive: Drive) -> JointEstimate:
        """Observes a whole drive, from the state that the observer is in.

        Raises:
            TwinError: the drive does not fit the twins, or a twin has blown up.
        """
        inputs, measurements = self.ensemble.given_by(drive)
        check_measurements(measurements, OUTPUTS, "drive", infinite=False)
        n, q = len(drive), self._prior.size
        log = Log(
            states=np.empty((n, len(STATES))),
            parameters=np.empty((n, len(PARAMETERS))),
            outputs=np.empty((n, len(OUTPUTS))),
            extended=np.empty((n, *EXTENDED_SHAPE)),
            sd=np.empty((n, q)),
            sensor_errors=np.empty((n, q - self._config.parameter.size)),
            changes=np.empty(n, dtype=np.int64),
            segments=np.empty(n, dtype=np.int64),
        )
        done = 0
        while done < n:
            done, sound = joint_kernel.run(
                self.ensemble.cars, self._config, self._state, inputs, measurements, log, done,
            )  # fmt: skip
            if not sound:
                raise self.ensemble.blown_up(drive.time[done])
            if self._state.evidence[FILLED] == 0 and self._state.evidence[USED] > 0:
                self._weigh()
                joint_kernel.claim(self._config, self._state, log, done - 1)
        valid, reason = judge(log, self._config, self.settings.valid_share)
        return JointEstimate(
            time=drive.time,
            **self.ensemble.histories(log.states, log.parameters, log.outputs, log.extended),
            estimated=self.estimated,
            sensor_error_names=self.settings.sensor_errors,
            prior=self._prior.copy(),
            sd=log.sd,
            valid=valid,
            reason=reason,
            reasons=REASONS,
            notes=self.notes(),
            changes=log.changes,
            sensor_errors=log.sensor_errors,
            covariance=self.covariance,
            information=self._state.information.copy(),
        )


def _make(given: Given) -> JointObserver:
    settings = given.settings or JointSettings()
    if given.parameters is not None:
        settings = replace(settings, parameters=given.parameters)
    if given.prior_sd:
        settings = replace(settings, prior_sd={**settings.prior_sd, **given.prior_sd})
    names = parameters_of(given.source(), settings.parameters)
    if given.parameters is None and names != settings.parameters:
        settings = replace(settings, parameters=names)
    return JointObserver(given.source(), given.noise(OUTPUTS), settings)


ENTRY = Entry(
    name="joint",
    words="a Kalman filter over all parameters at once, by twins that differ in one each",
    make=_make,
    needs=frozenset(("twin", "noise_sd")),
    channels=OUTPUTS,
    gives=(*LOAD, *SCALES, *SENSOR_ERRORS, "sideslip"),
    sd=True,
    online=True,
)
