"""The truck of KBF as a digital twin: a black box like that of the cars, stepped from Python."""

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.channels import WHEELS
from twin.errors import TwinError
from twin.truck.model import RATES, Truck
from twin.truck.parameters import TruckParameters

Array = NDArray[np.float64]

ROAD_HEIGHTS = tuple(f"road_height_{wheel}" for wheel in WHEELS)
"""Inputs of the truck [m]."""

TRUCK_PARAMETERS = ("mass", "Jxx", "Jyy")
"""Load parameters of the truck [kg, kg m2, kg m2], p of KBF Eq. (8)."""

_JOINTS = ("front_axle_heave", "front_axle_roll", "rear_axle_heave", "rear_axle_roll")
TRUCK_STATES = (
    *("heave", "roll", "pitch", *_JOINTS),  # from the rest at the nominal load [m, rad]
    *(*RATES, *(f"{joint}_rate" for joint in _JOINTS)),  # [m/s, rad/s]
)

LEAST_SHARE = 0.1  # of the nominal mass and inertias is left by any correction; chosen
TRIANGLE_MARGIN = 1e-3  # so far [-] inside |Jxx - Jyy| <= Jzz <= Jxx + Jyy
FASTEST = 1e6  # [m/s, rad/s] no joint of a sound simulation moves


class TruckTwin:
    """A black-box simulator of the truck, for an observer that corrects it.

    As simulator of the whole vehicle it gets what excites the vehicle, the road heights under its
    wheels. The Kalman-Bucy filter, which knows the sprung mass only, gets the suspensions instead.

    Attributes:
        inputs, outputs, states, parameters: names, in the order of the arrays.
        dt: step [s].
        nominal: mass, roll and pitch inertia without deltas [kg, kg m2, kg m2]. Shape (3,).
    """

    inputs: tuple[str, ...] = ROAD_HEIGHTS
    outputs: tuple[str, ...] = RATES
    states: tuple[str, ...] = TRUCK_STATES
    parameters: tuple[str, ...] = TRUCK_PARAMETERS

    def __init__(self, parameters: TruckParameters | None = None, *, gravity: float = 0.0) -> None:
        truck = Truck(parameters, gravity=gravity)
        self._load = truck.parameters.nominal
        self._model, self._data = truck.model, mujoco.MjData(truck.model)
        # What blows up is to be seen, not put back to zero
        self._model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        self._chassis = self._model.body("chassis").id
        self._axle_mass = sum(truck.parameters.axle_mass)
        self.dt = float(self._model.opt.timestep)
        self.nominal = self._load.parameters
        self.nominal.setflags(write=False)

    def reset(self, speed: float = 0.0) -> None:
        """Puts the truck to rest at zero, with its parameters.

        Args:
            speed: [m/s]; heave, roll and pitch do not depend on it. It is in the road heights.
        """
        mujoco.mj_resetData(self._model, self._data)

    def step(self, u: ArrayLike) -> Array:
        """Advances by one step: TiL Eq. (1).

        Args:
            u: (4,) `inputs`, held over the step.

        Returns:
            (3,) `outputs` before the step.

        Raises:
            TwinError: an input is not finite, or the simulation has blown up.
        """
        self._data.ctrl[:] = _vector(u, len(ROAD_HEIGHTS), "step")
        mujoco.mj_step(self._model, self._data)
        if not np.abs(self._data.qvel).max() < FASTEST:
            raise TwinError(
                f"truck: the simulation blew up at t = {self._data.time:.3f} s; look for road "
                "heights or corrections that no truck can follow"
            )
        return self._data.sensordata[: len(RATES)].copy()

    def correct(self, dx: ArrayLike) -> None:
        """Adds (14,) to the `states`: TiL Eq. (4)."""
        change = _vector(dx, len(TRUCK_STATES), "correct")
        self._data.qpos[:] += change[: self._model.nq]
        self._data.qvel[:] += change[self._model.nq :]

    def set_parameters(self, p: ArrayLike) -> Array:
        """Sets the (3,) deltas of the `parameters` from nominal; returns what a body can have.

        Each keeps a tenth of its nominal value. The yaw inertia, of which no output tells, follows
        the pitch inertia as far as the triangle inequality of a rigid body lets it.
        """
        found = np.maximum(
            _vector(p, len(TRUCK_PARAMETERS), "set_parameters"),
            (LEAST_SHARE - 1.0) * self.nominal,
        )
        mass, roll, pitch = self.nominal + found
        low, high = abs(roll - pitch), roll + pitch
        margin = TRIANGLE_MARGIN * (high - low)
        yaw = self._load.yaw_inertia * pitch / self._load.pitch_inertia
        yaw = min(max(yaw, low + margin), high - margin)
        self._model.body_mass[self._chassis] = mass
        self._model.body_inertia[self._chassis] = (roll, pitch, yaw)
        self._model.body_subtreemass[self._chassis] = mass
        self._model.body_subtreemass[0] = mass + self._axle_mass
        return found

    def read_states(self) -> Array:
        """The (14,) `states` now."""
        return np.concatenate([self._data.qpos, self._data.qvel])


def _vector(values: ArrayLike, size: int, what: str) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise TwinError(f"truck {what}: {array.tolist()}, must be {size} finite numbers")
    return array
