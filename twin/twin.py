"""The digital twin: a vehicle in MuJoCo behind the black-box boundary."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin import kernel
from twin.binding import bind
from twin.car.fingerprint import fingerprint
from twin.car.vehicle import Vehicle
from twin.car_record import Car, new_cars
from twin.channels import (
    CHANNEL,
    EXTENDED,
    INPUTS,
    OUTPUTS,
    ROAD_HEIGHTS,
    STATES,
    TYRE,
    TYRE_OUTPUTS,
)
from twin.errors import TwinError
from twin.parameters import PARAMETERS
from twin.tyre.contact import ROAD
from twin.tyre.four_tyres import NAMES
from twin.tyre.radius import effective_radius

Array = NDArray[np.float64]
SETTLING_STEPS = 20
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class Snapshot(NamedTuple):
    """Everything that decides a twin's future."""

    state: Array  # MuJoCo's integration state
    tyre_state: Array  # (4, 3)
    input_state: Array  # (9,)
    front_force: Array  # (2,)
    parameters: Array  # (np,)


class Twin:
    """A black-box simulator: step it, read its sensors, correct it, set its parameters.

    Attributes:
        vehicle: what it simulates; workers rebuild their own twin from it.
        car: the same twin as compiled code sees it, valid as long as this object lives.
        inputs, outputs, states, parameters, extended: names, in the order of the arrays.
        model, data: MuJoCo's, to look at and to draw; an observer has no business there.
    """

    inputs = INPUTS
    outputs = OUTPUTS
    states = STATES
    parameters = PARAMETERS
    extended = EXTENDED
    tyre_outputs = TYRE_OUTPUTS

    def __init__(self, vehicle: Vehicle, room: NDArray[np.void] | None = None) -> None:
        """Makes a twin that stands still.

        Args:
            vehicle: what it simulates.
            room: (1,) record of `twin.car_record.CAR_DTYPE` for `car`, which must live as long; by
                default the twin has its own.
        """
        self.vehicle = vehicle
        self.model = vehicle.compile()
        self.data = mujoco.MjData(self.model)
        self._tyres = vehicle.tyres()
        room = new_cars(1) if room is None else room
        bind(room, self.model, self.data, self._tyres, dict(vehicle.scales))
        self.car: Car = room[0]
        self.dt = self.car.dt
        self.reset()

    def __reduce__(self) -> str:
        raise TwinError("a Twin owns memory of MuJoCo and cannot be pickled; send its Vehicle")

    def reset(self, speed: float = 0.0, road: ArrayLike = (0.0, 0.0, 0.0, 0.0)) -> None:
        """Puts the car on its wheels, settled while it rolls straight ahead, with its parameters.

        Heave, pitch, roll and travels are those at which nothing accelerates but the car as a
        whole, which coasts; wheels roll freely and the tyres are relaxed.

        Args:
            speed: [m/s], forwards.
            road: (4,) height under each wheel [m].

        Raises:
            TwinError: the car has no such equilibrium, for example as it is too heavy.
        """
        if not 0.0 <= speed <= 150.0:
            raise TwinError(f"reset: speed is {speed} m/s; allowed: 0 to 150")
        u = np.zeros(len(INPUTS))
        u[ROAD_HEIGHTS] = road
        mujoco.mj_resetData(self.model, self.data)
        ahead, normal = self._plane(u[ROAD_HEIGHTS])
        velocity, spin = speed * ahead, np.zeros(4)
        pose = self._parallel_to(u[ROAD_HEIGHTS], ahead, normal)
        rest = [2, 3, 4, *self.car.travel_dof]

        def accelerations(pose: Array) -> Array:
            self._place(pose, velocity, spin, u[ROAD_HEIGHTS])
            kernel.step(self.car, u, np.empty(len(OUTPUTS)))
            rates = self.data.qacc[rest]
            rates[0] = normal @ self.data.qacc[:3]  # a free car runs down its slope
            return rates

        tyres = self._tyres.copy()
        for name in ("vertical_stiffness", "unloaded_radius"):  # which its radius hangs on
            tyres[name] = self.car.tyres[NAMES.index(name)]
        # Newton's method: scipy's root would keep this twin and its memory alive in a cycle
        residual = np.inf
        for _ in range(SETTLING_STEPS):
            rates = accelerations(pose)
            residual = np.abs(rates).max()
            if not 1e-9 < residual < np.inf:
                break
            slopes = [(accelerations(pose + dp) - rates) / 1e-6 for dp in 1e-6 * np.eye(7)]
            try:
                pose -= np.linalg.solve(np.transpose(slopes), rates)
            except np.linalg.LinAlgError:  # off the road: the tyres do not answer
                break
            accelerations(pose)
            loads = self.car.tyre_output[:, TYRE.fz]  # the rolling radius hangs on them, if weakly
            spin[:] = [speed / effective_radius(t, z) for t, z in zip(tyres, loads, strict=True)]
        if not residual < 1e-3:
            raise TwinError(
                f"{self.vehicle.source}: the car does not settle on its wheels at {speed} m/s; "
                f"accelerations of {residual:.3g} m/s2 remain"
            )
        self._place(pose, velocity, spin, u[ROAD_HEIGHTS])
        self.data.time = 0.0

    def _plane(self, road: Array) -> tuple[Array, Array]:
        """Directions ahead in the plane of the road under the wheels, and normal to it."""
        rise = (road[0] + road[1] - road[2] - road[3]) / (2.0 * self.car.wheelbase)
        bank = (road[0] - road[1] + road[2] - road[3]) / (2.0 * self.car.track)
        upright = 1.0 - rise**2 - bank**2
        if not upright > 0.25:
            raise TwinError(f"reset: road is {road}; allowed: a plane of at most 60 degrees")
        ahead = np.array([np.sqrt(1.0 - rise**2), 0.0, rise])
        return ahead, np.array([-rise, -bank, np.sqrt(upright)])

    def _parallel_to(self, road: Array, ahead: Array, normal: Array) -> Array:
        """The pose (7,) as drawn in the MJCF, wheels at their height above the road's plane."""
        pose = np.zeros(7)
        pose[:3] = self.data.qpos[2], np.arcsin(-normal[1]), -np.arcsin(ahead[2])
        heights = []
        for tilt in (0.0, 1.0):
            self._place(pose * [1.0, tilt, tilt, 0, 0, 0, 0], np.zeros(3), np.zeros(4), road)
            mujoco.mj_kinematics(self.model, self.data)
            heights.append(self.data.xpos[self.car.wheel_body, 2].mean())
        pose[0] += np.mean(road) + heights[0] - heights[1]
        pose[3:] = np.array([1.0, -1.0, -1.0, 1.0]) * (road @ [0.25, -0.25, -0.25, 0.25])  # warp
        return pose

    def _place(self, pose: Array, velocity: Array, spin: Array, road: Array) -> None:
        """Puts height, roll, pitch and four travels, rolling straight ahead on relaxed tyres."""
        data, car = self.data, self.car
        data.qpos[:] = 0.0
        data.qpos[2] = pose[0]
        mujoco.mju_euler2Quat(data.qpos[3:7], np.array([pose[2], pose[1], 0.0]), "YXZ")
        data.qpos[car.travel_qpos] = pose[3:]
        data.qvel[:] = 0.0
        data.qvel[:3] = velocity
        data.qvel[car.spin_dof] = spin
        car.tyre_state[:, :ROAD] = 0.0
        car.tyre_state[:, ROAD] = road
        car.input_state[:] = np.nan
        car.front_force[:] = 0.0

    def step(self, u: ArrayLike) -> Array:
        """Advances by one step: TiL Eq. (1).

        Args:
            u: (13,) inputs, see `inputs`.

        Returns:
            (10,) measurements before the step, see `outputs`.

        Raises:
            TwinError: an input is not finite or out of range, or the car has blown up.
        """
        u = np.ascontiguousarray(u, dtype=np.float64)
        check_inputs(u[None], "step")
        y = np.empty(len(OUTPUTS))
        kernel.step(self.car, u, y)
        self.check()
        return y

    def correct(self, dx: ArrayLike) -> None:
        """Adds (28,) to the states, see `states`: TiL Eq. (4)."""
        kernel.correct(self.car, _vector(dx, len(STATES), "correct"))

    def set_parameters(self, p: ArrayLike) -> Array:
        """Sets the (20,) parameters, see `parameters`; returns what is physically valid."""
        p = _vector(p, len(PARAMETERS), "set_parameters").copy()
        kernel.set_parameters(self.car, p)
        return p

    def read_states(self) -> Array:
        """The (28,) states now, see `states`."""
        x = np.empty(len(STATES))
        kernel.read_states(self.car, x)
        return x

    def tyre_forces(self) -> Array:
        """(4, 9) forces, moments and slips of the last step, see `tyre_outputs`."""
        return self.car.tyre_output.copy()

    def snapshot(self) -> Snapshot:
        """Everything that decides the future; a replay from it is bit-exact."""
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        car = self.car
        return Snapshot(
            state=state,
            tyre_state=car.tyre_state.copy(),
            input_state=car.input_state.copy(),
            front_force=car.front_force.copy(),
            parameters=car.parameters.copy(),
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Goes back to a snapshot of a twin of the same vehicle."""
        mujoco.mj_setState(self.model, self.data, snapshot.state, _STATE)
        self.car.tyre_state[:] = snapshot.tyre_state
        self.car.input_state[:] = snapshot.input_state
        self.car.front_force[:] = snapshot.front_force
        kernel.set_parameters(self.car, snapshot.parameters.copy())

    def fingerprint(self) -> str:
        """Hash of the vehicle: a snapshot belongs to twins of the same one."""
        return fingerprint(self.vehicle)

    def check(self) -> None:
        """Raises TwinError once the simulation has blown up."""
        if not kernel.is_sound(self.car):
            raise TwinError(
                f"{self.vehicle.source}: the simulation blew up at t = {self.data.time:.3f} s; "
                "look for inputs or corrections that no car can follow"
            )


def check_inputs(inputs: Array, what: str) -> None:
    """Refuses inputs that compiled code must not meet.

    Args:
        inputs: (n, 13).
        what: what they belong to, for the message.

    Raises:
        TwinError: not finite, a torque beyond any car's, or a negative brake torque.
    """
    if inputs.ndim != 2 or inputs.shape[1] != len(INPUTS):
        raise TwinError(f"{what}: inputs have shape {inputs.shape}; allowed: (n, {len(INPUTS)})")
    low = np.array([CHANNEL[name].low for name in INPUTS])
    high = np.array([CHANNEL[name].high for name in INPUTS])
    good = (inputs >= low) & (inputs <= high)
    if not good.all():
        row, column = np.argwhere(~good)[0]
        raise TwinError(
            f"{what}: {INPUTS[column]} is {inputs[row, column]} in sample {row}; "
            f"allowed: {low[column]:g} to {high[column]:g}"
        )


def _vector(values: ArrayLike, size: int, what: str) -> Array:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise TwinError(
            f"{what}: needs {size} finite numbers, got shape {array.shape} with "
            f"{np.count_nonzero(~np.isfinite(array))} that are not finite"
        )
    return array
