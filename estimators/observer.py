"""The Twin-in-the-Loop observer: TiL Eqs. (1)-(5) around a black-box twin.

Every sample the twin makes one step with the vehicle's inputs; the innovation between the measured
and the twin's outputs then corrects the twin's states by a linear law, TiL Eq. (4), and its load
parameters by nonlinear laws, TiL Eq. (5), one per parameter (`estimators.law`). Gains are
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

from estimators.black_box import BlackBox
from estimators.estimate import Estimate
from estimators.law import ParameterLaw, advance_law, compile_laws
from twin import Drive, Twin, TwinError, check_inputs
from twin.kernel import correct, is_sound, read_states, set_parameters, step

Array = NDArray[np.float64]


class Gains(NamedTuple):
    """The linear law K (nx, ny), TiL Eq. (4), by its entries that are not zero."""

    state: NDArray[np.int64]
    output: NDArray[np.int64]
    gain: Array  # [1/s times unit of the state over unit of the output]


class Memory(NamedTuple):
    """What an observer keeps from sample to sample, beside its twin."""

    u: Array  # (nu,) the inputs of the sample
    y: Array  # (ny,) the twin's outputs before the last correction
    dx: Array  # (nx,) the last correction of the states
    p: Array  # (np,) the parameters in force
    laws: Array  # (n, m) memory of each parameter law


class Observer:
    """A Twin-in-the-Loop observer.

    Args:
        twin: the black box; the observer owns it from now on. For a `twin.Twin` all of a sample is
            compiled code, for any other the simulator's step is called from Python.
        laws: what corrects which load parameter.
        gains: entries of K by (state, output), for example
            `{("yaw_rate", "yaw_rate"): 5.0}` [1/s].

    Raises:
        TwinError: a name that the twin does not have, or a gain that is not finite.
    """

    def __init__(
        self,
        twin: BlackBox,
        laws: Sequence[ParameterLaw],
        gains: Mapping[tuple[str, str], float] | None = None,
    ) -> None:
        self.twin = twin
        self._gains = _compile_gains(gains or {}, twin)
        self._laws, memory = compile_laws(laws, twin.dt, twin.outputs, twin.parameters)
        self._memory = Memory(
            u=np.zeros(len(twin.inputs)),
            y=np.zeros(len(twin.outputs)),
            dx=np.zeros(len(twin.states)),
            p=np.zeros(len(twin.parameters)),
            laws=memory,
        )
        self._fresh = memory.copy()

    def reset(self, speed: float, parameters: Mapping[str, float] | None = None) -> None:
        """Starts anew: the twin settles at a speed, believing in some load.

        Args:
            speed: [m/s].
            parameters: deltas from the nominal chassis by name; zero where not given.
        """
        p = np.zeros(len(self.twin.parameters))
        for name, value in (parameters or {}).items():
            p[_index(name, self.twin.parameters, "parameter")] = value
        self._memory.laws[:] = self._fresh
        self._memory.p[:] = self.twin.set_parameters(p)
        self.twin.reset(speed)

    def update(self, u: ArrayLike, y: ArrayLike) -> Array:
        """Takes one sample of inputs (nu,) and measurements (ny,); returns the parameters (np,).

        Raises:
            TwinError: a value is not finite or out of range, or the twin has blown up.
        """
        self._memory.u[:] = u
        y = np.ascontiguousarray(y, dtype=np.float64)
        check_measurements(y[None], self.twin.outputs, "update")
        if isinstance(self.twin, Twin):
            check_inputs(self._memory.u[None], "update")
            _update(self.twin.car, self._gains, self._laws, self._memory, y)
            self.twin.check()
        else:
            self._update_black_box(y)
        return self._memory.p.copy()

    def run(self, drive: Drive) -> Estimate:
        """Observes a whole drive, from the state that the observer is in.

        Raises:
            TwinError: the drive has other channels or another sample time than the twin, a value is
                not finite or out of range, or the twin has blown up.
        """
        check_drive(drive, self.twin)
        if isinstance(self.twin, Twin):
            return self._run_compiled(self.twin, drive)
        return self._run_black_box(drive)

    def _run_compiled(self, twin: Twin, drive: Drive) -> Estimate:
        check_inputs(drive.inputs, "drive")
        n = len(drive)
        states, parameters, outputs = _histories(twin, n)
        extended = np.empty((n, *twin.car.tyre_output.shape))
        done = _run(
            twin.car, self._gains, self._laws, self._memory,
            drive.inputs, drive.measurements, states, parameters, outputs, extended,
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
        )

    def _run_black_box(self, drive: Drive) -> Estimate:
        twin = self.twin
        states, parameters, outputs = _histories(twin, len(drive))
        for k in range(len(drive)):
            states[k] = twin.read_states()
            self._memory.u[:] = drive.inputs[k]
            self._update_black_box(drive.measurements[k])
            parameters[k] = self._memory.p
            outputs[k] = self._memory.y
        return Estimate(
            time=drive.time,
            states=states,
            parameters=parameters,
            outputs=outputs,
            extended=np.empty((len(drive), 0)),
            nominal=np.full(len(twin.parameters), np.nan),
            state_names=twin.states,
            parameter_names=twin.parameters,
            output_names=twin.outputs,
            extended_names=(),
        )

    def _update_black_box(self, y: Array) -> None:
        """`_update`, its simulator called from Python."""
        twin, memory = self.twin, self._memory
        memory.y[:] = twin.step(memory.u)
        if self._gains.gain.size:
            _state_law(self._gains, memory, y, twin.dt)
            twin.correct(memory.dx)
        _parameter_laws(self._laws, memory, y, twin.dt)
        memory.p[:] = twin.set_parameters(memory.p)


@njit(cache=True, nogil=True)
def _update(car, gains, laws, memory, y):
    """One sample of the observer, its inputs in memory.u."""
    step(car, memory.u, memory.y)
    if gains.gain.size:
        _state_law(gains, memory, y, car.dt)
        correct(car, memory.dx)
    _parameter_laws(laws, memory, y, car.dt)
    set_parameters(car, memory.p)


@njit(cache=True, nogil=True)
def _state_law(gains, memory, y, dt):
    """Fills memory.dx with the correction of the states: TiL Eq. (4); NaN corrects nothing."""
    memory.dx[:] = 0.0
    for k in range(gains.gain.size):
        j = gains.output[k]
        if not np.isnan(y[j]):
            memory.dx[gains.state[k]] += gains.gain[k] * dt * (y[j] - memory.y[j])


@njit(cache=True, nogil=True)
def _parameter_laws(laws, memory, y, dt):
    """Corrects memory.p: TiL Eq. (5)."""
    for k in range(laws.size):
        memory.p[laws[k].parameter] += advance_law(laws[k], memory.laws[k], y, memory.y, dt)


@njit(cache=True)
def _copy(source, target):
    """Element by element, as slices of unknown length are checked and cost a tenth of a step."""
    for i in range(target.size):
        target[i] = source[i]


@njit(cache=True, nogil=True)
def _run(
    car, gains, laws, memory, inputs, measurements, states, parameters, outputs, extended
):  # fmt: skip
    """All samples of a drive; returns how many were sound."""
    for k in range(inputs.shape[0]):
        read_states(car, states[k])
        _copy(inputs[k], memory.u)
        _update(car, gains, laws, memory, measurements[k])
        _copy(memory.p, parameters[k])
        _copy(memory.y, outputs[k])
        extended[k] = car.tyre_output
        if not is_sound(car):
            return k
    return inputs.shape[0]


def _histories(twin: BlackBox, n: int) -> tuple[Array, Array, Array]:
    """States, parameters and outputs of n samples, to be filled."""
    states, parameters, outputs = (
        np.empty((n, len(names))) for names in (twin.states, twin.parameters, twin.outputs)
    )
    return states, parameters, outputs


def _compile_gains(gains: Mapping[tuple[str, str], float], twin: BlackBox) -> Gains:
    state, output = [], []
    for (to, of), gain in gains.items():
        state.append(_index(to, twin.states, "state"))
        output.append(_index(of, twin.outputs, "output"))
        if not np.isfinite(gain):
            raise TwinError(f"gain {of} -> {to} is {gain}; allowed: finite numbers")
    return Gains(
        np.array(state, dtype=np.int64),
        np.array(output, dtype=np.int64),
        np.array(list(gains.values()), dtype=np.float64),
    )


def _index(name: str, names: tuple[str, ...], kind: str) -> int:
    if name not in names:
        raise TwinError(f"{kind} {name!r} is unknown; allowed: {', '.join(names)}")
    return names.index(name)


def check_drive(drive: Drive, twin: BlackBox) -> None:
    """Refuses a drive that does not fit a twin.

    Raises:
        TwinError: other channels or another sample time than the twin, or infinite measurements.
    """
    if (drive.input_names, drive.output_names) != (twin.inputs, twin.outputs):
        raise TwinError(
            f"drive: has channels {drive.input_names + drive.output_names}, the twin needs "
            f"{twin.inputs + twin.outputs} in this order"
        )
    if abs(drive.dt - twin.dt) > 1e-9:
        raise TwinError(f"drive: has samples every {drive.dt} s, the twin steps {twin.dt} s")
    check_measurements(drive.measurements, twin.outputs, "drive")


def check_measurements(y: Array, names: tuple[str, ...], what: str) -> None:
    """Refuses measurements (n, ny) that are infinite; NaN is no measurement.

    Raises:
        TwinError: as said, or another shape.
    """
    if y.shape[1:] != (len(names),):
        raise TwinError(f"{what}: measurements have shape {y.shape}; allowed: (n, {len(names)})")
    if np.isinf(y).any():
        row, column = np.argwhere(np.isinf(y))[0]
        raise TwinError(
            f"{what}: {names[column]} is {y[row, column]} in sample {row}; allowed: finite "
            "numbers, and NaN where there is no measurement"
        )
