"""The black box: three compiled functions step, correct and set the parameters of a `Car`.

They are the whole boundary between an observer and the simulator; `read_states` looks without
touching. All are `@njit`: Python and compiled loops call the same code.
"""

import math

from numba import njit

from twin.contact import combine, cross, dot, wheel_contact
from twin.library import mj_step1, mj_step2, mju_eig3

# A call copies the whole tuple `car`; what runs for each wheel is inlined.
inlined = njit(cache=True, forceinline=True)

AIR_DENSITY = 1.2  # [kg/m3]
# The least that is left of a chassis by corrections: of its mass, and of each principal moment.
LEAST_SHARE = 0.3
# An inertia is kept so far [-] inside the triangle inequality J_a <= J_b + J_c.
TRIANGLE_MARGIN = 1e-3


@njit(cache=True, nogil=True)
def step(car, u, y):
    """Advances the car by one step of MuJoCo with tyre forces: TiL Eq. (1).

    Outputs and tyre forces belong to the state before the step, as MuJoCo's sensors do.

    Args:
        car: the car.
        u: (13,) inputs, `twin.channels.INPUTS`.
        y: (10,) receives the measurements, `twin.channels.OUTPUTS`.
    """
    _steer(car, u[0])
    mj_step1(car.model, car.data)
    car.qfrc_applied[:6] = 0.0
    _drag(car)
    normal = _road_normal(car, u[9:13])
    for w in range(4):
        _wheel(car, w, u[1 + w], u[5 + w], u[9 + w], normal)
    mj_step2(car.model, car.data)
    for i in range(y.size):
        y[i] = car.sensordata[car.sensor[i]]


@inlined
def _steer(car, hand_wheel):
    """Turns the front wheels: steering is an input, no degree of freedom."""
    tangent = math.tan(hand_wheel / car.steering_ratio)
    inner = 0.5 * car.ackermann * car.track / car.wheelbase * tangent
    for w in range(2):
        side = 1.0 if w == 0 else -1.0
        half = 0.5 * math.atan(tangent / (1.0 - side * inner))
        quat = car.body_quat[car.wheel_body[w]]
        quat[0] = math.cos(half)
        quat[3] = math.sin(half)


@inlined
def _axis(car, body, column):
    """A column of a body's rotation matrix: its axis in the world."""
    m = car.xmat[body]
    return (m[column], m[3 + column], m[6 + column])


@inlined
def _velocity(car, body, point):
    """Velocity of a point of a body in the world [m/s]."""
    v = car.cvel[body]
    com = car.subtree_com[car.chassis]
    arm = (point[0] - com[0], point[1] - com[1], point[2] - com[2])
    turn = cross((v[0], v[1], v[2]), arm)
    return (v[3] + turn[0], v[4] + turn[1], v[5] + turn[2])


@inlined
def _vector(row):
    return (row[0], row[1], row[2])


@inlined
def _push(car, point, force, moment):
    """Adds a force in the world at a point, and a moment, to the generalised forces of the chassis.

    J^T F written out: MuJoCo's own way, xfrc_applied, costs a fifth of a step. Its translations
    are in the world, its rotations about the body's axes.
    """
    origin, m = car.xpos[car.chassis], car.xmat[car.chassis]
    arm = (point[0] - origin[0], point[1] - origin[1], point[2] - origin[2])
    turn = combine(1.0, cross(arm, force), 1.0, moment, 0.0, moment)
    for i in range(3):
        car.qfrc_applied[i] += force[i]
        car.qfrc_applied[3 + i] += m[i] * turn[0] + m[3 + i] * turn[1] + m[6 + i] * turn[2]


@inlined
def _drag(car):
    """Air drag along the body's x axis, acting at the body's origin."""
    ahead = _axis(car, car.chassis, 0)
    origin = _vector(car.xpos[car.chassis])
    speed = dot(_velocity(car, car.chassis, origin), ahead)
    drag = -0.5 * AIR_DENSITY * car.drag_area * speed * abs(speed)
    _push(car, origin, (drag * ahead[0], drag * ahead[1], drag * ahead[2]), (0.0, 0.0, 0.0))


@inlined
def _road_normal(car, road):
    """Normal of the plane through the road under the four wheels: grade and bank of the road."""
    rise = 0.5 * (road[0] + road[1] - road[2] - road[3]) / car.wheelbase
    bank = 0.5 * (road[0] - road[1] + road[2] - road[3]) / car.track
    ahead = _axis(car, car.chassis, 0)
    level = math.sqrt(ahead[0] ** 2 + ahead[1] ** 2)
    if (rise == 0.0 and bank == 0.0) or level == 0.0:
        return (0.0, 0.0, 1.0)
    c, s = ahead[0] / level, ahead[1] / level
    x = -rise * c + bank * s
    y = -rise * s - bank * c
    return (x, y, math.sqrt(max(1.0 - x * x - y * y, 0.25)))


@inlined
def _wheel(car, w, drive, brake, road, normal):
    """Applies the road's wrench and the torques of drive and brake to one wheel."""
    body, dof = car.wheel_body[w], car.spin_dof[w]
    centre, axis, v = _vector(car.xpos[body]), _axis(car, body, 1), car.cvel[body]
    force, moment = wheel_contact(
        car.tyres[w], car.side[w], car.tyre_state[w], centre, axis,
        _velocity(car, body, centre), (v[0], v[1], v[2]), normal, road, car.dt, car.tyre_output[w],
    )  # fmt: skip
    _push(car, centre, force, moment)
    car.qfrc_applied[car.travel_dof[w]] = dot(force, _vector(car.xaxis[car.travel_joint[w]]))
    # A brake stops the wheel within the step if it can, and holds it: dry friction.
    torque = drive + dot(moment, axis)
    holding = -car.spin_inertia[w] * car.qvel[dof] / car.dt - torque
    car.qfrc_applied[dof] = torque + min(max(holding, -brake), brake)


@njit(cache=True, nogil=True)
def correct(car, dx):
    """Adds a correction to the states: TiL Eq. (4).

    Args:
        car: the car.
        dx: (28,) in the order of `twin.channels.STATES`. Rotation (roll, pitch, yaw) is a small
            turn about the body's axes; velocity is in the body frame, and a turn keeps it there.
    """
    qpos, qvel = car.qpos, car.qvel
    w, x, y, z = qpos[3], qpos[4], qpos[5], qpos[6]
    vx, vy, vz = _unrotate((w, x, y, z), (qvel[0], qvel[1], qvel[2]))
    angle = math.sqrt(dx[3] ** 2 + dx[4] ** 2 + dx[5] ** 2)
    if angle > 0.0:
        scale, c = math.sin(0.5 * angle) / angle, math.cos(0.5 * angle)
        a, b, d = scale * dx[3], scale * dx[4], scale * dx[5]
        w, x, y, z = (
            w * c - x * a - y * b - z * d,
            w * a + x * c + y * d - z * b,
            w * b - x * d + y * c + z * a,
            w * d + x * b - y * a + z * c,
        )
        norm = math.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w / norm, x / norm, y / norm, z / norm
        qpos[3], qpos[4], qpos[5], qpos[6] = w, x, y, z
    velocity = _rotate((w, x, y, z), (vx + dx[14], vy + dx[15], vz + dx[16]))
    for i in range(3):
        qpos[i] += dx[i]
        qvel[i] = velocity[i]
        qvel[3 + i] += dx[17 + i]
    for i in range(4):
        qpos[car.travel_qpos[i]] += dx[6 + i]
        qpos[car.spin_qpos[i]] += dx[10 + i]
        qvel[car.travel_dof[i]] += dx[20 + i]
        qvel[car.spin_dof[i]] += dx[24 + i]


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


@njit(cache=True, nogil=True)
def read_states(car, x):
    """Reads the states.

    Args:
        car: the car.
        x: (28,) receives them, `twin.channels.STATES`; roll, pitch and yaw as the angles of ISO
            8855 (yaw first, then pitch, then roll).
    """
    qpos, qvel = car.qpos, car.qvel
    q = (qpos[3], qpos[4], qpos[5], qpos[6])
    ahead, left, up = _rotate(q, (1.0, 0.0, 0.0)), _rotate(q, (0.0, 1.0, 0.0)), _rotate(q, (0.0, 0.0, 1.0))
    x[3] = math.atan2(left[2], up[2])
    x[4] = -math.asin(min(max(ahead[2], -1.0), 1.0))
    x[5] = math.atan2(ahead[1], ahead[0])
    velocity = _unrotate(q, (qvel[0], qvel[1], qvel[2]))
    for i in range(3):
        x[i] = qpos[i]
        x[14 + i] = velocity[i]
        x[17 + i] = qvel[3 + i]
    for i in range(4):
        x[6 + i] = qpos[car.travel_qpos[i]]
        x[10 + i] = qpos[car.spin_qpos[i]]
        x[20 + i] = qvel[car.travel_dof[i]]
        x[24 + i] = qvel[car.spin_dof[i]]


@njit(cache=True, nogil=True)
def set_parameters(car, p):
    """Sets the load parameters of the chassis, kept physically valid: TiL Eq. (2).

    Args:
        car: the car.
        p: (10,) deltas from the nominal chassis, `twin.load.PARAMETERS`: mass [kg], CM [m],
            inertia tensor about the new CM [kg m2]. On return it holds what was set: the mass has a
            floor, the tensor is one that a rigid body can have.
    """
    now, nominal, chassis = car.parameters, car.nominal, car.chassis
    p[0] = max(p[0], (LEAST_SHARE - 1.0) * nominal[0])
    change = p[0] - now[0]
    car.body_mass[chassis] += change
    car.body_subtreemass[chassis] += change
    car.body_subtreemass[0] += change
    now[0] = p[0]
    for i in range(3):
        now[1 + i] = p[1 + i]
        car.body_ipos[chassis, i] = nominal[1 + i] + p[1 + i]
    same = True
    for i in range(4, 10):
        same = same and p[i] == now[i]
    if not same:
        _set_inertia(car, p)
        now[4:] = p[4:]


@inlined
def _set_inertia(car, p):
    """Writes principal moments and axes of nominal + p[4:10], made valid; p returns what was set."""
    tensor, values, vectors, quat = (
        car.scratch[0:9], car.scratch[9:12], car.scratch[12:21], car.scratch[21:25],
    )  # fmt: skip
    n = car.nominal
    xx, yy, zz = n[4] + p[4], n[5] + p[5], n[6] + p[6]
    xy, xz, yz = n[7] + p[7], n[8] + p[8], n[9] + p[9]
    tensor[0], tensor[4], tensor[8] = xx, yy, zz
    tensor[1], tensor[2], tensor[5] = xy, xz, yz
    tensor[3], tensor[6], tensor[7] = xy, xz, yz
    mju_eig3(values.ctypes.data, vectors.ctypes.data, quat.ctypes.data, tensor.ctypes.data)
    if _make_valid(values, LEAST_SHARE * min(n[4], n[5], n[6])):
        for i in range(3):
            for j in range(3):
                total = 0.0
                for k in range(3):
                    total += vectors[3 * i + k] * values[k] * vectors[3 * j + k]
                tensor[3 * i + j] = total
        p[4], p[5], p[6] = tensor[0] - n[4], tensor[4] - n[5], tensor[8] - n[6]
        p[7], p[8], p[9] = tensor[1] - n[7], tensor[2] - n[8], tensor[5] - n[9]
    for i in range(3):
        car.body_inertia[car.chassis, i] = values[i]
    for i in range(4):
        car.body_iquat[car.chassis, i] = quat[i]


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


@njit(cache=True)
def is_sound(car):
    """False once a state is no longer a finite number of sensible size."""
    for value in car.qvel:
        if not abs(value) < 1e6:
            return False
    for value in car.qpos:
        if not abs(value) < 1e9:
            return False
    return True

