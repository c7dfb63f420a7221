"""What an observer needs of a simulator."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin import Twin

Array = NDArray[np.float64]


@runtime_checkable
class BlackBox(Protocol):
    """A simulator that can stand in for `twin.Twin`: the truck, another's car, an FMU.

    Names follow `twin.INPUTS`, `twin.OUTPUTS`, `twin.STATES` and `twin.PARAMETERS` as far as they
    mean the same. Arrays that a method returns belong to the caller.
    """

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        ...

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the measurements."""
        ...

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        ...

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the load parameters, each the delta from the nominal vehicle."""
        ...

    @property
    def dt(self) -> float:
        """Step [s]."""
        ...

    def reset(self, speed: float = 0.0) -> None:
        """Settles at a speed [m/s] under the parameters in force."""
        ...

    def step(self, u: Array) -> Array:
        """Advances by a step under the inputs (nu,); returns the outputs (ny,) before it.

        Raises:
            TwinError: the simulation has blown up.
        """
        ...

    def correct(self, dx: Array) -> None:
        """Adds (nx,) to the states."""
        ...

    def set_parameters(self, p: Array) -> Array:
        """Sets the parameters (np,); returns what is physically valid of them."""
        ...

    def read_states(self) -> Array:
        """The states (nx,) now."""
        ...


def nominal_of(twin: BlackBox) -> Array:
    """(np,) its parameters without deltas, as its attribute `nominal` says; NaN if it has none."""
    told = getattr(twin, "nominal", None)
    size = len(twin.parameters)
    return np.full(size, np.nan) if told is None else np.array(told, dtype=np.float64)


def settle(twin: BlackBox, speed: float, road: ArrayLike | None = None) -> None:
    """Settles a twin.

    Args:
        twin: any black box; all but `twin.Twin` choose their own road.
        speed: [m/s].
        road: (4,) height under each wheel [m]; None: zero.
    """
    if isinstance(twin, Twin):
        twin.reset(speed, np.zeros(4) if road is None else road)
    else:
        twin.reset(speed)
