"""The rolling radius of a tyre under load, the same for every tyre model."""

from twin.compiled.elementary import atan, clip
from twin.compiled.simd import maximum
from twin.tyre.shapes import Tyre, compiled


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
    radius = tyre.unloaded_radius + tyre.growth - loss * tyre.fnomin / tyre.vertical_stiffness
    return maximum(radius, 0.5 * tyre.unloaded_radius)
