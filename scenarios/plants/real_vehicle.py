"""The vehicle of a real car: its parts changed before MuJoCo compiles them, and its tyres."""

from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenarios.plants.random_car import RealCar
from twin import WHEELS, Vehicle

_AXLE = {"fl": 0, "fr": 0, "rl": 1, "rr": 1}
_SIDE = {"fl": 1.0, "fr": -1.0, "rl": 1.0, "rr": -1.0}
# Fields of a tyre that a property scales, and which of its numbers
_TYRE_FACTORS = (
    ("slip_stiffness", 0, ("lkx",)),
    ("tyre_shape", 0, ("ley",)),
    ("tyre_shape", 1, ("lyka",)),
    ("tyre_shape", 2, ("pky2",)),
    ("relaxation", 0, ("lsgkp", "lsgal")),
    ("pneumatic_trail", 0, ("ltr",)),
    ("rolling_resistance", 0, ("lmy",)),
    ("rolling_radius", 0, ("unloaded_radius",)),
    ("tyre_pressure", 0, ("vertical_stiffness",)),
)
# The same by axle
_AXLE_FACTORS = (("tyre_friction", ("lmux", "lmuy")), ("cornering_stiffness", ("lky",)))


@dataclass(frozen=True, slots=True, kw_only=True)
class RealVehicle(Vehicle):
    """A vehicle of a file with the parts of one real car.

    Attributes:
        real: the car.
    """

    real: RealCar = field(default_factory=RealCar)

    def spec(self) -> mujoco.MjSpec:
        """The car as an editable MJCF, its parts changed."""
        spec = Vehicle.spec(self)
        real = self.real
        for wheel in WHEELS:
            axle = _AXLE[wheel]
            _change_wheel(spec, wheel, real["unsprung_mass"][axle], real.number("wheel_inertia"))
            joint = spec.joint(f"travel_{wheel}")
            joint.stiffness = joint.stiffness * real["springs"][axle]
            joint.springref = joint.springref / real["springs"][axle]
            joint.damping = joint.damping * real["dampers"][axle]
            half_track = abs(float(spec.body(f"hub_{wheel}").pos[1]))
            axis = np.array(joint.axis) / joint.axis[2]
            axis[1] += _SIDE[wheel] * real["roll_centres"][axle] / half_track
            joint.axis = axis
        for axle, name in enumerate(("front", "rear")):
            bar = spec.tendon(f"anti_roll_{name}")
            if bar is not None:
                bar.stiffness = bar.stiffness * real["anti_roll_bars"][axle]
            lift = spec.numeric(f"lift_area_{name}")
            lift.data = np.array(lift.data) + real["lift"][axle]
        for name, factor in (("drag_area", "drag"), ("steering_ratio", "steering_ratio")):
            numeric = spec.numeric(name)
            numeric.data = np.array(numeric.data) * real.number(factor)
        return spec

    def tyres(self) -> NDArray[np.void]:
        """Coefficients of the four tyres, (4,) records."""
        tyres = Vehicle.tyres(self)
        real = self.real
        for name, k, keys in _TYRE_FACTORS:
            for key in keys:
                tyres[key] = np.asarray(tyres[key], dtype=np.float64) * real[name][k]
        for name, keys in _AXLE_FACTORS:
            for key in keys:
                tyres[key] = np.asarray(tyres[key], dtype=np.float64) * np.repeat(real[name], 2)
        share, which = real["soft_tyre"]
        tyres["vertical_stiffness"][min(int(which), 3)] *= share
        return tyres


def _change_wheel(spec: mujoco.MjSpec, wheel: str, mass: float, inertia: float) -> None:
    """Scales the unsprung masses; the wheel's inertia grows along with its mass."""
    hub, body = spec.body(f"hub_{wheel}"), spec.body(f"wheel_{wheel}")
    for part, factor in ((hub, 1.0), (body, inertia)):
        part.mass = part.mass * mass
        part.inertia = np.array(part.inertia) * mass * factor


def real_vehicle(vehicle: Vehicle, real: RealCar) -> RealVehicle:
    """A vehicle, loads on board, with the parts of a real car."""
    return RealVehicle(source=vehicle.source, loads=vehicle.loads, scales=vehicle.scales, real=real)
