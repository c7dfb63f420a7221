"""The Magic Formula tyre, MF 5.2 (PAC2002): steady-state forces and moments, compiled.

Equation numbers are those of Pacejka, *Tyre and Vehicle Dynamics*, 2nd ed., section 4.3.2, without
turn slip and inflation pressure; where MF 5.2 has fewer coefficients than the book (stiffness and
friction over camber) it is MF 5.2 that counts. Axes are ISO 8855, signs ISO-W: see `twin.tir`.

Kept sane where the formula is extrapolated: outside its load range a tyre has the forces of the
end of the range in proportion to the load; the inclination is limited to its range; curvatures
are at most 1 (as the book asks), weights of combined slip not negative (likewise); friction,
stiffnesses and relaxation lengths stay positive.

A `tyre` is a record of `twin.tir.TYRE_DTYPE`, or `twin.lanes.four_tyres` of an array of them; then
the other numbers may be `Four`, too, and all four tyres are computed at once.
"""

from math import pi
from typing import Any

from numba import njit

from twin.elementary import atan, clip, cos, exp, sin
from twin.lanes import absolute, copysign, inlined, maximum, minimum, sqrt

Tyre = Any  # numpy.void, whose fields compiled code reads as attributes

LEAST_FRICTION = 0.01  # peak friction coefficient, chosen: below wet ice
LEAST_SHARE = 0.05  # of a factor that the formula could drive to zero or beyond, chosen
LEAST_RELAXATION = 0.02  # [m], chosen: a lightly loaded tyre answers at once, but not faster
LARGEST_SLIP = 1e6  # longitudinal slip; the force is that of sliding long before
FASTEST = 10.0  # limit of the speed over LONGVL in the rolling resistance
ROLLING_SPEED = 0.1  # [m/s], chosen: below it rolling resistance and trail fade out

compiled = njit(cache=True, nogil=True, error_model="numpy")


@compiled
def magic_formula(
    tyre: Tyre,
    fz: float,
    kappa: float,
    alpha: float,
    gamma: float,
    vx: float,
    side: float,
) -> tuple[float, float, float, float, float]:
    """Computes the steady-state forces and moments of a tyre at combined slip.

    Finite for all finite arguments; a tyre without load has none.

    Args:
        tyre: the tyre's record.
        fz: wheel load [N].
        kappa: longitudinal slip -v_sx/|v_x| [-].
        alpha: slip angle atan(v_sy/|v_x|) [rad], within +-pi/2: sliding to the left is positive,
            and gives a negative lateral force.
        gamma: inclination about x [rad]: the top leaning to the right is positive.
        vx: speed of the wheel centre along x [m/s], negative in reverse.
        side: +1 for the tyre as measured, -1 for its mirror image: the side it is mounted on
            (+1 left, -1 right) times `tyre.side`.

    Returns:
        F_x, F_y [N], M_x, M_y, M_z [N m] at the contact point, in axes x along the wheel plane, y
        left, z along the road's normal.
    """
    share, fz, dfz, nominal = _load(tyre, fz)
    kappa = clip(kappa, -LARGEST_SLIP, LARGEST_SLIP)
    alpha = clip(side * alpha, -0.5 * pi, 0.5 * pi)
    gamma = side * _inclination(tyre, gamma)
    travel = _travel(vx)

    kx = _slip_stiffness(tyre, fz, dfz)
    ky = _cornering_stiffness(tyre, fz, nominal, gamma)
    mu_y = _lateral_friction(tyre, dfz, gamma)
    fx0 = _pure_longitudinal(tyre, fz, dfz, kappa, gamma, kx)
    shift_h, shift_v = _lateral_shifts(tyre, fz, dfz, gamma)
    fy0 = _pure_lateral(tyre, fz, dfz, alpha, gamma, ky, mu_y, shift_h, shift_v)

    fx = _longitudinal_weight(tyre, dfz, kappa, alpha) * fx0
    fy_weighted = _lateral_weight(tyre, dfz, kappa, alpha) * fy0  # F_y' of (4.E74)
    fy = fy_weighted + _slip_induced_side_force(tyre, fz, dfz, kappa, alpha, gamma, mu_y)

    trail = travel * _trail(tyre, fz, dfz, nominal, kappa, alpha, gamma, kx / ky)
    residual = _residual_torque(
        tyre, fz, dfz, kappa, alpha, gamma, kx / ky, shift_h + shift_v / ky, ky / (mu_y * fz)
    )
    arm = _force_arm(tyre, dfz, nominal, fy, gamma)

    return (
        share * fx,
        share * fy * side,
        share * _overturning_moment(tyre, fz, nominal, fy, gamma) * side,
        -share * travel * _rolling_resistance(tyre, fz, nominal, fx, vx),
        share * (-trail * fy_weighted + residual + arm * fx) * side,  # (4.E71), (4.E72)
    )


@compiled
def slip_stiffnesses(tyre: Tyre, fz: float, gamma: float) -> tuple[float, float]:
    """Returns the slopes of F_x over kappa [N] and of -F_y over alpha [N/rad] where they cross.

    Both positive, zero without load. (4.E15), (4.E25).

    Args:
        tyre: the tyre's record.
        fz: wheel load [N].
        gamma: inclination [rad].
    """
    share, fz, dfz, nominal = _load(tyre, fz)
    gamma = _inclination(tyre, gamma)
    c_alpha = -_cornering_stiffness(tyre, fz, nominal, gamma)
    return share * _slip_stiffness(tyre, fz, dfz), share * c_alpha


@compiled
def relaxation_lengths(tyre: Tyre, fz: float, gamma: float) -> tuple[float, float]:
    """Returns the relaxation lengths in longitudinal and lateral direction [m], 2 cm or more.

    PAC2002: sigma_kappa = F_z (p_Tx1 + p_Tx2 df_z) exp(p_Tx3 df_z) R_0/F_z0,
    sigma_alpha = p_Ty1 sin(2 arctan(F_z/(p_Ty2 F_z0))) (1 - p_Ky3 |gamma|) R_0, both scaled.

    Args:
        tyre: the tyre's record.
        fz: wheel load [N].
        gamma: inclination [rad].
    """
    _, fz, dfz, nominal = _load(tyre, fz)
    gamma = _inclination(tyre, gamma) * tyre.lgay
    along = fz * (tyre.ptx1 + tyre.ptx2 * dfz) * exp(tyre.ptx3 * dfz) / nominal
    across = tyre.pty1 * _sin_2_arctan(fz / (tyre.pty2 * nominal)) * tyre.lfzo
    across *= maximum(1.0 - tyre.pky3 * absolute(gamma), LEAST_SHARE)
    return (
        maximum(along * tyre.unloaded_radius * tyre.lsgkp, LEAST_RELAXATION),
        maximum(across * tyre.unloaded_radius * tyre.lsgal, LEAST_RELAXATION),
    )


@compiled
def effective_radius(tyre: Tyre, fz: float) -> float:
    """Returns the effective rolling radius R_e = v_x/omega of the free rolling wheel [m].

    MF 5.2: R_e = R_0 - rho_0 (D_reff arctan(B_reff rho/rho_0) + F_reff rho/rho_0), with the
    deflection rho = F_z/C_z, rho_0 at nominal load.

    Args:
        tyre: the tyre's record.
        fz: wheel load [N].
    """
    deflection = clip(fz, 0.0, tyre.fzmax) / tyre.fnomin
    loss = tyre.dreff * atan(tyre.breff * deflection) + tyre.freff * deflection
    radius = tyre.unloaded_radius - loss * tyre.fnomin / tyre.vertical_stiffness
    return maximum(radius, 0.5 * tyre.unloaded_radius)


@inlined
def _pure_longitudinal(tyre, fz, dfz, kappa, gamma, kx):
    """Returns F_x0 [N], the longitudinal force without side slip. (4.E9)-(4.E18)."""
    shift_h = (tyre.phx1 + tyre.phx2 * dfz) * tyre.lhx
    shift_v = fz * (tyre.pvx1 + tyre.pvx2 * dfz) * tyre.lvx * tyre.lmux
    slip = kappa + shift_h
    c = tyre.pcx1 * tyre.lcx
    inclination = gamma * tyre.lgax
    mu = (tyre.pdx1 + tyre.pdx2 * dfz) * (1.0 - tyre.pdx3 * inclination * inclination) * tyre.lmux
    d = maximum(mu, LEAST_FRICTION) * fz
    e = (tyre.pex1 + dfz * (tyre.pex2 + dfz * tyre.pex3)) * (1.0 - tyre.pex4 * copysign(1.0, slip))
    b = kx / (c * d)
    return d * sin(c * _bend(b * slip, e * tyre.lex)) + shift_v


@inlined
def _pure_lateral(tyre, fz, dfz, alpha, gamma, ky, mu, shift_h, shift_v):
    """Returns F_y0 [N], the lateral force without longitudinal slip. (4.E19)-(4.E26)."""
    slip = alpha + shift_h
    c = tyre.pcy1 * tyre.lcy
    d = mu * fz
    e = (tyre.pey1 + tyre.pey2 * dfz) * tyre.ley
    e *= 1.0 - (tyre.pey3 + tyre.pey4 * gamma * tyre.lgay) * copysign(1.0, slip)
    b = ky / (c * d)
    return d * sin(c * _bend(b * slip, e)) + shift_v


@inlined
def _longitudinal_weight(tyre, dfz, kappa, alpha):
    """Returns G_xalpha, the share of F_x0 that side slip leaves. (4.E50)-(4.E57)."""
    b = tyre.rbx1 * _cos_arctan(tyre.rbx2 * kappa) * tyre.lxal
    return _weight(b, tyre.rcx1, tyre.rex1 + tyre.rex2 * dfz, alpha, tyre.rhx1)


@inlined
def _lateral_weight(tyre, dfz, kappa, alpha):
    """Returns G_ykappa, the share of F_y0 that longitudinal slip leaves. (4.E59)-(4.E65)."""
    b = tyre.rby1 * _cos_arctan(tyre.rby2 * (alpha - tyre.rby3)) * tyre.lyka
    shift = tyre.rhy1 + tyre.rhy2 * dfz
    return _weight(b, tyre.rcy1, tyre.rey1 + tyre.rey2 * dfz, kappa, shift)


@inlined
def _weight(b, c, e, slip, shift):
    """Returns a cosine weight that is 1 at no slip and falls to nought. (4.E51), (4.E59)."""
    weight = maximum(cos(c * _bend(b * (slip + shift), e)), 0.0)
    return weight / maximum(cos(c * _bend(b * shift, e)), LEAST_SHARE)


@inlined
def _bend(x, e):
    """Returns the inner angle of the Magic Formula, its curvature E limited to 1. (4.E14)."""
    return atan(x - minimum(e, 1.0) * (x - atan(x)))


@inlined
def _cos_arctan(x):
    return 1.0 / sqrt(1.0 + x * x)


@inlined
def _sin_2_arctan(x):
    return 2.0 * x / (1.0 + x * x)


@inlined
def _load(tyre, fz):
    """Returns F_z over the load in range, that load, its df_z, and F_z0'. (4.E1), (4.E2)."""
    nominal = tyre.lfzo * tyre.fnomin
    within = clip(fz, tyre.fzmin, tyre.fzmax)
    return maximum(fz, 0.0) / within, within, (within - nominal) / nominal, nominal


@inlined
def _inclination(tyre, gamma):
    return clip(gamma, -tyre.cammax, tyre.cammax)


@inlined
def _travel(vx):
    """Returns the direction of travel, from -1 to 1, smooth about standstill."""
    x = clip(vx / ROLLING_SPEED, -1.0, 1.0)
    return 0.5 * x * (3.0 - x * x)


@inlined
def _slip_stiffness(tyre, fz, dfz):
    """Returns K_xkappa > 0 [N]. (4.E15)."""
    slope = maximum(tyre.pkx1 + tyre.pkx2 * dfz, LEAST_SHARE * tyre.pkx1)
    return fz * slope * exp(tyre.pkx3 * dfz) * tyre.lkx


@inlined
def _cornering_stiffness(tyre, fz, nominal, gamma):
    """Returns K_yalpha < 0 [N/rad]. (4.E25), in MF 5.2 with 1 - p_Ky3 |gamma|."""
    upright = tyre.pky1 * nominal * _sin_2_arctan(fz / (tyre.pky2 * nominal)) * tyre.lky
    return upright * maximum(1.0 - tyre.pky3 * absolute(gamma * tyre.lgay), LEAST_SHARE)


@inlined
def _lateral_friction(tyre, dfz, gamma):
    """Returns mu_y > 0. (4.E23)."""
    inclination = gamma * tyre.lgay
    mu = (tyre.pdy1 + tyre.pdy2 * dfz) * (1.0 - tyre.pdy3 * inclination * inclination) * tyre.lmuy
    return maximum(mu, LEAST_FRICTION)


@inlined
def _lateral_shifts(tyre, fz, dfz, gamma):
    """Returns S_Hy [rad] and S_Vy [N]: ply steer, conicity, camber. (4.E27)-(4.E29)."""
    inclination = gamma * tyre.lgay
    horizontal = (tyre.phy1 + tyre.phy2 * dfz) * tyre.lhy + tyre.phy3 * inclination
    vertical = (tyre.pvy1 + tyre.pvy2 * dfz) * tyre.lvy
    vertical += (tyre.pvy3 + tyre.pvy4 * dfz) * inclination
    return horizontal, fz * vertical * tyre.lmuy


@inlined
def _slip_induced_side_force(tyre, fz, dfz, kappa, alpha, gamma, mu_y):
    """Returns S_Vykappa [N], the side force that driving or braking induces. (4.E66), (4.E67)."""
    d = mu_y * fz * (tyre.rvy1 + tyre.rvy2 * dfz + tyre.rvy3 * gamma)
    d *= _cos_arctan(tyre.rvy4 * alpha)
    return d * sin(tyre.rvy5 * atan(tyre.rvy6 * kappa)) * tyre.lvyka


@inlined
def _trail(tyre, fz, dfz, nominal, kappa, alpha, gamma, kx_over_ky):
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
    return d * cos(c * _bend(b * slip, e)) * cos(alpha)


@inlined
def _residual_torque(tyre, fz, dfz, kappa, alpha, gamma, kx_over_ky, shift, by_cy):
    """Returns M_zr [N m] at combined slip. (4.E36)-(4.E38), (4.E45)-(4.E47), (4.E75)."""
    gamma = gamma * tyre.lgaz
    b = tyre.qbz9 * tyre.lky / tyre.lmuy + tyre.qbz10 * by_cy
    d = (tyre.qdz6 + tyre.qdz7 * dfz) * tyre.lres + (tyre.qdz8 + tyre.qdz9 * dfz) * gamma
    d *= fz * tyre.unloaded_radius * tyre.lmuy
    slip = _equivalent_slip(alpha + shift, kappa, kx_over_ky)
    return d * _cos_arctan(b * slip) * cos(alpha)


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
def _force_arm(tyre, dfz, nominal, fy, gamma):
    """Returns s [m], the arm of F_x about the contact's normal. (4.E76)."""
    share = tyre.ssz1 + tyre.ssz2 * fy / nominal
    share += (tyre.ssz3 + tyre.ssz4 * dfz) * gamma * tyre.lgaz
    return share * tyre.unloaded_radius * tyre.ls


@inlined
def _overturning_moment(tyre, fz, nominal, fy, gamma):
    """Returns M_x [N m]. (4.E69)."""
    share = tyre.qsx1 * tyre.lvmx + (tyre.qsx3 * fy / nominal - tyre.qsx2 * gamma) * tyre.lmx
    return share * fz * tyre.unloaded_radius


@inlined
def _rolling_resistance(tyre, fz, nominal, fx, vx):
    """Returns the size of M_y [N m], not negative. (4.E70), in MF 5.2 in steady state."""
    speed = minimum(absolute(vx) / tyre.longvl, FASTEST)
    share = (
        tyre.qsy1
        + tyre.qsy2 * fx / nominal
        + tyre.qsy3 * speed
        + tyre.qsy4 * (speed * speed) * (speed * speed)
    )
    return maximum(share, 0.0) * fz * tyre.unloaded_radius * tyre.lmy
