"""The truck as the exact linear state space KBF (3)-(5): the reference of the MuJoCo model."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from twin.truck.parameters import SprungMass, TruckParameters, per_wheel

Array = NDArray[np.float64]


class StateSpace(NamedTuple):
    """KBF Eq. (3). State x = [z, dz/dt], z = (Z, roll, pitch, Z_uf, Z_ur, roll_uf, roll_ur).

    Attributes:
        a: A_01. Shape (14, 14).
        b: B_01, per road height [m] at fl fr rl rr. Shape (14, 4).
        c: C_01, to four deflections [m] and four rates [m/s]. Shape (8, 14).
    """

    a: Array
    b: Array
    c: Array


def state_space(truck: TruckParameters, load: SprungMass | None = None) -> StateSpace:
    """Builds the matrices of KBF Eqs. (4)-(5); D_01 is zero.

    Args:
        truck: the truck.
        load: the sprung mass, by default the nominal one; its `cm_x` must be zero, the paper's
            fourth assumption.
    """
    load = load or truck.nominal
    body, axles = truck.body_geometry(), truck.axle_geometry()
    deflection = np.hstack([body, -axles])
    axle_height = np.hstack([np.zeros((4, 3)), axles])
    spring, damper, tyre = (
        np.diag(per_wheel(pair))
        for pair in (truck.spring_stiffness, truck.damping, truck.tyre_stiffness)
    )
    mass = np.concatenate([load.parameters, truck.axle_mass, truck.axle_roll_inertia])
    stiffness = deflection.T @ spring @ deflection + axle_height.T @ tyre @ axle_height
    damping = deflection.T @ damper @ deflection
    input_force = axle_height.T @ tyre
    a = np.block(
        [[np.zeros((7, 7)), np.eye(7)], [-stiffness / mass[:, None], -damping / mass[:, None]]]
    )
    b = np.vstack([np.zeros((7, 4)), input_force / mass[:, None]])
    empty = np.zeros_like(deflection)
    output = np.block([[deflection, empty], [empty, deflection]])
    return StateSpace(a, b, output)


def simulate(system: StateSpace, road_heights: Array, sample_time: float) -> Array:
    """Solves the linear system exactly for road heights held over each sample, from rest.

    Args:
        system: the state space.
        road_heights: [m], fl fr rl rr. Shape (n, 4).
        sample_time: [s].

    Returns:
        States at the beginning of each sample. Shape (n, 14).
    """
    n_state, n_input = system.b.shape
    generator = np.zeros((n_state + n_input, n_state + n_input))
    generator[:n_state] = np.hstack([system.a, system.b])
    transition = expm(generator * sample_time)[:n_state]
    states = np.zeros((len(road_heights), n_state))
    for k in range(len(road_heights) - 1):
        states[k + 1] = transition @ np.concatenate([states[k], road_heights[k]])
    return states
