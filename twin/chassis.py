"""Sets mass, centre of mass and inertia of a car's chassis, kept physically valid."""

from numba import types

from twin.car_record import CAR
from twin.compiled.boundary import VECTOR, behind
from twin.compiled.libmujoco import mju_eig3
from twin.compiled.simd import inlined, pointer
from twin.parameters import INERTIA, P

# The least that is left of a chassis by corrections: of its mass, and of each principal moment.
LEAST_SHARE = 0.3
# An inertia is kept so far [-] inside the triangle inequality J_a <= J_b + J_c.
TRIANGLE_MARGIN = 1e-3


@inlined
def _make_valid(moments, least):
    """Lifts principal moments, in falling order, to what a rigid body can have; tells if it did."""
    changed = False
    for i in range(3):
        if not moments[i] >= least:
            moments[i] = least
            changed = True
    shortfall = moments[0] * (1.0 + TRIANGLE_MARGIN) - moments[1] - moments[2]
    if shortfall > 0.0:
        moments[0] -= shortfall / 3.0 / (1.0 + TRIANGLE_MARGIN)
        moments[1] += shortfall / 3.0
        moments[2] += shortfall / 3.0
        changed = True
    return changed


@inlined
def _set_inertia(car, p):
    """Writes moments and axes of nominal + p[INERTIA], made valid; p receives what was set."""
    n = car.nominal
    values, inertia, quat = car.moments, pointer(car.body_inertia), pointer(car.body_iquat)
    unloaded = True
    for i in range(INERTIA.start, INERTIA.stop):
        unloaded = unloaded and p[i] == 0.0
    if unloaded:  # to the bit what MuJoCo compiled
        for i in range(3):
            inertia[3 * car.chassis + i] = car.compiled_inertia[i]
        for i in range(4):
            quat[4 * car.chassis + i] = car.compiled_inertia[3 + i]
        return
    xx, yy, zz = n[P.Jxx] + p[P.Jxx], n[P.Jyy] + p[P.Jyy], n[P.Jzz] + p[P.Jzz]
    xy, xz, yz = n[P.Jxy] + p[P.Jxy], n[P.Jxz] + p[P.Jxz], n[P.Jyz] + p[P.Jyz]
    tensor, vectors = car.tensor, car.vectors
    tensor[0, 0], tensor[1, 1], tensor[2, 2] = xx, yy, zz
    tensor[0, 1], tensor[0, 2], tensor[1, 2] = xy, xz, yz
    tensor[1, 0], tensor[2, 0], tensor[2, 1] = xy, xz, yz
    address = car.body_iquat + 8 * 4 * car.chassis
    mju_eig3(values.ctypes.data, vectors.ctypes.data, address, tensor.ctypes.data)
    if _make_valid(values, LEAST_SHARE * min(n[P.Jxx], n[P.Jyy], n[P.Jzz])):
        for i in range(3):
            for j in range(3):
                total = 0.0
                for k in range(3):
                    total += vectors[i, k] * values[k] * vectors[j, k]
                tensor[i, j] = total
        p[P.Jxx], p[P.Jyy] = tensor[0, 0] - n[P.Jxx], tensor[1, 1] - n[P.Jyy]
        p[P.Jzz], p[P.Jxy] = tensor[2, 2] - n[P.Jzz], tensor[0, 1] - n[P.Jxy]
        p[P.Jxz], p[P.Jyz] = tensor[0, 2] - n[P.Jxz], tensor[1, 2] - n[P.Jyz]
    for i in range(3):
        inertia[3 * car.chassis + i] = values[i]


@behind(types.void, CAR, VECTOR)
def set_load(car, p):
    """See `twin.kernel.set_parameters`."""
    now, nominal, chassis = car.parameters, car.nominal, car.chassis
    p[P.mass] = max(p[P.mass], (LEAST_SHARE - 1.0) * nominal[P.mass])
    mass, subtree = nominal[P.mass] + p[P.mass], pointer(car.body_subtreemass)
    pointer(car.body_mass)[chassis] = mass
    subtree[chassis] = mass + car.other_mass[1]
    subtree[0] = mass + car.other_mass[0]
    now[P.mass] = p[P.mass]
    cm = pointer(car.body_ipos)
    for i in range(3):
        k = P.cm_x + i
        now[k] = p[k]
        cm[3 * chassis + i] = nominal[k] + p[k]
    same = True
    for i in range(INERTIA.start, INERTIA.stop):
        same = same and p[i] == now[i]
    if not same:
        _set_inertia(car, p)
        for i in range(INERTIA.start, INERTIA.stop):
            now[i] = p[i]
