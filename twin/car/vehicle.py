"""A vehicle: an MJCF or TOML file with its steering, aerodynamics, tyres and loads, checked."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

import models
from twin.car.calibrated import calibrated_of
from twin.car.deltas import apply_deltas, check_deltas
from twin.car.fields import BOUNDS
from twin.car.figures import OPTIONAL, Figures, Grip, figures_of, grip_of, number
from twin.car.geometry import check_geometry
from twin.car.load import PointMass, RigidBody
from twin.car.mjcf import read_mjcf, tyre_path
from twin.car.toml_car import car_spec, car_tyres
from twin.channels import CHANNEL, OUTPUTS, WHEELS
from twin.errors import TwinError
from twin.parameters import LARGEST_SCALE, LEAST_SCALE
from twin.scales import VEHICLE_SCALES, scale_model, scale_tyres
from twin.toml_file import read_toml
from twin.tyre.files import read_tyre_file

# Numbers of <custom> that every car needs, with the least and largest that are allowed
NUMBERS = {
    "steering_ratio": (1e-3, np.inf),
    "ackermann": (0.0, np.inf),
    "drag_area": (0.0, np.inf),  # c_D A [m2]
    "lift_area_front": (-10.0, np.inf),  # -c_L A of each axle [m2], positive pushes down
    "lift_area_rear": (-10.0, np.inf),
}
# Sensors that measure the outputs, and the kind of each
SENSORS = {CHANNEL[name].sensor: CHANNEL[name].sensor_kind for name in OUTPUTS}


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """A car by its files, and what it carries. It can be pickled; a `Twin` of it cannot.

    Attributes:
        source: the MJCF file, or the TOML file of `twin.car.fields`.
        loads: point masses fixed to the chassis as bodies of their own.
        scales: what differs from the files by a factor, see `scaled`.
        deltas: what the chassis differs in from the files, see `changed`.
        calibration: what a calibration found beyond the car, by name: offsets of sensors, noises.
        fields: what fields of a TOML file are, in place of what it says, see `with_fields`.
    """

    source: Path
    loads: tuple[PointMass, ...] = ()
    scales: tuple[tuple[str, float], ...] = ()
    deltas: tuple[tuple[str, float], ...] = ()
    calibration: tuple[tuple[str, float], ...] = ()
    fields: tuple[tuple[str, float], ...] = ()

    @classmethod
    def load(cls, name: str | Path) -> "Vehicle":
        """A car of the project by its name ("suv"), or of any MJCF or TOML file by its path.

        A TOML file may be one that `til calibrate` wrote: another car, and what differs from it.

        Raises:
            TwinError: no such file, or one that does not describe a car; the message says why.
        """
        source = models.path(str(name))
        if source.suffix == ".toml" and source.is_file():
            found = calibrated_of(source, read_toml(source))
            if found is not None:
                base = cls.load(found.base)
                car = base.scaled(**found.scales).changed(**found.deltas)
                return replace(car, calibration=tuple(found.further.items()))
        vehicle = cls(source=source)
        vehicle.compile()
        return vehicle

    def with_loads(self, loads: Iterable[PointMass]) -> "Vehicle":
        """The same car with more point masses on board, positions in the chassis frame."""
        return replace(self, loads=(*self.loads, *loads))

    def scaled(self, **factors: float) -> "Vehicle":
        """The same car but for factors of `twin.scales.VEHICLE_SCALES`, as in `spring=1.1`.

        Raises:
            TwinError: a name is unknown or a factor out of range.
        """
        for name, factor in factors.items():
            if name not in VEHICLE_SCALES:
                raise TwinError(
                    f"{self.source}: scale {name!r} is unknown; allowed: "
                    f"{', '.join(VEHICLE_SCALES)}"
                )
            if not LEAST_SCALE <= factor <= LARGEST_SCALE:
                raise TwinError(
                    f"{self.source}: scale {name} is {factor}; allowed: {LEAST_SCALE} to "
                    f"{LARGEST_SCALE}"
                )
        before = dict(self.scales)
        merged = before | {name: before.get(name, 1.0) * f for name, f in factors.items()}
        return replace(self, scales=tuple(merged.items()))

    def changed(self, **deltas: float) -> "Vehicle":
        """The same car but for deltas of its chassis, of `twin.LOAD`, as in `mass=85.0` [SI].

        Raises:
            TwinError: a name is unknown, or no rigid body is so.
        """
        check_deltas(self.source, deltas)
        before = dict(self.deltas)
        merged = before | {name: before.get(name, 0.0) + d for name, d in deltas.items()}
        vehicle = replace(self, deltas=tuple(merged.items()))
        vehicle.compile()
        return vehicle

    def with_fields(self, values: Mapping[str, float]) -> "Vehicle":
        """The same car with other values of its TOML file's fields [SI].

        Args:
            values: by section and field, as "chassis.Jzz"; what is out of a field's range is taken
                to its end.

        Raises:
            TwinError: the car is an MJCF file, a field is unknown or a value not finite, or no car
                is so.
        """
        if self.source.suffix != ".toml":
            raise TwinError(f"{self.source}: has no fields; allowed: a TOML file")
        for name, value in values.items():
            if name not in BOUNDS:
                raise TwinError(f"{self.source}: has no field {name!r}")
            if not np.isfinite(value):
                raise TwinError(f"{self.source}: {name} is {value}; allowed: a finite number")
        vehicle = replace(self, fields=tuple((dict(self.fields) | dict(values)).items()))
        vehicle.compile()
        return vehicle

    def spec(self) -> mujoco.MjSpec:
        """The car as an editable MJCF, loads attached.

        Raises:
            TwinError: the file is missing or broken.
        """
        if not self.source.is_file():
            raise TwinError(
                f"{self.source}: no such vehicle file; give an MJCF or TOML file or a car's name"
            )
        is_toml = self.source.suffix == ".toml"
        spec = car_spec(self.source, dict(self.fields)) if is_toml else read_mjcf(self.source)
        for load in self.loads:
            body = spec.body("chassis").add_body(name=load.name, pos=load.position)
            body.ipos = np.zeros(3)
            body.mass = load.mass
            body.inertia = np.full(3, 1e-9)
            body.explicitinertial = True
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                size=[0.5 * (3.0 * load.mass / (4.0 * np.pi * 1000.0)) ** (1 / 3), 0, 0],
                rgba=[0.85, 0.45, 0.1, 1.0],
                mass=0.0,
                contype=0,
                conaffinity=0,
            )
        return spec

    def compile(self) -> mujoco.MjModel:
        """The model, checked so that nothing in compiled code can meet a missing part.

        Raises:
            TwinError: something a car needs is missing or out of range.
        """
        try:
            model = self.spec().compile()
        except (ValueError, mujoco.FatalError) as error:
            raise TwinError(f"{self.source}: {' '.join(str(error).split())}") from None
        self._check(model)
        scale_model(model, dict(self.scales))
        apply_deltas(model, dict(self.deltas), self.source)
        return model

    def _check(self, model: mujoco.MjModel) -> None:
        kinds = {
            "body": (mujoco.mjtObj.mjOBJ_BODY, ("chassis", *(f"wheel_{w}" for w in WHEELS))),
            "joint": (
                mujoco.mjtObj.mjOBJ_JOINT,
                ("chassis", *(f"{j}_{w}" for w in WHEELS for j in ("travel", "spin"))),
            ),
            "sensor": (mujoco.mjtObj.mjOBJ_SENSOR, tuple(SENSORS)),
            "site": (mujoco.mjtObj.mjOBJ_SITE, ("imu",)),
            "numeric": (mujoco.mjtObj.mjOBJ_NUMERIC, tuple(NUMBERS)),
            "text": (mujoco.mjtObj.mjOBJ_TEXT, ("tyre_front", "tyre_rear")),
        }
        for kind, (code, names) in kinds.items():
            for name in names:
                if mujoco.mj_name2id(model, code, name) < 0:
                    raise TwinError(f"{self.source}: has no {kind} named {name!r}; a car needs one")
        for name, kind in SENSORS.items():
            if model.sensor(name).type[0] != getattr(mujoco.mjtSensor, f"mjSENS_{kind.upper()}"):
                raise TwinError(f"{self.source}: sensor {name} must be of the kind {kind}")
        if model.site("imu").pos.any():
            raise TwinError(f"{self.source}: site imu must stand at the origin of the chassis")
        if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_AUTORESET:
            raise TwinError(f"{self.source}: option flag autoreset must be disable")
        if (model.nq, model.nv) != (15, 14) or model.jnt_type[0] != mujoco.mjtJoint.mjJNT_FREE:
            raise TwinError(
                f"{self.source}: has {model.nv} degrees of freedom; a car has 14: chassis on a "
                "free joint that comes first, four travels, four spins"
            )
        if model.opt.integrator not in (
            mujoco.mjtIntegrator.mjINT_EULER,
            mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
        ):
            raise TwinError(f"{self.source}: option integrator must be Euler or implicitfast")
        optional = {name: bounds[1:] for name, bounds in OPTIONAL.items()}
        for name, (least, largest) in (NUMBERS | optional).items():
            value = number(model, name)
            if not (least <= value <= largest and value < np.inf):
                upper = "" if largest == np.inf else f" and at most {largest:g}"
                raise TwinError(
                    f"{self.source}: numeric {name} is {value}; allowed: at least {least}{upper}"
                )
        check_geometry(self.source, model)

    def tyres(self) -> np.ndarray:
        """Coefficients of the four tyres, (4,) records; .tir files beside the MJCF come first.

        Raises:
            TwinError: a .tir file is missing or broken.
        """
        if self.source.suffix == ".toml":
            read = car_tyres(self.source, dict(self.fields))
        else:
            texts = _texts(self.compile(), "tyre_front", "tyre_rear")
            read = [read_tyre_file(tyre_path(self.source, name)) for name in texts]
        tyres = np.array([read[0], read[0], read[1], read[1]], dtype=read[0].dtype)
        scale_tyres(tyres, dict(self.scales))
        return tyres

    @cached_property
    def figures(self) -> Figures:
        """Masses, sizes, steering, drive and air of the car with its loads.

        Raises:
            TwinError: a file is missing or broken.
        """
        return figures_of(self.compile(), self.tyres())

    @cached_property
    def grip(self) -> Grip:
        """Cornering stiffness and friction of the axles.

        Raises:
            TwinError: a file is missing or broken.
        """
        return grip_of(self.figures, self.tyres())

    def chassis(self) -> RigidBody:
        """Mass, CM and inertia of the chassis and all that is fixed to it, in the chassis frame."""
        model = self.compile()
        chassis = model.body("chassis").id
        welded = np.flatnonzero(model.body_weldid == chassis)
        data = mujoco.MjData(model)
        data.qpos[3:7] = 1.0, 0.0, 0.0, 0.0
        mujoco.mj_kinematics(model, data)
        origin = data.xpos[chassis]
        masses = model.body_mass[welded]
        places = data.xipos[welded] - origin
        cm = masses @ places / masses.sum()
        inertia = np.zeros((3, 3))
        for body, mass, place in zip(welded, masses, places - cm, strict=True):
            axes = data.ximat[body].reshape(3, 3)
            inertia += axes @ np.diag(model.body_inertia[body]) @ axes.T
            inertia += mass * (place @ place * np.eye(3) - np.outer(place, place))
        return RigidBody(mass=float(masses.sum()), cm=cm, inertia=inertia)


def _texts(model: mujoco.MjModel, *names: str) -> list[str]:
    """Texts of <custom> by their names."""
    texts = []
    for name in names:
        text = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, name)
        start = model.text_adr[text]
        texts.append(model.text_data[start : start + model.text_size[text] - 1].decode())
    return texts
