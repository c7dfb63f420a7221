"""The Twin-in-the-Loop observer: TiL Eqs. (1)-(5) around a black-box twin.

Every sample the twin makes one step with the vehicle's inputs; the innovation between the measured
and the twin's outputs then corrects the twin's states by a linear law, TiL Eq. (4), and its load
parameters by nonlinear laws, TiL Eq. (5), one per parameter (`estimators.law`). Gains are
continuous, per second: they mean the same at any sample rate.

One compiled function, `_update`, is the observer. `Observer.update` calls it for one sample,
`Observer.run` for a whole drive.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from estimators.estimate import Estimate
from estimators.law import ParameterLaw, advance_law, compile_laws
from twin import INPUTS, OUTPUTS, PARAMETERS, STATES, Drive, Twin, TwinError, check_inputs
from twin.kernel import correct, is_sound, read_states, set_parameters, step

Array = NDArray[np.float64]


class Gains(NamedTuple):
    """The linear law K (28 x 10), TiL Eq. (4), by its entries that are not zero."""

    state: NDArray[np.int64]
    output: NDArray[np.int64]
    gain: Array  # [1/s times unit of the state over unit of the output]


class Memory(NamedTuple):
    """What an observer keeps from sample to sample, beside its twin."""

    u: Array  # (13,) the inputs of the sample
    y: Array  # (10,) the twin's outputs before the last correction
    dx: Array  # (28,) the last correction of the states
    p: Array  # (10,) the parameters in force
    laws: Array  # (n, m) memory of each parameter law


class Observer:
    """A Twin-in-the-Loop observer.

    Args:
        twin: the black box; the observer owns it from now on.
        laws: what corrects which load parameter.
        gains: entries of K by (state, output), for example
            `{("yaw_rate", "yaw_rate"): 5.0}` [1/s].

    Raises:
        TwinError: a name that the twin does not have, or a gain that is not finite.
    """

    def __init__(
        self,
        twin: Twin,
        laws: Sequence[ParameterLaw],
        gains: Mapping[tuple[str, str], float] | None = None,
    ) -> None:
        self.twin = twin
        self._gains = _compile_gains(gains or {})
        self._laws, memory = compile_laws(laws)
        self._memory = Memory(
            *(np.zeros(len(names)) for names in (INPUTS, OUTPUTS, STATES, PARAMETERS)), memory
        )
        self._fresh = memory.copy()

    def reset(self, speed: float, parameters: Mapping[str, float] | None = None) -> None:
        """Starts anew: the twin settles at a speed, believing in some load.

        Args:
            speed: [m/s].
            parameters: deltas from the nominal chassis by name; zero where not given.
        """
        p = np.zeros(len(PARAMETERS))
        for name, value in (parameters or {}).items():
            p[_index(name, PARAMETERS, "parameter")] = value
        self._memory.laws[:] = self._fresh
        self._memory.p[:] = self.twin.set_parameters(p)
        self.twin.reset(speed)

    def update(self, u: ArrayLike, y: ArrayLike) -> Array:
        """Takes one sample of inputs (13,) and measurements (10,); returns the parameters (10,).

        Raises:
            TwinError: a value is not finite or out of range, or the twin has blown up.
        """
        self._memory.u[:] = u
        y = np.ascontiguousarray(y, dtype=np.float64)
        check_inputs(self._memory.u[None], "update")
        _check_measurements(y[None], "update")
        _update(self.twin.car, self._gains, self._laws, self._memory, y)
        self.twin.check()
        return self._memory.p.copy()

    def run(self, drive: Drive) -> Estimate:
        """Observes a whole drive, from the state that the observer is in.

        Raises:
            TwinError: the drive has other channels or another sample time than the twin, a value is
                not finite or out of range, or the twin has blown up.
        """
        if (drive.input_names, drive.output_names) != (self.twin.inputs, self.twin.outputs):
            raise TwinError(
                f"drive: has channels {drive.input_names + drive.output_names}, the twin needs "
                f"{self.twin.inputs + self.twin.outputs} in this order"
            )
        if abs(drive.dt - self.twin.dt) > 1e-9:
            raise TwinError(
                f"drive: has samples every {drive.dt} s, the twin steps {self.twin.dt} s"
            )
        check_inputs(drive.inputs, "drive")
        _check_measurements(drive.measurements, "drive")
        n = len(drive)
        states, parameters, outputs = (
            np.empty((n, len(names))) for names in (STATES, PARAMETERS, OUTPUTS)
        )
        done = _run(
            self.twin.car, self._gains, self._laws, self._memory,
            drive.inputs, drive.measurements, states, parameters, outputs,
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
            nominal=self.twin.car.nominal.copy(),
        )


@njit(cache=True, nogil=True)
def _update(car, gains, laws, memory, y):
    """One sample of the observer, its inputs in memory.u."""
    step(car, memory.u, memory.y)
    if gains.gain.size:
        memory.dx[:] = 0.0
        for k in range(gains.gain.size):
            j = gains.output[k]
            memory.dx[gains.state[k]] += gains.gain[k] * car.dt * (y[j] - memory.y[j])
        correct(car, memory.dx)
    for k in range(laws.parameter.size):
        memory.p[laws.parameter[k]] += advance_law(laws, k, memory.laws[k], y, memory.y, car.dt)
    set_parameters(car, memory.p)


@njit(cache=True, nogil=True)
def _run(car, gains, laws, memory, inputs, measurements, states, parameters, outputs):
    """All samples of a drive; returns how many were sound."""
    for k in range(inputs.shape[0]):
        read_states(car, states[k])
        memory.u[:] = inputs[k]
        _update(car, gains, laws, memory, measurements[k])
        parameters[k] = memory.p
        outputs[k] = memory.y
        if not is_sound(car):
            return k
    return inputs.shape[0]


def _compile_gains(gains: Mapping[tuple[str, str], float]) -> Gains:
    state, output = [], []
    for (to, of), gain in gains.items():
        state.append(_index(to, STATES, "state"))
        output.append(_index(of, OUTPUTS, "output"))
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


def _check_measurements(y: Array, what: str) -> None:
    if y.shape[1:] != (len(OUTPUTS),):
        raise TwinError(f"{what}: measurements have shape {y.shape}; allowed: (n, {len(OUTPUTS)})")
    if not np.isfinite(y).all():
        row, column = np.argwhere(~np.isfinite(y))[0]
        raise TwinError(
            f"{what}: {OUTPUTS[column]} is {y[row, column]} in sample {row}; "
            "allowed: finite numbers"
        )
