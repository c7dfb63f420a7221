"""The two-axle truck of KBF, Table 1, as numbers and as the matrices of Eq. (5)."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

STANDARD_GRAVITY = 9.81  # [m/s2]


@dataclass(frozen=True, slots=True, kw_only=True)
class SprungMass:
    """Chassis and load as one rigid body; the defaults are the nominal load of KBF, Table 1.

    Attributes:
        mass: m_s [kg].
        roll_inertia: J_x about the centre of mass [kg m2].
        pitch_inertia: J_y about the centre of mass [kg m2].
        yaw_inertia: J_z about the centre of mass [kg m2]; chosen, not in the paper.
        cm_x: how far the centre of mass lies ahead of the nominal one [m].
    """

    mass: float = 5394.0
    roll_inertia: float = 4600.0
    pitch_inertia: float = 19632.0
    yaw_inertia: float = 20000.0
    cm_x: float = 0.0

    def scaled(self, factor: float) -> "SprungMass":
        """Returns the body with `factor` times the mass and inertias, its centre kept."""
        return SprungMass(
            mass=factor * self.mass,
            roll_inertia=factor * self.roll_inertia,
            pitch_inertia=factor * self.pitch_inertia,
            yaw_inertia=factor * self.yaw_inertia,
            cm_x=self.cm_x,
        )

    @property
    def parameters(self) -> NDArray[np.float64]:
        """Vector p of KBF Eq. (8): mass [kg], roll and pitch inertia [kg m2]. Shape (3,)."""
        return np.array([self.mass, self.roll_inertia, self.pitch_inertia])


@dataclass(frozen=True, slots=True, kw_only=True)
class TruckParameters:
    """The truck without its load changes; the defaults are KBF, Table 1.

    Pairs are (front, rear), each for one wheel. Axle inertias are not in the paper: m_u t^2.

    Attributes:
        nominal: the sprung mass the filter starts from.
        axle_mass: m_uf, m_ur [kg].
        axle_roll_inertia: J_uf, J_ur [kg m2].
        spring_stiffness: c_s [N/m].
        damping: k_s [N s/m].
        tyre_stiffness: c_u [N/m].
        axle_distance: l_f, l_r, from the nominal centre of mass to the axle [m].
        half_track: t_f, t_r, half the distance of the wheels of an axle [m].
    """

    nominal: SprungMass = field(default_factory=SprungMass)
    axle_mass: tuple[float, float] = (266.0, 427.0)
    axle_roll_inertia: tuple[float, float] = (193.3, 238.6)
    spring_stiffness: tuple[float, float] = (177000.0, 193844.0)
    damping: tuple[float, float] = (7733.0, 9804.0)
    tyre_stiffness: tuple[float, float] = (493211.0, 986422.0)
    axle_distance: tuple[float, float] = (2.400, 1.685)
    half_track: tuple[float, float] = (0.8525, 0.7475)

    @property
    def wheelbase(self) -> float:
        """Distance of the axles [m]."""
        return sum(self.axle_distance)

    def body_geometry(self) -> NDArray[np.float64]:
        """G_s of Eq. (5): body heights at the wheels per (Z, roll, pitch). Shape (4, 3)."""
        (lf, lr), (tf, tr) = self.axle_distance, self.half_track
        return np.array([[1, tf, -lf], [1, -tf, -lf], [1, tr, lr], [1, -tr, lr]])

    def axle_geometry(self) -> NDArray[np.float64]:
        """G_u of Eq. (5): axle heights at the wheels per (Z_uf, Z_ur, roll_uf, roll_ur). (4, 4)."""
        tf, tr = self.half_track
        return np.array([[1, 0, tf, 0], [1, 0, -tf, 0], [0, 1, 0, tr], [0, 1, 0, -tr]])

    def excitation(self) -> NDArray[np.float64]:
        """H_2 of Eq. (6): [N, N m, N m] per four deflections [m] and rates [m/s]. Shape (3, 8)."""
        geometry = self.body_geometry().T
        return -np.hstack(
            [geometry * per_wheel(self.spring_stiffness), geometry * per_wheel(self.damping)]
        )

    def static_spring_loads(self, gravity: float) -> NDArray[np.float64]:
        """What each spring carries at rest under the nominal load [N]. Shape (4,)."""
        front, rear = self.axle_distance
        share = per_wheel((rear / (2 * self.wheelbase), front / (2 * self.wheelbase)))
        return share * self.nominal.mass * gravity


def per_wheel(pair: tuple[float, float]) -> NDArray[np.float64]:
    """Repeats a (front, rear) pair for the wheels fl fr rl rr. Shape (4,)."""
    return np.repeat(np.asarray(pair, dtype=float), 2)
