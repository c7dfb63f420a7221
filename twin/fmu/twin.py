"""A co-simulation FMU (FMI 2.0) as a digital twin: a black box of anybody's making.

**An FMU runs native code with your rights.** Open only those whose makers you trust.
"""

import shutil
import weakref
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import TwinError
from twin.fmu.file import close, describe, open_instance
from twin.fmu.names import FmuNames

Array = NDArray[np.float64]

FATAL = 4  # fmi2Fatal


class FmuTwin:
    """A black-box simulator out of a file, run through FMPy (extra `fmi`).

    Outputs are read after the inputs of a step have been set and before the step. An FMU that
    works them out in the step only shows them one sample late.

    FMI 2.0 grants a master inputs and tunable parameters at run time; many FMUs also take their
    local variables. One whose states cannot be set so is refused when it is opened. Memory and
    temporary files are freed with the object.

    Args:
        path: of the FMU.
        names: ours of its variables.

    Attributes:
        inputs, outputs, states, parameters: names, in the order of the arrays.
        dt: step [s].
        nominal: the parameters without deltas, as the FMU starts with them. Shape (np,).

    Raises:
        TwinError: FMPy is missing, the file is no such FMU, or a variable is not there or cannot
            be what it should.
    """

    def __init__(self, path: str | Path, names: FmuNames) -> None:
        self._path, self._names, self.dt = Path(path), names, float(names.dt)
        description = describe(self._path)
        variables = {variable.name: variable for variable in description.modelVariables}
        self._said: list[str] = []
        self._variables = {
            kind: [self._find(variables, kind, name) for name in getattr(names, kind).values()]
            for kind in ("inputs", "outputs", "states", "parameters")
        }
        self._speed = self._find(variables, "speed", names.speed) if names.speed else None
        self._fmu, folder = open_instance(self._path, description, self._said)
        self._close = weakref.finalize(self, close, self._fmu, folder)
        self._time = 0.0
        self._initialise([])
        self.nominal = self._get("parameters")
        self.nominal.setflags(write=False)
        self._parameters = np.zeros(len(self.parameters))
        self._check_states()
        self.reset()

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple(self._names.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the measurements."""
        return tuple(self._names.outputs)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states that can be corrected."""
        return tuple(self._names.states)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the load parameters."""
        return tuple(self._names.parameters)

    def reset(self, speed: float = 0.0) -> None:
        """Starts the FMU anew at a speed [m/s], with the parameters in force.

        Raises:
            TwinError: the FMU refuses, or has no variable for a speed other than zero.
        """
        if speed != 0.0 and self._speed is None:
            raise TwinError(
                f"{self._path}: names give no variable for the speed; allowed: to reset at 0 m/s"
            )
        self._call(self._fmu.reset)
        self._initialise([] if self._speed is None else [(self._speed, float(speed))])
        self.set_parameters(self._parameters)

    def step(self, u: ArrayLike) -> Array:
        """Advances by one step: TiL Eq. (1).

        Args:
            u: (nu,) `inputs`, held over the step.

        Returns:
            (ny,) `outputs` before the step.

        Raises:
            TwinError: an input is not finite, or the FMU fails or gives numbers that are not.
        """
        self._set("inputs", self._vector(u, len(self.inputs), "step"))
        y = self._get("outputs")
        if not np.isfinite(y).all():
            raise TwinError(f"{self._path}: outputs are {y.tolist()} at t = {self._time:.6g} s")
        self._call(self._fmu.doStep, self._time, self.dt)
        self._time += self.dt
        return y

    def correct(self, dx: ArrayLike) -> None:
        """Adds (nx,) to the `states`: TiL Eq. (4)."""
        change = self._vector(dx, len(self.states), "correct")
        self._set("states", self._get("states") + change)

    def set_parameters(self, p: ArrayLike) -> Array:
        """Sets the (np,) deltas of the `parameters` from nominal; returns what was set.

        Each is kept between the bounds that the FMU declares for it.
        """
        wanted = self.nominal + self._vector(p, len(self.parameters), "set_parameters")
        for i, variable in enumerate(self._variables["parameters"]):
            low, high = _bound(variable.min, -np.inf), _bound(variable.max, np.inf)
            wanted[i] = min(max(wanted[i], low), high)
        self._set("parameters", wanted)
        self._parameters = wanted - self.nominal
        return self._parameters.copy()

    def read_states(self) -> Array:
        """The (nx,) `states` now."""
        return self._get("states")

    def _find(self, variables: dict[str, Any], kind: str, name: str) -> Any:
        """A variable that can be what it should."""
        if name not in variables:
            raise TwinError(
                f"{self._path}: {kind} has {name!r}, which is no variable of the FMU; allowed: "
                f"{', '.join(variables)}"
            )
        variable = variables[name]
        if variable.type != "Real":
            raise TwinError(f"{self._path}: {name!r} is of type {variable.type}; allowed: Real")
        is_input = variable.causality == "input"
        tunable = variable.causality == "parameter" and variable.variability == "tunable"
        if (kind == "inputs" and not is_input) or (
            kind == "parameters" and not (is_input or tunable)
        ):
            raise TwinError(
                f"{self._path}: {kind} has {name!r}, which is {variable.causality}, "
                f"{variable.variability}; allowed: an input"
                f"{' or a tunable parameter' if kind == 'parameters' else ''}"
            )
        return variable

    def _initialise(self, start: Iterable[tuple[Any, float]]) -> None:
        self._time = 0.0
        self._call(self._fmu.setupExperiment, startTime=0.0)
        for variable, value in start:
            self._call(self._fmu.setReal, [variable.valueReference], [value])
        self._call(self._fmu.enterInitializationMode)
        self._call(self._fmu.exitInitializationMode)

    def _check_states(self) -> None:
        """Refuses an FMU that does not take corrections, rather than one that ignores them."""
        for name, variable in zip(self.states, self._variables["states"], strict=True):
            reference = [variable.valueReference]
            wanted = self._call(self._fmu.getReal, reference)[0] + 1.0
            self._call(self._fmu.setReal, reference, [wanted])
            found = self._call(self._fmu.getReal, reference)[0]
            if not np.isclose(found, wanted):
                raise TwinError(
                    f"{self._path}: state {name!r}, its {variable.name!r}, stays {found:g} when it "
                    f"is set to {wanted:g}; allowed: variables that the FMU lets a master set"
                )

    def _get(self, kind: str) -> Array:
        references = [variable.valueReference for variable in self._variables[kind]]
        return np.array(self._call(self._fmu.getReal, references) if references else [])

    def _set(self, kind: str, values: Array) -> None:
        references = [variable.valueReference for variable in self._variables[kind]]
        if references:
            self._call(self._fmu.setReal, references, values.tolist())

    def _call(self, function: Any, *arguments: Any, **named: Any) -> Any:
        if not self._close.alive:
            raise TwinError(f"{self._path}: has failed for good; open it anew")
        try:
            return function(*arguments, **named)
        except Exception as error:  # FMPy raises no narrower one for all of them
            if getattr(error, "status", None) == FATAL:
                self._abandon()
            reason = "; ".join([str(error), *self._said])
            raise TwinError(f"{self._path}: fails at t = {self._time:.6g} s: {reason}") from error

    def _abandon(self) -> None:
        """After a fatal failure FMI allows no call any more, not even the one that frees memory."""
        detached = self._close.detach()
        if detached is not None:
            shutil.rmtree(detached[2][1], ignore_errors=True)

    def _vector(self, values: ArrayLike, size: int, what: str) -> Array:
        array = np.asarray(values, dtype=np.float64)
        if array.shape != (size,) or not np.isfinite(array).all():
            raise TwinError(f"{self._path} {what}: {array.tolist()}, must be {size} finite numbers")
        return array


def _bound(declared: Any, otherwise: float) -> float:
    return otherwise if declared is None else float(declared)
