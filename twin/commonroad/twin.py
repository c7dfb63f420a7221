"""CommonRoad's multi-body car as a digital twin: a black box of others, stepped from Python."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.channels import INPUTS, OUTPUTS, ROAD_HEIGHTS
from twin.commonroad.axes import COMMONROAD_STATES, measurements, move, our_states
from twin.commonroad.model import (
    LEAST_SPEED,
    STATES,
    MultiBody,
    advance,
    bmw_320i,
    is_sound,
    rolling,
)
from twin.errors import TwinError

Array = NDArray[np.float64]

COMMONROAD_PARAMETERS = ("mass", "Jxx", "Jyy", "Jzz")
"""Load parameters that the model has: mass, roll and pitch inertia of the sprung mass, yaw inertia
of the car. Its centre of mass stays where its states are."""

STEERING_RATIO = 16.0  # hand wheel over road wheels; chosen, as in models/bmw_320i.xml
FASTEST = 50.0  # [m/s], about where their parameters end (v_max)
LEAST_SHARE = 0.1  # of mass and inertias is left by any correction; chosen
# Of their parameters, the nominal values and all that a change of each adds to
_NOMINAL = ("m_s", "I_Phi_s", "I_y_s", "I_z")
_CHANGED = (("m_s", "m"), ("I_Phi_s",), ("I_y_s",), ("I_z",))


class CommonRoadTwin:
    """A black-box simulator of CommonRoad's multi-body BMW 320i.

    Needs the extra `commonroad`. Inputs and outputs are those of a `twin.Twin`, the IMU at the
    centre of mass of the sprung mass. The preload of its springs follows the sprung mass: it stands
    level under any load. See `twin.commonroad.model` for what it does not have.

    Attributes:
        inputs, outputs, states, parameters: names, in the order of the arrays.
        dt: step [s].
        nominal: the parameters without deltas [kg, kg m2]. Shape (4,).
    """

    inputs: tuple[str, ...] = INPUTS
    outputs: tuple[str, ...] = OUTPUTS
    states: tuple[str, ...] = COMMONROAD_STATES
    parameters: tuple[str, ...] = COMMONROAD_PARAMETERS
    dt = 1e-3

    def __init__(self, car: MultiBody | None = None) -> None:
        self._nominal = bmw_320i() if car is None else car
        self._car = self._nominal.copy()
        self.nominal = np.array([self._nominal[name] for name in _NOMINAL])
        self.nominal.setflags(write=False)
        self._time, self._torque = 0.0, np.empty(4)
        self._x = np.empty(STATES)
        self.reset(20.0)

    def reset(self, speed: float = 20.0) -> None:
        """Lets the car roll straight ahead, settled, with its parameters.

        Args:
            speed: [m/s]; the model divides by zero as it comes to rest.

        Raises:
            TwinError: the speed is not one at which the model works.
        """
        if not LEAST_SPEED <= speed <= FASTEST:
            raise TwinError(
                f"commonroad reset: speed is {speed} m/s; allowed: {LEAST_SPEED} to {FASTEST}"
            )
        self._time = 0.0
        self._x[:] = rolling(self._car, speed)

    def step(self, u: ArrayLike) -> Array:
        """Advances by one step: TiL Eq. (1).

        Args:
            u: (13,) `inputs`, held over the step.

        Returns:
            (10,) `outputs` before the step.

        Raises:
            TwinError: an input is not finite, the road is not flat, or the car has come to rest,
                locked a wheel or blown up.
        """
        u = _vector(u, len(INPUTS), "step")
        if u[ROAD_HEIGHTS].any():
            raise TwinError(
                f"commonroad step: road heights are {u[ROAD_HEIGHTS].tolist()} m; allowed: zeros"
            )
        before = self._x.tolist()
        rates = advance(self._car, self._x, u, STEERING_RATIO, self.dt, self._torque)
        self._time += self.dt
        if not is_sound(self._x):
            raise TwinError(
                f"commonroad: at t = {self._time:.3f} s the car has come to rest, locked a wheel "
                f"or blown up; the model needs at least {LEAST_SPEED} m/s and wheels that turn"
            )
        return measurements(before, rates.tolist())

    def correct(self, dx: ArrayLike) -> None:
        """Adds (16,) to the `states`: TiL Eq. (4)."""
        move(self._car, self._x, _vector(dx, len(COMMONROAD_STATES), "correct"))

    def set_parameters(self, p: ArrayLike) -> Array:
        """Sets the (4,) deltas of the `parameters` from nominal; returns what was set.

        Each keeps a tenth of its nominal value.
        """
        found = np.maximum(
            _vector(p, len(COMMONROAD_PARAMETERS), "set_parameters"),
            (LEAST_SHARE - 1.0) * self.nominal,
        )
        for names, delta in zip(_CHANGED, found, strict=True):
            for name in names:
                self._car[name] = self._nominal[name] + delta
        return found

    def read_states(self) -> Array:
        """The (16,) `states` now."""
        return our_states(self._car, self._x.tolist())


def _vector(values: ArrayLike, size: int, what: str) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise TwinError(f"commonroad {what}: {array.tolist()}, must be {size} finite numbers")
    return array
