"""One wheel on the road: contact geometry, transient slip and the wrench on the wheel.

The contact frame stands at the contact point: x along the wheel's heading in the road plane, y to
its left, z along the road's normal. Slips are signed as the Magic Formula of `twin.tyre` wants
them: kappa = -v_sx / |v_x|, alpha = atan(v_sy / |v_x|).

Slip builds up with the distance rolled (Pacejka, Tyre and Vehicle Dynamics, 2nd ed., Eqs. 7.7 and
7.9): the state is the deflection of the carcass, u along and v across. Integrated exactly over a
step of constant speed, it stays sound at any speed and step.
"""

import math

from numba import njit

from twin.tyre import effective_radius, magic_formula, relaxation_lengths, slip_stiffnesses

# Below this speed [m/s] a rolling tyre no longer damps its own deflection (Pacejka Eq. 8.131).
LOW_SPEED = 2.0
# Damping ratio that stands in for it at rest, of the wheel's share of the car on its carcass;
# chosen: the car comes to rest within a second of stopping.
LOW_SPEED_DAMPING_RATIO = 0.25
# At low speed the deflection is bounded to so many times the slip at which a linear tyre would
# reach the limit of friction (Pacejka, Section 8.6).
LARGEST_DEFLECTION = 3.0
GRAVITY = 9.81  # [m/s2], to turn a wheel load into the mass it carries

# Columns of the tyre state
LONGITUDINAL, LATERAL, ROAD = range(3)


@njit(cache=True, error_model="numpy", forceinline=True)
def dot(a, b):
    """Inner product of two 3-tuples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, error_model="numpy", forceinline=True)
def cross(a, b):
    """Vector product of two 3-tuples."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@njit(cache=True, error_model="numpy", forceinline=True)
def combine(p, a, q, b, r, c):
    """The 3-tuple p a + q b + r c."""
    return (
        p * a[0] + q * b[0] + r * c[0],
        p * a[1] + q * b[1] + r * c[1],
        p * a[2] + q * b[2] + r * c[2],
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def relax(deflection, slip_speed, speed, length, dt):
    """Advances du/dt = slip_speed - |v_x| u / length by dt, exactly for constant speeds."""
    rolled = speed * dt / length
    if rolled < 1e-8:
        return deflection + slip_speed * dt
    decay = math.exp(-rolled)
    return deflection * decay + slip_speed * dt * (1.0 - decay) / rolled


@njit(cache=True, error_model="numpy", forceinline=True)
def bounded(new, old, limit):
    """A deflection beyond the limit may shrink, not grow."""
    bound = max(limit, abs(old))
    return min(max(new, -bound), bound)


@njit(cache=True, error_model="numpy", forceinline=True)
def wheel_contact(tyre, side, state, centre, axis, velocity, rate, normal, road, dt, out):
    """The force and moment of the road on one wheel.

    Args:
        tyre: coefficients, a record of `twin.tir.TYRE_DTYPE`.
        side: 1 for a tyre mounted as measured, -1 for a mirrored one.
        state: (3,) deflections along and across [m] and the last road height [m]; advanced by dt.
        centre: wheel centre in the world [m], 3-tuple like all that follow.
        axis: spin axis in the world, to the left, of unit length.
        velocity: of the wheel centre in the world [m/s].
        rate: angular velocity of the wheel in the world [rad/s].
        normal: of the road in the world, of unit length.
        road: height of the road under the wheel [m].
        dt: step [s].
        out: (9,) receives what `twin.channels.TYRE_OUTPUTS` names.

    Returns:
        Force [N] and moment about the wheel centre [N m], in the world.
    """
    ahead = cross(axis, normal)
    length = math.sqrt(dot(ahead, ahead))
    ahead = (ahead[0] / length, ahead[1] / length, ahead[2] / length)
    left = cross(normal, ahead)
    upright = cross(ahead, axis)  # in the wheel's plane, away from the road
    cos_camber = dot(upright, normal)

    road_rate = (road - state[ROAD]) / dt
    state[ROAD] = road
    loaded_radius = (centre[2] - road) * normal[2] / cos_camber
    squeeze = (tyre.unloaded_radius - loaded_radius) * cos_camber
    squeeze_rate = (road_rate - velocity[2]) * normal[2] - (
        velocity[0] * normal[0] + velocity[1] * normal[1]
    )
    load = tyre.vertical_stiffness * squeeze + tyre.vertical_damping * squeeze_rate
    if squeeze <= 0.0 or load <= 0.0:
        state[LONGITUDINAL] = 0.0
        state[LATERAL] = 0.0
        out[:] = 0.0
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)

    arm = (-loaded_radius * upright[0], -loaded_radius * upright[1], -loaded_radius * upright[2])
    forward_speed = dot(velocity, ahead)
    speed = abs(forward_speed)
    rolling_radius = effective_radius(tyre, load)
    slip_x = forward_speed - dot(rate, axis) * rolling_radius
    slip_y = dot(velocity, left) + dot(cross(rate, arm), left)
    camber = math.asin(min(max(dot(axis, normal), -1.0), 1.0))

    sigma_x, sigma_y = relaxation_lengths(tyre, load, camber)
    stiffness_x, stiffness_y = slip_stiffnesses(tyre, load, camber)
    u = relax(state[LONGITUDINAL], -slip_x, speed, sigma_x, dt)
    v = relax(state[LATERAL], slip_y, speed, sigma_y, dt)
    kappa, tan_alpha = u / sigma_x, v / sigma_y
    if speed < LOW_SPEED:
        u = bounded(u, state[LONGITUDINAL], LARGEST_DEFLECTION * sigma_x * load / stiffness_x)
        v = bounded(v, state[LATERAL], LARGEST_DEFLECTION * sigma_y * load / stiffness_y)
        fade = LOW_SPEED_DAMPING_RATIO * (1.0 + math.cos(math.pi * speed / LOW_SPEED))
        mass = load / GRAVITY
        kappa = (u - fade * slip_x * math.sqrt(mass * sigma_x / stiffness_x)) / sigma_x
        tan_alpha = (v + fade * slip_y * math.sqrt(mass * sigma_y / stiffness_y)) / sigma_y
    state[LONGITUDINAL] = u
    state[LATERAL] = v

    alpha = math.atan(tan_alpha)
    wrench = out[:6]
    magic_formula(tyre, load, kappa, alpha, camber, forward_speed, side, wrench)
    fx, fy, mx, my, mz = wrench[0], wrench[1], wrench[2], wrench[3], wrench[4]
    # Without slip a tyre passes on all power: the torque of F_x has the arm that its speed has.
    my -= fx * (rolling_radius - loaded_radius)
    out[0], out[1], out[2], out[3], out[4], out[5] = fx, fy, load, mx, my, mz
    out[6], out[7], out[8] = kappa, alpha, camber

    force = combine(fx, ahead, fy, left, load, normal)
    moment = combine(mx, ahead, my, left, mz, normal)
    lever = cross(arm, force)
    return force, (moment[0] + lever[0], moment[1] + lever[1], moment[2] + lever[2])
