"""The Twin-in-the-Loop observer: TiL Eqs. (1)-(5) around a black-box twin.

Every sample the twin makes one step with the vehicle's inputs; the innovation between the measured
and the twin's outputs then corrects the twin's states by a linear law, TiL Eq. (4), and its load
parameters by nonlinear laws, TiL Eq. (5), one per parameter (`estimators.til.law`). Gains are
continuous, per second: they mean the same at any sample rate.

One compiled function, `_update`, is the observer of a `twin.Twin`: `Observer.update` calls it for
one sample, `Observer.run` for a whole drive. Any other black box is stepped from Python, between
the same two compiled laws, `_state_law` and `_parameter_laws`.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate
from estimators.black_box import BlackBox, nominal_of, settle
from estimators.drive_channels import DriveChannels, check_measurements, given_by
from estimators.entry import Entry, Given
from estimators.priors import initial_deltas
from estimators.speed_follower import SpeedFollower, check_follower, follow
from estimators.til.gains import compile_gains
from estimators.til.law import (
    BEGUN,
    JUMPED,
    LEAST_SQUARES,
    PP,
    ParameterLaw,
    advance_law,
    compile_laws,
)
from estimators.til.measurement_validation import (
    LARGEST,
    REJECTED,
    SETTLING,
    guard,
    new_watch,
    renew,
)
from twin import PARAMETERS, Drive, Twin, TwinError, Y, check_inputs
from twin.kernel import correct, is_sound, read_states, set_parameters, step

Array = NDArray[np.float64]
NOT_FOLLOWED = SpeedFollower(mass=np.nan)  # stands where a drive has torques


class Memory(NamedTuple):
    """What an observer keeps from sample to sample, beside its twin."""

    u: Array  # (nu,) the inputs of the sample
    y: Array  # (ny,) the twin's outputs before the last correction
    dx: Array  # (nx,) the last correction of the states
    p: Array  # (np,) the parameters in force
    laws: Array  # (n, m) memory of each parameter law
    sample: NDArray[np.int64]  # (1,) samples since the last correction
    seen: Array  # (ny,) the measurements of the sample, NaN where the guard rejected one
    watch: Array  # see `measurement_validation`; without rows where there is none
    unsettled: Array  # (1,) time until estimates count as trustworthy again [s]


class Observer:
    """A Twin-in-the-Loop observer.

    Args:
        twin: the black box; the observer owns it from now on. For a `twin.Twin` all of a sample is
            compiled code, for any other the simulator's step is called from Python.
        laws: what corrects which load parameter.
        gains: entries of K by (state, output), for example
            `{("yaw_rate", "yaw_rate"): 5.0}` [1/s].
        every: corrections are made at every so-manieth sample; the twin steps at each.
        guarded: whether implausible measurements are rejected, see
        `estimators.til.measurement_validation`.
        follower: makes the torques of a drive that has none, from its measured `vx`.

    Raises:
        TwinError: a name that the twin does not have, a number that is not finite, or a
            feed-through of 1 or more, see `estimators.til.gains`.
    """

    def __init__(
        self,
        twin: BlackBox,
        laws: Sequence[ParameterLaw],
        gains: Mapping[tuple[str, str], float] | None = None,
        *,
        every: int = 1,
        guarded: bool = False,
        follower: SpeedFollower | None = None,
    ) -> None:
        if every < 1:
            raise TwinError(f"observer: every is {every}; allowed: 1 or more")
        self.twin = twin
        self.dt = every * twin.dt  # between corrections [s]
        self._every = every
        self._needed = tuple(dict.fromkeys(law.output for law in laws))
        self._estimated = tuple(dict.fromkeys(law.parameter for law in laws))
        self._follower = follower
        if follower:
            check_follower(follower)
        self._gains = compile_gains(gains or {}, twin)
        self._laws, memory = compile_laws(laws, self.dt, twin.outputs, twin.parameters)
        watched = twin.outputs if guarded else ()
        self.guarded = guarded
        self._memory = Memory(
            u=np.zeros(len(twin.inputs)),
            y=np.zeros(len(twin.outputs)),
            dx=np.zeros(len(twin.states)),
            p=np.zeros(len(twin.parameters)),
            laws=memory,
            sample=np.zeros(1, dtype=np.int64),
            seen=np.zeros(len(twin.outputs)),
            watch=new_watch(watched, {*self._needed, *(of for _, of in gains or {})}),
            unsettled=np.full(1, SETTLING),
        )
        self._fresh = memory.copy()

    def reset(
        self,
        speed: float,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """Starts anew: the twin settles at a speed, under some load.

        Args:
            speed: [m/s].
            parameters: initial deltas from the nominal values by name; zero where not given.
            road: (4,) height under each wheel [m]; zero if not given.
        """
        p = initial_deltas(parameters, self.twin.parameters)
        self._memory.laws[:] = self._fresh
        self._memory.p[:] = self.twin.set_parameters(p)
        self._settle(speed, road)

    def restart(self, speed: float) -> None:
        """Goes on at another place, after a gap: what is known of the parameters stays.

        Args:
            speed: [m/s] at which the twin settles.
        """
        self._memory.laws[:, BEGUN:] = self._fresh[:, BEGUN:]
        self._settle(speed)

    def _settle(self, speed: float, road: ArrayLike | None = None) -> None:
        self._memory.sample[:] = 0
        renew(self._memory.watch)
        self.distrust()
        settle(self.twin, speed, road)

    def distrust(self) -> None:
        """Says that something else was wrong: estimates have to settle again."""
        self._memory.unsettled[:] = SETTLING

    def forget(self, seconds: float, sd: Mapping[str, float]) -> None:
        """Lets knowledge that has not been used for a time count less, never less than none.

        Args:
            seconds: for which nobody watched; each law's drift says what may have changed.
            sd: what may have changed beside, by parameter.
        """
        for law, memory, fresh in zip(self._laws, self._memory.laws, self._fresh, strict=True):
            if law["form"] == LEAST_SQUARES:
                extra = sd.get(self.twin.parameters[law["parameter"]], 0.0)
                widened = memory[PP] + law["drift"] ** 2 * max(seconds, 0.0) + extra**2
                memory[PP] = min(widened, fresh[PP])

    @property
    def trustworthy(self) -> bool:
        """Whether the last sample's estimates are; without a guard nobody looks, and they are."""
        return not self.guarded or bool(self._memory.unsettled[0] <= 0.0)

    @property
    def rejected(self) -> tuple[str, ...]:
        """Outputs that the guard rejected in the last sample."""
        marked = self._memory.watch[:, REJECTED] > 0.0
        return tuple(name for name, m in zip(self.twin.outputs, marked, strict=False) if m)

    @property
    def memory(self) -> Memory:
        """What it keeps from sample to sample; of use to `estimators.til.snapshot` only."""
        return self._memory

    def settings(self) -> bytes:
        """All that two observers of the same twin can differ in, but for what they have seen."""
        kinds = self.twin.outputs, self.twin.parameters, self._every, self.guarded
        gains = b"".join(column.tobytes() for column in self._gains)
        return repr(kinds).encode() + gains + self._laws.tobytes() + self._fresh.tobytes()

    def parameter_sd(self) -> dict[str, float]:
        """Standard deviation of each parameter that least squares fit, as their law sees it."""
        return {
            self.twin.parameters[law["parameter"]]: float(np.sqrt(memory[PP]))
            for law, memory in zip(self._laws, self._memory.laws, strict=True)
            if law["form"] == LEAST_SQUARES
        }

    def update(self, u: ArrayLike, y: ArrayLike) -> Array:
        """Takes one sample of inputs (nu,) and measurements (ny,); returns the parameters (np,).

        Raises:
            TwinError: a value is not finite or out of range, or the twin has blown up.
        """
        self._memory.u[:] = u
        y = np.ascontiguousarray(y, dtype=np.float64)
        check_measurements(y[None], self.twin.outputs, "update", infinite=self.guarded)
        if isinstance(self.twin, Twin):
            check_inputs(self._memory.u[None], "update")
            _update(self.twin.car, self._gains, self._laws, self._memory, y, self._every)
            self.twin.check()
        else:
            self._update_black_box(y)
        return self._memory.p.copy()

    def run(self, drive: Drive) -> Estimate:
        """Observes a whole drive, from the state that the observer is in.

        Where the drive has no torques the twin follows the measured `vx`.

        Raises:
            TwinError: the drive has other channels or another sample time than the twin, lacks what
                a law needs altogether, a value is not finite or out of range, or the twin has blown
                up.
        """
        given = given_by(drive, self.twin, self._follower)
        check_measurements(given.measurements, self.twin.outputs, "drive", infinite=self.guarded)
        for name in () if self.guarded else self._needed:
            if np.isnan(drive.channel(name)).all():
                raise TwinError(f"drive: has no measurement of {name}, which a law needs")
        if isinstance(self.twin, Twin):
            return self._run_compiled(self.twin, drive, given)
        return self._run_black_box(drive, given)

    def _run_compiled(self, twin: Twin, drive: Drive, given: DriveChannels) -> Estimate:
        check_inputs(given.inputs, "drive")
        n = len(drive)
        states, parameters, outputs = _histories(twin, n)
        trustworthy = np.ones(n, dtype=np.bool_)
        extended = np.empty((n, *twin.car.tyre_output.shape))
        variance = np.empty((n, self._laws.size))
        done = _run(
            twin.car, self._gains, self._laws, self._memory, self._every,
            self._follower or NOT_FOLLOWED, given, states, parameters, outputs, extended,
            variance, trustworthy,
        )  # fmt: skip
        if done < n:
            raise TwinError(
                f"drive: the twin blew up at t = {drive.time[done]:.3f} s; the gains are too "
                "high, or the inputs are none that this car can follow"
            )
        return Estimate(
            time=drive.time,
            states=states,
            parameters=parameters,
            outputs=outputs,
            extended=extended.reshape(n, -1),
            nominal=twin.car.nominal.copy(),
            estimated=self._estimated,
            sd=self._sd(variance),
            trustworthy=trustworthy,
        )

    def _run_black_box(self, drive: Drive, given: DriveChannels) -> Estimate:
        twin = self.twin
        states, parameters, outputs = _histories(twin, len(drive))
        trustworthy = np.empty(len(drive), dtype=np.bool_)
        variance = np.empty((len(drive), self._laws.size))
        for k in range(len(drive)):
            states[k] = twin.read_states()
            self._memory.u[:] = given.inputs[k]
            self._update_black_box(given.measurements[k])
            parameters[k] = self._memory.p
            outputs[k] = self._memory.y
            variance[k] = self._memory.laws[:, PP]
            trustworthy[k] = self.trustworthy
        return Estimate(
            time=drive.time,
            states=states,
            parameters=parameters,
            outputs=outputs,
            extended=np.empty((len(drive), 0)),
            nominal=nominal_of(twin),
            state_names=twin.states,
            parameter_names=twin.parameters,
            output_names=twin.outputs,
            extended_names=(),
            estimated=self._estimated,
            sd=self._sd(variance),
            trustworthy=trustworthy,
        )

    def _sd(self, variance: Array) -> Array | None:
        """(N, p) standard deviations of what is estimated; NaN where its law knows none.

        Args:
            variance: (N, n) of each law's parameter, as the law has it.

        Returns:
            None if no law is of the least-squares form.
        """
        if not (self._laws["form"] == LEAST_SQUARES).any():
            return None
        sd = np.full((len(variance), len(self._estimated)), np.nan)
        for law, values in zip(self._laws, variance.T, strict=True):
            if law["form"] == LEAST_SQUARES:
                name = self.twin.parameters[law["parameter"]]
                sd[:, self._estimated.index(name)] = np.sqrt(values)
        return sd

    def _update_black_box(self, y: Array) -> None:
        """`_update`, its simulator called from Python."""
        twin, memory = self.twin, self._memory
        memory.y[:] = twin.step(memory.u)
        memory.seen[:] = y
        if self.guarded:
            _watch(memory, twin.dt)
        memory.sample[0] += 1
        if memory.sample[0] < self._every:
            return
        memory.sample[0] = 0
        if self._gains.gain.size:
            _state_law(self._gains, memory, self.dt)
            twin.correct(memory.dx)
        _parameter_laws(self._laws, memory, self.dt)
        memory.p[:] = twin.set_parameters(memory.p)


@njit(cache=True, nogil=True)
def _update(car, gains, laws, memory, y, every):
    """One sample of the observer, its inputs in memory.u."""
    step(car, memory.u, memory.y)
    _copy(y, memory.seen)
    if memory.watch.shape[0]:
        _watch(memory, car.dt)
    memory.sample[0] += 1
    if memory.sample[0] < every:
        return
    memory.sample[0] = 0
    dt = every * car.dt
    if gains.gain.size:
        _state_law(gains, memory, dt)
        correct(car, memory.dx)
    _parameter_laws(laws, memory, dt)
    set_parameters(car, memory.p)


@njit(cache=True, nogil=True)
def _watch(memory, dt):
    """Guards one sample, memory.seen, and keeps the time that estimates need to settle."""
    sound = guard(memory.watch, memory.seen, memory.y, dt)
    memory.unsettled[0] = max(memory.unsettled[0] - dt, 0.0) if sound else SETTLING


@njit(cache=True, nogil=True)
def _state_law(gains, memory, dt):
    """Fills memory.dx with the correction of the states: TiL Eq. (4); NaN corrects nothing."""
    y = memory.seen
    memory.dx[:] = 0.0
    for k in range(gains.gain.size):
        j = gains.output[k]
        if not np.isnan(y[j]):
            memory.dx[gains.state[k]] += gains.gain[k] * dt * (y[j] - memory.y[j])


@njit(cache=True, nogil=True)
def _parameter_laws(laws, memory, dt):
    """Corrects memory.p: TiL Eq. (5)."""
    for k in range(laws.size):
        law = laws[k]
        p = memory.p[law.parameter]
        p += advance_law(law, memory.laws[k], memory.seen, memory.y, dt)
        memory.p[law.parameter] = min(max(p, -law.largest), law.largest)
        if memory.laws[k, JUMPED] > 0.0:
            memory.unsettled[0] = SETTLING


@njit(cache=True)
def _copy(source, target):
    """Element by element, as slices of unknown length are checked and cost a tenth of a step."""
    for i in range(target.size):
        target[i] = source[i]


@njit(cache=True)
def _plausible(memory, ax):
    """The acceleration [m/s2] before the guard has seen it: NaN if it cannot be right."""
    if memory.watch.shape[0]:
        row = memory.watch[0]
        if row[REJECTED] > 0.0 or abs(ax) > row[LARGEST]:
            return np.nan
    return ax


@njit(cache=True, nogil=True)
def _run(
    car, gains, laws, memory, every, follower, given, states, parameters, outputs, extended,
    variance, trustworthy,
):  # fmt: skip
    """All samples of a drive; returns how many were sound."""
    n = given.inputs.shape[0]
    for k in range(n):
        read_states(car, states[k])
        _copy(given.inputs[k], memory.u)
        if given.speed.size:
            ahead = _plausible(memory, given.measurements[k, Y.ax])
            follow(follower, given.speed[k], ahead, states[k], memory.u)
        _update(car, gains, laws, memory, given.measurements[k], every)
        _copy(memory.p, parameters[k])
        _copy(memory.y, outputs[k])
        extended[k] = car.tyre_output
        for law in range(laws.size):
            variance[k, law] = memory.laws[law, PP]
        if memory.watch.shape[0]:
            trustworthy[k] = memory.unsettled[0] <= 0.0
        if not is_sound(car):
            return k
    return n


def _histories(twin: BlackBox, n: int) -> tuple[Array, Array, Array]:
    """States, parameters and outputs of n samples, to be filled."""
    states, parameters, outputs = (
        np.empty((n, len(names))) for names in (twin.states, twin.parameters, twin.outputs)
    )
    return states, parameters, outputs


def _make(given: Given) -> Observer:
    return Observer(
        given.twin(), given.laws, given.gains, every=given.every, guarded=given.validated,
        follower=given.follower,
    )  # fmt: skip


def _make_open_loop(given: Given) -> Observer:
    return Observer(given.twin(), [], follower=given.follower)


ENTRIES = (
    Entry(
        name="til",
        words="the Twin-in-the-Loop observer, its laws by least squares",
        make=_make,
        needs=frozenset(("twin",)),
        gives=(*PARAMETERS, "sideslip"),
        sd=True,
        online=True,
    ),
    Entry(
        name="til-paper",
        words="the Twin-in-the-Loop observer with the laws as the paper has them",
        make=_make,
        needs=frozenset(("twin", "laws")),
        gives=(*PARAMETERS, "sideslip"),
        sd=True,
        online=True,
    ),
    Entry(
        name="zero",
        words="the twin alone, without any correction",
        make=_make_open_loop,
        needs=frozenset(("twin",)),
        gives=("sideslip",),
        online=True,
    ),
)
