"""One wheel on the road: contact geometry, transient slip and the wrench on the wheel.

The contact frame stands at the contact point: x along the wheel's heading in the road plane, y to
its left, z along the road's normal. Slips are signed as the tyre models of `twin.tyre.interface`
expect: kappa = -v_sx / |v_x|, alpha = atan(v_sy / |v_x|).

Slip builds up with the distance rolled (Pacejka, Tyre and Vehicle Dynamics, 2nd ed., Eqs. 7.7 and
7.9): the state is the deflection of the carcass, u along and v across. Integrated exactly over a
step of constant speed, it stays sound at any speed and step.
"""

import math

from numba import njit

from twin.compiled.elementary import asin, atan, clip, cos, exp
from twin.compiled.simd import absolute, anywhere, inlined, maximum, sqrt, where
from twin.tyre.interface import forces, relaxation, stiffness
from twin.tyre.radius import effective_radius

# Below this speed [m/s] a rolling tyre no longer damps its own deflection (Pacejka Eq. 8.131).
LOW_SPEED = 2.0
# Damping ratio that stands in for it at rest, of the wheel's share of the car on its carcass;
# chosen: the car comes to rest within a second of stopping.
LOW_SPEED_DAMPING_RATIO = 0.25
# At low speed the deflection is bounded to so many times the slip at which a linear tyre would
# reach the limit of friction (Pacejka, Section 8.6).
LARGEST_DEFLECTION = 3.0
LEAST_ROLLED = 1e-8  # of a relaxation length in a step: below, the decay drowns in rounding
GRAVITY = 9.81  # [m/s2], to turn a wheel load into the mass it carries

# Columns of the tyre state
LONGITUDINAL, LATERAL, ROAD = range(3)


@inlined
def dot(a, b):
    """Inner product of two 3-tuples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):
    """Vector product of two 3-tuples."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inlined
def difference(a, b):
    """The 3-tuple a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inlined
def combine(p, a, q, b, r, c):
    """The 3-tuple p a + q b + r c."""
    return (
        p * a[0] + q * b[0] + r * c[0],
        p * a[1] + q * b[1] + r * c[1],
        p * a[2] + q * b[2] + r * c[2],
    )


@inlined
def relax(deflection, slip_speed, speed, length, dt):
    """Advances du/dt = slip_speed - |v_x| u / length by dt, exactly for constant speeds."""
    rolled = speed * dt / length
    rolled = where(rolled < LEAST_ROLLED, 0.0, rolled)
    decay = exp(-rolled)
    mean = where(rolled > 0.0, (1.0 - decay) / rolled, 1.0)  # of the decay over the step
    return deflection * decay + slip_speed * dt * mean


@inlined
def bounded(new, old, limit):
    """A deflection beyond the limit may shrink, not grow."""
    bound = maximum(limit, absolute(old))
    return clip(new, -bound, bound)


@njit(cache=True, error_model="numpy")
def wheel_contact(tyre, side, state, centre, axis, velocity, rate, normal, road, road_rate, dt):
    """The force and moment of the road on a wheel, or on four wheels at once.

    Args:
        tyre: record, see `twin.tyre.record`.
        side: 1 for a tyre mounted as measured, -1 for a mirrored one.
        state: deflections along and across [m].
        centre: wheel centre in the world [m], 3-tuple like all that follow.
        axis: spin axis in the world, to the left, of unit length.
        velocity: of the wheel centre in the world [m/s].
        rate: angular velocity of the wheel in the world [rad/s].
        normal: of the road in the world, of unit length.
        road: height of the road under the wheel [m].
        road_rate: its rate of change [m/s].
        dt: step [s].

    Returns:
        Force [N] and moment about the wheel centre [N m], in the world; the deflections after dt;
        what `twin.channels.TYRE_OUTPUTS` names.
    """
    ahead = cross(axis, normal)
    length = sqrt(dot(ahead, ahead))
    ahead = (ahead[0] / length, ahead[1] / length, ahead[2] / length)
    left = cross(normal, ahead)
    upright = cross(ahead, axis)  # in the wheel's plane, away from the road
    cos_camber = dot(upright, normal)

    loaded_radius = (centre[2] - road) * normal[2] / cos_camber
    squeeze = (tyre.unloaded_radius - loaded_radius) * cos_camber
    squeeze_rate = (road_rate - velocity[2]) * normal[2]  # the road's rate holds its grade
    load = tyre.vertical_stiffness * squeeze + tyre.vertical_damping * squeeze_rate
    load = where(squeeze > 0.0, maximum(load, 0.0), 0.0)

    arm = (-loaded_radius * upright[0], -loaded_radius * upright[1], -loaded_radius * upright[2])
    forward_speed = dot(velocity, ahead)
    rolling_radius = effective_radius(tyre, load)
    slip_x = forward_speed - dot(rate, axis) * rolling_radius
    slip_y = dot(velocity, left) + dot(cross(rate, arm), left)
    camber = asin(dot(axis, normal))

    u, v, kappa, tan_alpha = transient_slip(
        tyre, state, load, camber, forward_speed, slip_x, slip_y, dt
    )
    alpha = atan(tan_alpha)
    fx, fy, mx, my, mz = forces(tyre, load, kappa, alpha, camber, forward_speed, side)
    # Without slip a tyre passes on all power: the torque of F_x has the arm that its speed has.
    my = my - fx * (rolling_radius - loaded_radius)

    force = combine(fx, ahead, fy, left, load, normal)
    moment = combine(mx, ahead, my, left, mz, normal)
    moment = combine(1.0, moment, 1.0, cross(arm, force), 0.0, arm)
    return (
        force,
        moment,
        (u, v),
        (
            *(fx, fy, load, mx, my, mz),
            *(kappa, alpha, where(load > 0.0, camber, 0.0)),
        ),
    )


@inlined
def transient_slip(tyre, state, load, camber, forward_speed, slip_x, slip_y, dt):
    """Deflections along and across [m] after dt, slip ratio and tangent of the slip angle.

    A wheel without load has none of them.
    """
    speed = absolute(forward_speed)
    sigma_x, sigma_y = relaxation(tyre, load, camber)
    u = relax(state[LONGITUDINAL], -slip_x, speed, sigma_x, dt)
    v = relax(state[LATERAL], slip_y, speed, sigma_y, dt)
    kappa, tan_alpha = u / sigma_x, v / sigma_y
    slow = speed < LOW_SPEED
    if anywhere(slow):
        stiffness_x, stiffness_y = stiffness(tyre, load, camber)
        give_x, give_y = load * sigma_x / stiffness_x, load * sigma_y / stiffness_y
        u_bounded = bounded(u, state[LONGITUDINAL], LARGEST_DEFLECTION * give_x)
        v_bounded = bounded(v, state[LATERAL], LARGEST_DEFLECTION * give_y)
        fade = LOW_SPEED_DAMPING_RATIO * (1.0 + cos(math.pi / LOW_SPEED * speed))
        kappa_damped = (u_bounded - fade * slip_x * sqrt(give_x / GRAVITY)) / sigma_x
        tan_alpha_damped = (v_bounded + fade * slip_y * sqrt(give_y / GRAVITY)) / sigma_y
        u, v = where(slow, u_bounded, u), where(slow, v_bounded, v)
        kappa, tan_alpha = (
            where(slow, kappa_damped, kappa),
            where(slow, tan_alpha_damped, tan_alpha),
        )
    touches = load > 0.0
    return (
        where(touches, u, 0.0),
        where(touches, v, 0.0),
        where(touches, kappa, 0.0),
        where(touches, tan_alpha, 0.0),
    )
