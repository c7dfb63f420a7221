"""The moments of the Magic Formula tyre, compiled; see `magic_formula` for sources and signs."""

from math import pi

from twin.compiled.elementary import atan, cos, sin
from twin.compiled.simd import absolute, anywhere, inlined, maximum, minimum, sqrt, where
from twin.tyre.shapes import bend, cos_arctan, power

FASTEST = 10.0  # limit of the speed over LONGVL in the rolling resistance


@inlined
def trail(tyre, fz, dfz, nominal, kappa, alpha, gamma, kx_over_ky):
    """Returns the pneumatic trail t [m] at combined slip. (4.E33)-(4.E35), (4.E40)-(4.E44)."""
    gamma = gamma * tyre.lgaz
    shift = tyre.qhz1 + tyre.qhz2 * dfz + (tyre.qhz3 + tyre.qhz4 * dfz) * gamma
    b = tyre.qbz1 + dfz * (tyre.qbz2 + dfz * tyre.qbz3)
    b *= (1.0 + tyre.qbz4 * gamma + tyre.qbz5 * absolute(gamma)) * tyre.lky / tyre.lmuy
    c = tyre.qcz1
    d = (tyre.qdz1 + tyre.qdz2 * dfz) * (1.0 + gamma * (tyre.qdz3 + gamma * tyre.qdz4))
    d *= fz * tyre.unloaded_radius / nominal * tyre.ltr
    e = tyre.qez1 + dfz * (tyre.qez2 + dfz * tyre.qez3)
    e *= 1.0 + (tyre.qez4 + tyre.qez5 * gamma) * 2.0 / pi * atan(b * c * (alpha + shift))
    slip = _equivalent_slip(alpha + shift, kappa, kx_over_ky)
    return d * cos(c * bend(b * slip, e)) * cos(alpha)


@inlined
def residual_torque(tyre, fz, dfz, kappa, alpha, gamma, kx_over_ky, shift, by_cy):
    """Returns M_zr [N m] at combined slip. (4.E36)-(4.E38), (4.E45)-(4.E47), (4.E75)."""
    gamma = gamma * tyre.lgaz
    b = tyre.qbz9 * tyre.lky / tyre.lmuy + tyre.qbz10 * by_cy
    camber = tyre.qdz8 + tyre.qdz9 * dfz + (tyre.qdz10 + tyre.qdz11 * dfz) * absolute(gamma)
    d = (tyre.qdz6 + tyre.qdz7 * dfz) * tyre.lres + camber * gamma
    d *= fz * tyre.unloaded_radius * tyre.lmuy
    slip = _equivalent_slip(alpha + shift, kappa, kx_over_ky)
    return d * cos_arctan(b * slip) * cos(alpha)


@inlined
def _equivalent_slip(alpha, kappa, kx_over_ky):
    """Returns the size of the equivalent slip angle [rad]. (4.E77), (4.E78).

    Its sign is left out: trail and residual torque are even in it. The squared tangent is taken
    from the sine, which costs a third of it.
    """
    sine, longitudinal = sin(alpha), kx_over_ky * kappa
    tangent_squared = sine * sine / (1.0 - sine * sine)
    return atan(sqrt(tangent_squared + longitudinal * longitudinal))


@inlined
def force_arm(tyre, dfz, nominal, fy, gamma):
    """Returns s [m], the arm of F_x about the contact's normal. (4.E76)."""
    share = tyre.ssz1 + tyre.ssz2 * fy / nominal
    share += (tyre.ssz3 + tyre.ssz4 * dfz) * gamma * tyre.lgaz
    return share * tyre.unloaded_radius * tyre.ls


@inlined
def overturning_moment(tyre, fz, nominal, fy, gamma):
    """Returns M_x [N m]. (4.E69)."""
    side = fy / nominal
    share = tyre.qsx1 * tyre.lvmx + (tyre.qsx3 * side - tyre.qsx2 * gamma) * tyre.lmx
    further = tyre.further_mx > 0.0
    if anywhere(further):  # q_Sx12 to q_Sx14: equation manual of MF-Tyre 6.1.2
        load = fz / nominal
        wave = sin(tyre.qsx7 * gamma + tyre.qsx8 * atan(tyre.qsx9 * side))
        size = absolute(gamma)
        more = tyre.qsx4 * cos(tyre.qsx5 * atan((tyre.qsx6 * load) * (tyre.qsx6 * load))) * wave
        more += (tyre.qsx10 * atan(tyre.qsx11 * load) - tyre.qsx12 * size) * gamma
        more += fy / fz * (tyre.qsx13 + tyre.qsx14 * size)
        share += where(further, more * tyre.lmx, 0.0)
    return share * fz * tyre.unloaded_radius


@inlined
def rolling_resistance(tyre, fz, nominal, fx, vx, gamma):
    """Returns the size of M_y [N m], not negative. (4.E70), in MF 5.2 in steady state.

    MF 6: (A48) of Besselink et al. 2010, in which the load counts by its power q_Sy7 only.
    """
    speed = minimum(absolute(vx) / tyre.longvl, FASTEST)
    share = (
        tyre.qsy1
        + tyre.qsy2 * fx / nominal
        + tyre.qsy3 * speed
        + tyre.qsy4 * (speed * speed) * (speed * speed)
    )
    load = fz
    further = tyre.further_my > 0.0
    if anywhere(further):
        tilted = (tyre.qsy5 + tyre.qsy6 * fz / nominal) * gamma * gamma
        share += where(further, tilted, 0.0)
        load = where(further, nominal * power(fz / nominal, tyre.qsy7), fz)
    return maximum(share, 0.0) * load * tyre.unloaded_radius * tyre.lmy
