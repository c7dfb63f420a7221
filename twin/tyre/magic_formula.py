"""The Magic Formula tyre, MF 5.2 (PAC2002), 6.1 and 6.2: steady-state forces and moments, compiled.

Equation numbers are those of Pacejka, *Tyre and Vehicle Dynamics*, section 4.3.2, without turn
slip: of the 2nd ed., where MF 5.2 has fewer coefficients than the book (stiffness and friction over
camber) MF 5.2 counts; of the 3rd ed. for what is said of MF 6, see `twin.tyre.tir_6`. MF 5.2 has
its further coefficients at 0; what differs beyond that is computed only if some tyre is of MF 6.
Slip angle and inclination enter as such, not as tangent and sine (the book leaves the choice,
4.E3). Axes are ISO 8855, signs ISO-W: see `twin.tyre.tir`.

Kept sane where the formula is extrapolated: outside its load range a tyre has the forces of the
end of the range in proportion to the load; the inclination is limited to its range; curvatures
are at most 1 (as the book asks), weights of combined slip not negative (likewise); friction,
stiffnesses and relaxation lengths stay positive.

A `tyre` is a record of `twin.tyre.record.TYRE_DTYPE`, or `twin.tyre.four_tyres.four_tyres` of a
table of four; then the other numbers may be `Four`, too, and all four tyres are computed at once.
"""

from math import pi

from twin.compiled.elementary import atan, clip, cos, exp, sin
from twin.compiled.simd import absolute, anywhere, copysign, inlined, maximum, where
from twin.tyre.moments import (
    force_arm,
    overturning_moment,
    residual_torque,
    rolling_resistance,
    trail,
)
from twin.tyre.shapes import (
    LEAST_SHARE,
    Tyre,
    bend,
    compiled,
    cos_arctan,
    direction_of_travel,
    sin_2_arctan,
)

LEAST_FRICTION = 0.01  # peak friction coefficient, chosen: below wet ice
LEAST_RELAXATION = 0.02  # [m], chosen: a lightly loaded tyre answers at once, but not faster
LARGEST_SLIP = 1e6  # longitudinal slip; the force is that of sliding long before


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
    travel = direction_of_travel(vx)

    kx = _slip_stiffness(tyre, fz, dfz)
    ky = _cornering_stiffness(tyre, fz, nominal, gamma)
    ratio = tyre.combined * kx / ky
    mu_y = _lateral_friction(tyre, dfz, gamma)
    fx0 = _pure_longitudinal(tyre, fz, dfz, kappa, gamma, kx)
    shift_h, shift_v = _lateral_shifts(tyre, fz, dfz, gamma, ky)
    fy0 = _pure_lateral(tyre, fz, dfz, alpha, gamma, ky, mu_y, shift_h, shift_v)

    fx = _longitudinal_weight(tyre, dfz, kappa, alpha, gamma) * fx0
    weight = _lateral_weight(tyre, dfz, kappa, alpha, gamma)
    fy_weighted = weight * fy0  # F_y' of (4.E74)
    fy = fy_weighted + _slip_induced_side_force(tyre, fz, dfz, kappa, alpha, gamma, mu_y)

    is_6 = tyre.mf6 > 0.0
    if anywhere(is_6):  # MF 6: the force that the trail is an arm of is that of an upright wheel
        fy_weighted = where(
            is_6, weight * _upright_lateral(tyre, fz, dfz, nominal, alpha), fy_weighted
        )

    trail_length = travel * trail(tyre, fz, dfz, nominal, kappa, alpha, gamma, ratio)
    residual = residual_torque(
        tyre, fz, dfz, kappa, alpha, gamma, ratio, shift_h + shift_v / ky, ky / (mu_y * fz)
    )
    arm = force_arm(tyre, dfz, nominal, fy, gamma)

    return (
        share * fx,
        share * fy * side,
        share * overturning_moment(tyre, fz, nominal, fy, gamma) * side,
        -share * travel * rolling_resistance(tyre, fz, nominal, fx, vx, gamma),
        share * (-trail_length * fy_weighted + residual + arm * fx) * side,  # (4.E71), (4.E72)
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

    PAC2002: sigma_kappa = F_z (p_Tx1 + p_Tx2 df_z) exp(-p_Tx3 df_z) R_0/F_z0,
    sigma_alpha = p_Ty1 sin(2 arctan(F_z/(p_Ty2 F_z0))) (1 - p_Ky3 |gamma|) R_0, both scaled.
    MF 6: slip stiffness over that of the carcass; Besselink et al. 2010, Eqs. (14)-(17).

    Args:
        tyre: the tyre's record.
        fz: wheel load [N].
        gamma: inclination [rad].
    """
    _, fz, dfz, nominal = _load(tyre, fz)
    inclination = _inclination(tyre, gamma)
    gamma = inclination * tyre.lgay
    along = fz * (tyre.ptx1 + tyre.ptx2 * dfz) * exp(-tyre.ptx3 * dfz) / nominal
    across = tyre.pty1 * sin_2_arctan(fz / (tyre.pty2 * nominal)) * tyre.lfzo
    across *= maximum(1.0 - tyre.pky3 * absolute(gamma), LEAST_SHARE)
    along, across = along * tyre.unloaded_radius, across * tyre.unloaded_radius
    is_6 = tyre.mf6 > 0.0
    if anywhere(is_6):
        carcass_x = 1.0 + dfz * (tyre.pcfx1 + dfz * tyre.pcfx2)
        carcass_y = 1.0 + dfz * (tyre.pcfy1 + dfz * tyre.pcfy2)
        carcass_x = maximum(carcass_x, LEAST_SHARE) * tyre.longitudinal_stiffness
        carcass_y = maximum(carcass_y, LEAST_SHARE) * tyre.lateral_stiffness
        along = where(is_6, _slip_stiffness(tyre, fz, dfz) / carcass_x, along)
        cornering = -_cornering_stiffness(tyre, fz, nominal, inclination)
        across = where(is_6, cornering / carcass_y, across)
    return (
        maximum(along * tyre.lsgkp, LEAST_RELAXATION),
        maximum(across * tyre.lsgal, LEAST_RELAXATION),
    )


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
    return d * sin(c * bend(b * slip, e * tyre.lex)) + shift_v


@inlined
def _pure_lateral(tyre, fz, dfz, alpha, gamma, ky, mu, shift_h, shift_v):
    """Returns F_y0 [N], the lateral force without longitudinal slip. (4.E19)-(4.E26)."""
    slip = alpha + shift_h
    c = tyre.pcy1 * tyre.lcy
    d = mu * fz
    e = (tyre.pey1 + tyre.pey2 * dfz) * tyre.ley
    bent = (tyre.pey3 + tyre.pey4 * gamma * tyre.lgay) * copysign(1.0, slip)
    e *= 1.0 + tyre.pey5 * gamma * gamma - bent
    b = ky / (c * d)
    return d * sin(c * bend(b * slip, e)) + shift_v


@inlined
def _upright_lateral(tyre, fz, dfz, nominal, alpha):
    """Returns F_y0 [N] without inclination. (4.E32)."""
    upright = 0.0 * alpha
    ky = _cornering_stiffness(tyre, fz, nominal, upright)
    mu = _lateral_friction(tyre, dfz, upright)
    shift_h, shift_v = _lateral_shifts(tyre, fz, dfz, upright, ky)
    return _pure_lateral(tyre, fz, dfz, alpha, upright, ky, mu, shift_h, shift_v)


@inlined
def _longitudinal_weight(tyre, dfz, kappa, alpha, gamma):
    """Returns G_xalpha, the share of F_x0 that side slip leaves. (4.E50)-(4.E57)."""
    b = tyre.rbx1 + tyre.rbx3 * gamma * gamma
    b *= cos_arctan(tyre.rbx2 * kappa) * tyre.lxal
    return _weight(b, tyre.rcx1, tyre.rex1 + tyre.rex2 * dfz, alpha, tyre.rhx1)


@inlined
def _lateral_weight(tyre, dfz, kappa, alpha, gamma):
    """Returns G_ykappa, the share of F_y0 that longitudinal slip leaves. (4.E59)-(4.E65)."""
    b = tyre.rby1 + tyre.rby4 * gamma * gamma
    b *= cos_arctan(tyre.rby2 * (alpha - tyre.rby3)) * tyre.lyka
    shift = tyre.rhy1 + tyre.rhy2 * dfz
    return _weight(b, tyre.rcy1, tyre.rey1 + tyre.rey2 * dfz, kappa, shift)


@inlined
def _weight(b, c, e, slip, shift):
    """Returns a cosine weight that is 1 at no slip and falls to nought. (4.E51), (4.E59)."""
    weight = maximum(cos(c * bend(b * (slip + shift), e)), 0.0)
    return weight / maximum(cos(c * bend(b * shift, e)), LEAST_SHARE)


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
def _slip_stiffness(tyre, fz, dfz):
    """Returns K_xkappa > 0 [N]. (4.E15)."""
    slope = maximum(tyre.pkx1 + tyre.pkx2 * dfz, LEAST_SHARE * tyre.pkx1)
    return fz * slope * exp(tyre.pkx3 * dfz) * tyre.lkx


@inlined
def _cornering_stiffness(tyre, fz, nominal, gamma):
    """Returns K_yalpha < 0 [N/rad]. (4.E25), in MF 5.2 with 1 - p_Ky3 |gamma|."""
    rise = sin_2_arctan(fz / (tyre.pky2 * nominal))
    is_6 = tyre.mf6 > 0.0
    if anywhere(is_6):  # p_Ky4 for 2, and p_Ky5
        at = maximum(tyre.pky2 + tyre.pky5 * gamma * gamma, LEAST_SHARE * tyre.pky2)
        general = sin(tyre.pky4 * atan(fz / (at * nominal)))
        rise = where(is_6, maximum(general, LEAST_SHARE * rise), rise)
    upright = tyre.pky1 * nominal * rise * tyre.lky
    return upright * maximum(1.0 - tyre.pky3 * absolute(gamma * tyre.lgay), LEAST_SHARE)


@inlined
def _lateral_friction(tyre, dfz, gamma):
    """Returns mu_y > 0. (4.E23)."""
    inclination = gamma * tyre.lgay
    mu = (tyre.pdy1 + tyre.pdy2 * dfz) * (1.0 - tyre.pdy3 * inclination * inclination) * tyre.lmuy
    return maximum(mu, LEAST_FRICTION)


@inlined
def _lateral_shifts(tyre, fz, dfz, gamma, ky):
    """Returns S_Hy [rad] and S_Vy [N]: ply steer, conicity, camber. (4.E27)-(4.E30)."""
    inclination = gamma * tyre.lgay
    horizontal = (tyre.phy1 + tyre.phy2 * dfz) * tyre.lhy + tyre.phy3 * inclination
    vertical = (tyre.pvy1 + tyre.pvy2 * dfz) * tyre.lvy
    thrust = (tyre.pvy3 + tyre.pvy4 * dfz) * inclination
    vertical += thrust
    is_6 = tyre.mf6 > 0.0
    if anywhere(is_6):  # camber stiffness K_ygamma0 = F_z (p_Ky6 + p_Ky7 df_z)
        camber = (tyre.pky6 + tyre.pky7 * dfz) * gamma - thrust * tyre.lmuy
        horizontal += where(is_6, fz * camber / ky, 0.0)
    return horizontal, fz * vertical * tyre.lmuy


@inlined
def _slip_induced_side_force(tyre, fz, dfz, kappa, alpha, gamma, mu_y):
    """Returns S_Vykappa [N], the side force that driving or braking induces. (4.E66), (4.E67)."""
    d = mu_y * fz * (tyre.rvy1 + tyre.rvy2 * dfz + tyre.rvy3 * gamma)
    d *= cos_arctan(tyre.rvy4 * alpha)
    return d * sin(tyre.rvy5 * atan(tyre.rvy6 * kappa)) * tyre.lvyka
