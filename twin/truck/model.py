"""The truck of KBF in MuJoCo: load steps, gravity, process noise, and what its sensors record."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

import models
from twin.errors import TwinError
from twin.truck.parameters import SprungMass, TruckParameters, per_wheel

Array = NDArray[np.float64]

RATES = ("vz", "roll_rate", "pitch_rate")
"""Measured velocities of the chassis [m/s, rad/s, rad/s], y_02 of KBF Eq. (8)."""

DEFLECTIONS = tuple(
    f"{kind}_{wheel}"
    for kind in ("deflection", "deflection_rate")
    for wheel in ("fl", "fr", "rl", "rr")
)
"""Suspension deflections z_s - z_u [m] and their rates [m/s], u_02 of KBF Eq. (8)."""

_WHEELS = ("fl", "fr", "rl", "rr")
_CONTROL = mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED
_PHYSICS = mujoco.mjtState.mjSTATE_FULLPHYSICS


class LoadStage(NamedTuple):
    """A sprung mass from a time on.

    Attributes:
        start: [s].
        load: the sprung mass from then on.
    """

    start: float
    load: SprungMass


class TruckRecord(NamedTuple):
    """What a run recorded, each row at the beginning of its sample.

    Attributes:
        time: [s]. Shape (n,).
        road_heights: [m] under fl fr rl rr. Shape (n, 4).
        rates: free of noise, columns `RATES`. Shape (n, 3).
        deflections: columns `DEFLECTIONS`. Shape (n, 8).
        parameters: mass [kg], roll and pitch inertia [kg m2] of the load. Shape (n, 3).
        positions: joints (chassis heave, roll, pitch; front axle heave, roll; rear axle heave,
            roll) [m, rad]. Shape (n, 7).
        velocities: of the joints [m/s, rad/s]. Shape (n, 7).
    """

    time: Array
    road_heights: Array
    rates: Array
    deflections: Array
    parameters: Array
    positions: Array
    velocities: Array


class Truck:
    """The compiled truck model; one run after another starts from rest."""

    def __init__(self, parameters: TruckParameters | None = None, *, gravity: float = 0.0):
        """Loads models/truck.xml and writes the parameters into it.

        Args:
            parameters: by default KBF, Table 1, which the file holds already.
            gravity: [m/s2], 0 as in the paper; springs and tyres get the preload that makes zero
                the equilibrium of the nominal load.
        """
        self.parameters = parameters or TruckParameters()
        self.gravity = gravity
        self.model = mujoco.MjModel.from_xml_path(str(models.path("truck")))
        self._write_parameters()
        self.set_load(self.parameters.nominal)

    def set_load(self, load: SprungMass) -> None:
        """Gives the chassis the mass, inertia and centre of mass of a load; the state stays."""
        model, chassis = self.model, self.model.body("chassis").id
        model.body_mass[chassis] = load.mass
        model.body_inertia[chassis] = (load.roll_inertia, load.pitch_inertia, load.yaw_inertia)
        model.body_ipos[chassis] = (load.cm_x, 0.0, 0.0)
        model.body_sameframe[chassis] = 0  # otherwise MuJoCo ignores body_ipos
        mujoco.mj_setConst(model, mujoco.MjData(model))

    def record(
        self,
        road_heights: Array,
        stages: Sequence[LoadStage] = (),
        acceleration_noise: Array | None = None,
    ) -> TruckRecord:
        """Runs the truck over a road, from rest at zero, one sample per time step of the model.

        Args:
            road_heights: [m] under fl fr rl rr, held over each step. Shape (n, 4).
            stages: loads in the order of their start; before the first one the load is nominal.
            acceleration_noise: process noise of KBF, on the seven accelerations in the order of
                `TruckRecord.positions` [m/s2, rad/s2], held over each step. Shape (n, 7).
        """
        n = len(road_heights)
        _check(road_heights, (n, 4), "road_heights")
        noise = np.zeros((n, 7)) if acceleration_noise is None else acceleration_noise
        _check(noise, (n, 7), "acceleration_noise")
        data = mujoco.MjData(self.model)
        state = np.empty(mujoco.mj_stateSize(self.model, _PHYSICS))
        mujoco.mj_getState(self.model, data, state, _PHYSICS)
        states, sensors, truth = [state[None]], [], []
        for first, last, load in self._segments(stages, n):
            self.set_load(load)
            force = noise[first:last] * self._inertias(load)
            control = np.hstack([road_heights[first:last], force])
            after, sensed = rollout.rollout(
                self.model, data, states[-1][-1], control, control_spec=_CONTROL
            )
            states.append(np.asarray(after)[0])
            sensors.append(np.asarray(sensed)[0])
            truth.append(np.tile(load.parameters, (last - first, 1)))
        return self._collect(road_heights, states, sensors, truth)

    def _collect(
        self, road_heights: Array, states: list[Array], sensors: list[Array], truth: list[Array]
    ) -> TruckRecord:
        n, dof = len(road_heights), self.model.nv
        time = np.arange(n) * self.model.opt.timestep
        state, sensed = np.vstack(states)[:-1], np.vstack(sensors)
        if not np.isfinite(state).all() or not np.allclose(state[:, 0], time):
            raise TwinError("truck: the simulation diverged; road_heights must be sane heights [m]")
        return TruckRecord(
            time=time,
            road_heights=road_heights,
            rates=sensed[:, :3],
            deflections=sensed[:, 3:],
            parameters=np.vstack(truth),
            positions=state[:, 1 : 1 + dof],
            velocities=state[:, 1 + dof : 1 + 2 * dof],
        )

    def _segments(self, stages: Sequence[LoadStage], n: int) -> list[tuple[int, int, SprungMass]]:
        starts = [0, *(round(stage.start / self.model.opt.timestep) for stage in stages), n]
        loads = [self.parameters.nominal, *(stage.load for stage in stages)]
        if starts != sorted(starts):
            raise TwinError("truck stages: starts must rise from 0 s to the end of the road")
        spans = zip(starts[:-1], starts[1:], loads, strict=True)
        return [(first, last, load) for first, last, load in spans if last > first]

    def _inertias(self, load: SprungMass) -> Array:
        """Mass matrix at rest, with the centre of mass at its nominal place. Shape (7,)."""
        p = self.parameters
        axles = np.column_stack([p.axle_mass, p.axle_roll_inertia]).ravel()
        return np.concatenate([load.parameters, axles])

    def _write_parameters(self) -> None:
        p, model = self.parameters, self.model
        model.opt.gravity[2] = -self.gravity
        for body, mass, inertia in zip(
            ("front_axle", "rear_axle"), p.axle_mass, p.axle_roll_inertia, strict=True
        ):
            model.body_mass[model.body(body).id] = mass
            model.body_inertia[model.body(body).id, 0] = inertia
        spring_load = p.static_spring_loads(self.gravity)
        stiffness, damping = per_wheel(p.spring_stiffness), per_wheel(p.damping)
        tyre = per_wheel(p.tyre_stiffness)
        body, axle_roll = p.body_geometry(), p.axle_geometry()[:, 2:].sum(axis=1)
        tyre_load = spring_load + per_wheel(p.axle_mass) * self.gravity / 2
        for i, wheel in enumerate(_WHEELS):
            tendon = model.tendon(f"suspension_{wheel}").id
            coefficients = model.wrap_prm[model.tendon_adr[tendon] :][:5]
            coefficients[1:] = (*body[i, 1:], -1.0, -axle_roll[i])
            model.tendon_stiffness[tendon] = stiffness[i]
            model.tendon_damping[tendon] = damping[i]
            model.tendon_lengthspring[tendon] = spring_load[i] / stiffness[i]
            tyre_tendon = model.tendon(f"tyre_{wheel}").id
            model.wrap_prm[model.tendon_adr[tyre_tendon] + 1] = axle_roll[i]
            actuator = model.actuator(f"road_height_{wheel}").id
            model.actuator_gainprm[actuator, 0] = tyre[i]
            model.actuator_biasprm[actuator, :2] = (tyre_load[i], -tyre[i])


def _check(array: Array, shape: tuple[int, int], name: str) -> None:
    if array.shape != shape or not np.isfinite(array).all():
        raise TwinError(f"truck {name}: shape {array.shape}, must be finite and of shape {shape}")
