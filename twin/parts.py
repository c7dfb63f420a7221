"""Sets what is neither load nor factor of a car: unsprung mass, roll centres, lift, dampers.

The other offsets of `twin.parameters` act where `twin.stepping` reads them.
"""

import math

import numpy as np
from numba import types

from twin.car_record import CAR
from twin.channels import WHEELS
from twin.compiled.boundary import VECTOR, behind
from twin.compiled.simd import inlined, pointer
from twin.parameters import OFFSETS, PARAMETER, P

_LOW = np.array([record.low for record in PARAMETER.values()])
_HIGH = np.array([record.high for record in PARAMETER.values()])


@inlined
def _set_roll_centres(car, share):
    """Leans the travels of the wheels as roll centres higher by a share of their height do."""
    axes = pointer(car.jnt_axis)
    for w in range(len(WHEELS)):
        axis, nominal = 3 * car.travel_joint[w], car.nominal_axis[w]
        if share == 0.0:  # to the bit what MuJoCo compiled
            for i in range(3):
                axes[axis + i] = nominal[i]
            continue
        across = nominal[1] * (1.0 + share)
        length = math.sqrt(nominal[0] * nominal[0] + across * across + nominal[2] * nominal[2])
        axes[axis] = nominal[0] / length
        axes[axis + 1] = across / length
        axes[axis + 2] = nominal[2] / length


@inlined
def _set_unsprung(car, share, before):
    """Masses of hubs and wheels, the wheels' inertia, and what stands above them in the tree."""
    if share == before:
        return
    mass, subtree = pointer(car.body_mass), pointer(car.body_subtreemass)
    inertia = pointer(car.body_inertia)
    more = 0.0
    for w in range(len(WHEELS)):
        hub, wheel = car.hub_body[w], car.wheel_body[w]
        mass[hub] = car.nominal_unsprung[0, w] * (1.0 + share)
        mass[wheel] = car.nominal_unsprung[1, w] * (1.0 + share)
        for i in range(3):
            inertia[3 * wheel + i] = car.nominal_unsprung[2 + i, w] * (1.0 + share)
        car.spin_inertia[w] = inertia[3 * wheel + 1]
        subtree[wheel], subtree[hub] = mass[wheel], mass[hub] + mass[wheel]
        more += car.nominal_unsprung[0, w] + car.nominal_unsprung[1, w]
    for i in range(2):
        car.other_mass[i] = car.nominal_other_mass[i] + share * more
    subtree[car.chassis] = mass[car.chassis] + car.other_mass[1]
    subtree[0] = mass[car.chassis] + car.other_mass[0]


@behind(types.void, CAR)
def restore_dampers(car):
    """Undoes what `twin.stepping` makes of the dampers in bump and rebound."""
    damping = pointer(car.dof_damping)
    for w in range(len(WHEELS)):
        damping[car.travel_dof[w]] = car.damping[w]


@behind(types.void, CAR, VECTOR)
def set_parts(car, p):
    """The part of `twin.kernel.set_parameters` behind the factors."""
    now, damping = car.parameters, pointer(car.dof_damping)
    for w in range(len(WHEELS)):
        car.damping[w] = damping[car.travel_dof[w]]
    for i in range(OFFSETS.start, OFFSETS.stop):
        p[i] = min(max(p[i], _LOW[i]), _HIGH[i])
    _set_unsprung(car, p[P.unsprung_mass], now[P.unsprung_mass])
    if p[P.roll_centre] != now[P.roll_centre]:
        _set_roll_centres(car, p[P.roll_centre])
    car.lift_area_front = car.nominal_lift_area[0] + 0.5 * p[P.lift]
    car.lift_area_rear = car.nominal_lift_area[1] + 0.5 * p[P.lift]
    for i in range(OFFSETS.start, OFFSETS.stop):
        now[i] = p[i]
