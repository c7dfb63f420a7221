"""Reads and corrects the states of a car, in tangent space."""

import math

from numba import types

from twin.car_record import CAR
from twin.channels import X
from twin.compiled.boundary import VECTOR, behind
from twin.compiled.simd import inlined, pointer
from twin.tyre.contact import combine, cross

NQ, NV = 15, 14  # sizes of qpos and qvel of a car


@inlined
def _rotate(q, v):
    """Turns a vector of the body frame into the world."""
    axis = (q[1], q[2], q[3])
    t = cross(axis, v)
    t = (2.0 * t[0], 2.0 * t[1], 2.0 * t[2])
    return combine(1.0, v, q[0], t, 1.0, cross(axis, t))


@inlined
def _unrotate(q, v):
    """Turns a vector of the world into the body frame."""
    return _rotate((q[0], -q[1], -q[2], -q[3]), v)


@behind(types.void, CAR, VECTOR)
def correct_states(car, dx):
    """See `twin.kernel.correct`."""
    qpos, qvel = pointer(car.qpos), pointer(car.qvel)
    w, x, y, z = qpos[3], qpos[4], qpos[5], qpos[6]
    vx, vy, vz = _unrotate((w, x, y, z), (qvel[0], qvel[1], qvel[2]))
    angle = math.sqrt(dx[X.roll] ** 2 + dx[X.pitch] ** 2 + dx[X.yaw] ** 2)
    if angle > 0.0:
        scale, c = math.sin(0.5 * angle) / angle, math.cos(0.5 * angle)
        a, b, d = scale * dx[X.roll], scale * dx[X.pitch], scale * dx[X.yaw]
        w, x, y, z = (
            w * c - x * a - y * b - z * d,
            w * a + x * c + y * d - z * b,
            w * b - x * d + y * c + z * a,
            w * d + x * b - y * a + z * c,
        )
        norm = math.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w / norm, x / norm, y / norm, z / norm
        qpos[3], qpos[4], qpos[5], qpos[6] = w, x, y, z
    velocity = _rotate((w, x, y, z), (vx + dx[X.vx], vy + dx[X.vy], vz + dx[X.vz]))
    for i in range(3):
        qpos[i] += dx[X.x + i]
        qvel[i] = velocity[i]
        qvel[3 + i] += dx[X.roll_rate + i]
    for i in range(4):
        qpos[car.travel_qpos[i]] += dx[X.suspension_travel_fl + i]
        qpos[car.spin_qpos[i]] += dx[X.wheel_angle_fl + i]
        qvel[car.travel_dof[i]] += dx[X.suspension_rate_fl + i]
        qvel[car.spin_dof[i]] += dx[X.wheel_speed_fl + i]


@behind(types.void, CAR, VECTOR)
def copy_states(car, x):
    """See `twin.kernel.read_states`."""
    qpos, qvel = pointer(car.qpos), pointer(car.qvel)
    q = (qpos[3], qpos[4], qpos[5], qpos[6])
    ahead, left, up = (
        _rotate(q, (1.0, 0.0, 0.0)),
        _rotate(q, (0.0, 1.0, 0.0)),
        _rotate(q, (0.0, 0.0, 1.0)),
    )
    x[X.roll] = math.atan2(left[2], up[2])
    x[X.pitch] = -math.asin(min(max(ahead[2], -1.0), 1.0))
    x[X.yaw] = math.atan2(ahead[1], ahead[0])
    velocity = _unrotate(q, (qvel[0], qvel[1], qvel[2]))
    for i in range(3):
        x[X.x + i] = qpos[i]
        x[X.vx + i] = velocity[i]
        x[X.roll_rate + i] = qvel[3 + i]
    for i in range(4):
        x[X.suspension_travel_fl + i] = qpos[car.travel_qpos[i]]
        x[X.wheel_angle_fl + i] = qpos[car.spin_qpos[i]]
        x[X.suspension_rate_fl + i] = qvel[car.travel_dof[i]]
        x[X.wheel_speed_fl + i] = qvel[car.spin_dof[i]]


@behind(types.int32, CAR)
def states_are_sound(car):
    """See `twin.kernel.is_sound`."""
    qpos, qvel = pointer(car.qpos), pointer(car.qvel)
    for i in range(NV):
        if not abs(qvel[i]) < 1e6:
            return 0
    for i in range(NQ):
        if not abs(qpos[i]) < 1e9:
            return 0
    return 1
