"""Loads as point masses on a rigid chassis: mass, centre of mass and inertia, TiL Eqs. (6)-(8).

The printed equations carry errors. Eq. (6) has to be divided by the total mass; in Eq. (8) the
chassis' own term has to be added, as the theorem of Huygens-Steiner says, and the products of
inertia change likewise. Here they are entries of the inertia tensor: Jxy = -sum m x y.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import TwinError
from twin.parameters import LOAD, PARAMETERS

# The entries of the inertia tensor in the order of `twin.parameters.LOAD`
_ROWS, _COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)
# Rounding that a valid inertia may show, of its largest entry
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RigidBody:
    """Mass, centre of mass and inertia of a body, in the axes of its frame.

    Attributes:
        mass: [kg], positive.
        cm: (3,) centre of mass in the frame [m].
        inertia: (3, 3) about the centre of mass [kg m2]: symmetric, positive definite, and no
            principal moment above the sum of the others.

    Raises:
        TwinError: no distribution of mass has these values.
    """

    mass: float
    cm: NDArray[np.float64]
    inertia: NDArray[np.float64]

    def __post_init__(self) -> None:
        if not 0.0 < self.mass < np.inf:
            raise TwinError(f"body: mass is {self.mass:g} kg, must be positive and finite")
        inertia = _finite("body: inertia", self.inertia, (3, 3))
        _check_inertia(inertia)
        object.__setattr__(self, "cm", _finite("body: cm", self.cm, (3,)))
        object.__setattr__(self, "inertia", inertia)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointMass:
    """A load small beside the chassis: a passenger, luggage.

    Attributes:
        name: what it is, for messages.
        mass: [kg], not negative.
        position: (3,) in the frame of the chassis [m].

    Raises:
        TwinError: the mass is negative, or a value is not finite.
    """

    name: str
    mass: float
    position: NDArray[np.float64]

    def __post_init__(self) -> None:
        if not 0.0 <= self.mass < np.inf:
            raise TwinError(f"load {self.name}: mass is {self.mass:g} kg, must not be negative")
        position = _finite(f"load {self.name}: position", self.position, (3,))
        object.__setattr__(self, "position", position)


def loaded(body: RigidBody, masses: Sequence[PointMass]) -> RigidBody:
    """The body with the loads fixed to it, TiL Eqs. (6)-(8) corrected."""
    total = body.mass + sum(load.mass for load in masses)
    moment = body.mass * body.cm + sum(load.mass * load.position for load in masses)
    cm = moment / total
    inertia = body.inertia + steiner(body.mass, body.cm - cm)
    for load in masses:
        inertia = inertia + steiner(load.mass, load.position - cm)
    return RigidBody(mass=total, cm=cm, inertia=inertia)


def steiner(mass: float, offset: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) inertia [kg m2] of a point mass [kg] at an offset (3,) [m] from the origin."""
    return mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))


def parameter_deltas(nominal: RigidBody, changed: RigidBody) -> NDArray[np.float64]:
    """(20,) change of `twin.PARAMETERS` [kg, m, kg m2], each inertia about its body's own CM.

    A load changes no scale and pushes no axle: those are zero.
    """
    rest = np.zeros(len(PARAMETERS) - len(LOAD))
    return np.append(_parameters(changed) - _parameters(nominal), rest)


def _parameters(body: RigidBody) -> NDArray[np.float64]:
    return np.array([body.mass, *body.cm, *body.inertia[_ROWS, _COLUMNS]])


def _finite(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise TwinError(f"{name} is {array.tolist()}, must be finite numbers of shape {shape}")
    array.setflags(write=False)
    return array


def _check_inertia(inertia: NDArray[np.float64]) -> None:
    rounding = _ROUNDING * np.abs(inertia).max()
    if np.abs(inertia - inertia.T).max() > rounding:
        raise TwinError(f"body: inertia is {inertia.tolist()}, must be symmetric")
    principal = np.linalg.eigvalsh(inertia)
    shown = ", ".join(f"{moment:g}" for moment in principal)
    if principal[0] <= 0.0:
        raise TwinError(f"body: principal inertias are {shown} kg m2, must be positive")
    if principal[2] > principal[0] + principal[1] + rounding:
        raise TwinError(
            f"body: principal inertias are {shown} kg m2, none may exceed the sum of the others"
        )
