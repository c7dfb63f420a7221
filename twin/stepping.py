"""One step of the car: steering, drag, tyres and brakes between the halves of MuJoCo's step."""

import math

from numba import types

from twin.car_record import CAR
from twin.channels import OUTPUTS, TYRE, TYRE_OUTPUTS, WHEELS, U
from twin.compiled.boundary import VECTOR, behind
from twin.compiled.elementary import clip
from twin.compiled.libmujoco import mj_step1, mj_step2
from twin.compiled.simd import gather, inlined, load, pointer, scatter, unpack
from twin.parameters import P
from twin.tyre.contact import (
    LATERAL,
    LONGITUDINAL,
    ROAD,
    combine,
    cross,
    difference,
    dot,
    wheel_contact,
)
from twin.tyre.four_tyres import four_tyres

AIR_DENSITY = 1.2  # [kg/m3]
# An input is late by as much of its change over this time as its delay is of it [s]; chosen: faster
# than what a driver does, slower than the noise of a torque
SMOOTHING = 0.02
STICK = 0.02  # rate of travel at which bump and rebound are half told apart [m/s]; chosen
STATES = 3  # columns of the tyre state


@inlined
def _late(car, k, value, delay):
    """Input k by its delay later, first-order; of a negative delay, earlier."""
    smooth = car.input_state[k]
    if math.isnan(smooth):
        smooth = value
    late = value - delay / SMOOTHING * (value - smooth)
    car.input_state[k] = smooth + (value - smooth) * car.dt / SMOOTHING
    return late


@inlined
def _delay(car, u):
    """Fills hand wheel and torques of the car as they act, of those told."""
    p, acting = car.parameters, car.inputs
    acting[0] = _late(car, 0, u[U.steering_wheel_angle], p[P.steering_delay])
    for w in range(len(WHEELS)):
        acting[1 + w] = _late(car, 1 + w, u[U.drive_torque_fl + w], p[P.torque_delay])
        brake = _late(car, 5 + w, u[U.brake_torque_fl + w], p[P.torque_delay])
        acting[5 + w] = max(brake, 0.0)


@inlined
def _damp(car):
    """Sets the dampers to bump or rebound, where these differ."""
    asymmetry = car.parameters[P.damper_asymmetry]
    if asymmetry == 0.0:
        return
    damping, speed = pointer(car.dof_damping), pointer(car.qvel)
    for w in range(len(WHEELS)):
        rate = speed[car.travel_dof[w]]
        share = asymmetry * rate / (abs(rate) + STICK)
        damping[car.travel_dof[w]] = car.damping[w] * (1.0 - share)


@inlined
def _steer(car, hand_wheel):
    """Turns the front wheels: steering is an input, no degree of freedom."""
    hand_wheel = hand_wheel - car.parameters[P.steering_offset]
    compliance = car.parameters[P.compliance_steer]
    tangent = math.tan(hand_wheel / car.steering_ratio)
    inner = 0.5 * car.ackermann * car.track / car.wheelbase * tangent
    body_quat = pointer(car.body_quat)
    for w in range(2):
        side = 1.0 if w == 0 else -1.0
        angle = math.atan(tangent / (1.0 - side * inner))
        half = 0.5 * (angle - compliance * car.front_force[w])
        quat = 4 * car.wheel_body[w]
        body_quat[quat] = math.cos(half)
        body_quat[quat + 3] = math.sin(half)


@inlined
def _vector(rows, row):
    """A row of three numbers."""
    return (rows[3 * row], rows[3 * row + 1], rows[3 * row + 2])


@inlined
def _axis(car, body, column):
    """A column of a body's rotation matrix: its axis in the world."""
    m = pointer(car.xmat)
    return (m[9 * body + column], m[9 * body + 3 + column], m[9 * body + 6 + column])


@inlined
def _air(car):
    """Drag along the body's x axis at its origin; downforce against its z axis at each axle."""
    ahead = _axis(car, car.chassis, 0)
    origin = _vector(pointer(car.xpos), car.chassis)
    com = _vector(pointer(car.subtree_com), car.chassis)
    twist = pointer(car.cvel)
    turn, move = _vector(twist, 2 * car.chassis), _vector(twist, 2 * car.chassis + 1)
    speed = dot(combine(1.0, move, 1.0, cross(turn, difference(origin, com)), 0.0, move), ahead)
    pressure = 0.5 * AIR_DENSITY * speed * abs(speed)
    front, rear = -abs(pressure) * car.lift_area_front, -abs(pressure) * car.lift_area_rear
    up = _axis(car, car.chassis, 2)
    applied = pointer(car.qfrc_applied)
    for i in range(3):
        applied[i] += (front + rear) * up[i] - pressure * car.drag_area * ahead[i]
    applied[4] -= car.axle[0] * front + car.axle[1] * rear  # about the body's y axis


@inlined
def _axle_forces(car, ground):
    """Lateral forces at each axle, along the body's y axis at the height of the road."""
    front, rear = car.parameters[P.axle_force_front], car.parameters[P.axle_force_rear]
    if front == 0.0 and rear == 0.0:
        return
    left = _axis(car, car.chassis, 1)
    applied = pointer(car.qfrc_applied)
    for i in range(3):
        applied[i] += (front + rear) * left[i]
    height = _vector(pointer(car.xpos), car.chassis)[2] - ground
    applied[3] += height * (front + rear)
    applied[5] += car.axle[0] * front + car.axle[1] * rear


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
def _vectors(values, ids, stride, offset, step):
    """One vector of each wheel: entries offset, offset + step, offset + 2 step of its row."""
    return (
        gather(values, ids, stride, offset),
        gather(values, ids, stride, offset + step),
        gather(values, ids, stride, offset + 2 * step),
    )


@inlined
def _total(x):
    """Sum over the wheels."""
    a = unpack(x)
    return a[0] + a[1] + a[2] + a[3]


@inlined
def _push(car, points, forces, moments):
    """Adds forces in the world at points, and moments, to the generalised forces of the chassis.

    J^T F written out: MuJoCo's own way, xfrc_applied, costs a fifth of a step. Its translations
    are in the world, its rotations about the body's axes.
    """
    origin = _vector(pointer(car.xpos), car.chassis)
    turns = combine(1.0, cross(difference(points, origin), forces), 1.0, moments, 0.0, moments)
    turn = (_total(turns[0]), _total(turns[1]), _total(turns[2]))
    applied = pointer(car.qfrc_applied)
    for i in range(3):
        applied[i] += _total(forces[i])
        applied[3 + i] += dot(_axis(car, car.chassis, i), turn)


@inlined
def _wheels(car, drive, brake, road, normal):
    """Applies the road's wrenches and the torques of drive and brake to the four wheels."""
    bodies, wheels = car.wheel_body.ctypes, car.wheel.ctypes
    twist = pointer(car.cvel)
    centre = _vectors(pointer(car.xpos), bodies, 3, 0, 1)
    axis = _vectors(pointer(car.xmat), bodies, 9, 1, 3)
    rate, move = _vectors(twist, bodies, 6, 0, 1), _vectors(twist, bodies, 6, 3, 1)
    com = _vector(pointer(car.subtree_com), car.chassis)
    velocity = combine(1.0, move, 1.0, cross(rate, difference(centre, com)), 0.0, move)
    state, outputs = car.tyre_state.ctypes, car.tyre_output.ctypes
    last_road = gather(state, wheels, STATES, ROAD)
    deflection = gather(state, wheels, STATES, LONGITUDINAL), gather(state, wheels, STATES, LATERAL)
    force, moment, deflection, output = wheel_contact(
        four_tyres(car.tyres.ctypes), load(car.side.ctypes, 0), deflection, centre, axis,
        velocity, rate, normal, road, (road - last_road) / car.dt, car.dt,
    )  # fmt: skip
    scatter(state, wheels, STATES, LONGITUDINAL, deflection[LONGITUDINAL])
    scatter(state, wheels, STATES, LATERAL, deflection[LATERAL])
    scatter(state, wheels, STATES, ROAD, road)
    for k in range(len(TYRE_OUTPUTS)):
        scatter(outputs, wheels, len(TYRE_OUTPUTS), k, output[k])
    for w in range(2):
        car.front_force[w] = car.tyre_output[w, TYRE.fy]

    _push(car, centre, force, moment)
    applied, spins = pointer(car.qfrc_applied), car.spin_dof.ctypes
    along = _vectors(pointer(car.xaxis), car.travel_joint.ctypes, 3, 0, 1)
    scatter(applied, car.travel_dof.ctypes, 1, 0, dot(force, along))
    # A brake stops the wheel within the step if it can, and holds it: dry friction.
    torque = drive + dot(moment, axis)
    speed = gather(pointer(car.qvel), spins, 1, 0)
    holding = -load(car.spin_inertia.ctypes, 0) * speed / car.dt - torque
    scatter(applied, spins, 1, 0, torque + clip(holding, -brake, brake))


@behind(types.void, CAR, VECTOR, VECTOR)
def step_car(car, u, y):
    """See `twin.kernel.step`."""
    _delay(car, u)
    _steer(car, car.inputs[0])
    _damp(car)
    mj_step1(car.model, car.data)
    applied = pointer(car.qfrc_applied)
    for i in range(6):
        applied[i] = 0.0
    _air(car)
    road = load(u, U.road_height_fl)
    _axle_forces(car, 0.25 * _total(road))
    drive = load(car.inputs.ctypes, 1) * load(car.drive_share.ctypes, 0)
    brake = load(car.inputs.ctypes, 5) * load(car.brake_share.ctypes, 0)
    _wheels(car, drive, brake, road, _road_normal(car, unpack(road)))
    mj_step2(car.model, car.data)
    sensordata = pointer(car.sensordata)
    for i in range(len(OUTPUTS)):
        y[i] = sensordata[car.sensor[i]]
