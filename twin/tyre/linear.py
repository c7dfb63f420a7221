"""A linear tyre with a limit of friction: the simplest tyre model, and a pattern for others.

F_x = C_kappa kappa and F_y = -C_alpha alpha, both stiffnesses in proportion to the load; beyond the
limit of friction both shrink alike, so that the force stays on the friction circle. Axes and signs
are those of `twin.tyre.magic_formula`.
"""

from math import nan, pi

from twin.compiled.elementary import clip
from twin.compiled.simd import maximum, sqrt, where
from twin.toml_fields import Field
from twin.tyre.shapes import Tyre, compiled, direction_of_travel

FIELDS = (
    Field("linear_cornering", "1/rad", nan, 1.0, 100.0, "cornering stiffness over load"),
    Field("linear_slip", "1", nan, 1.0, 200.0, "slip stiffness over load"),
    Field("linear_friction", "1", nan, 0.01, 3.0, "limit of the force over load"),
    Field("linear_relaxation_x", "m", 0.2, 0.02, 2.0, "relaxation length along"),
    Field("linear_relaxation_y", "m", 0.5, 0.02, 2.0, "relaxation length across"),
    Field("linear_trail", "m", 0.0, 0.0, 0.2, "pneumatic trail"),
    Field("linear_rolling", "1", 0.01, 0.0, 0.1, "rolling resistance over load"),
)


@compiled
def linear_forces(
    tyre: Tyre, fz: float, kappa: float, alpha: float, gamma: float, vx: float, side: float
) -> tuple[float, float, float, float, float]:
    """Computes F_x, F_y [N], M_x, M_y, M_z [N m]; arguments as in `magic_formula`."""
    load, travel = maximum(fz, 0.0), direction_of_travel(vx)
    c_kappa, c_alpha = linear_stiffness(tyre, load, gamma)
    fx, fy = c_kappa * kappa, -c_alpha * clip(alpha, -0.5 * pi, 0.5 * pi)
    x, y = fx / tyre.lmux, fy / tyre.lmuy
    size, limit = sqrt(x * x + y * y), tyre.linear_friction * load
    share = where(size > limit, limit / size, 1.0)
    fx, fy = share * fx, share * fy
    rolling = tyre.linear_rolling * tyre.lmy * load * tyre.unloaded_radius
    return fx, fy, 0.0 * load, -travel * rolling, -travel * tyre.linear_trail * tyre.ltr * fy


@compiled
def linear_stiffness(tyre: Tyre, fz: float, gamma: float) -> tuple[float, float]:
    """Returns C_kappa [N] and C_alpha [N/rad]."""
    load = maximum(fz, 0.0)
    return tyre.linear_slip * tyre.lkx * load, tyre.linear_cornering * tyre.lky * load


@compiled
def linear_relaxation(tyre: Tyre, fz: float, gamma: float) -> tuple[float, float]:
    """Returns the relaxation lengths along and across [m]."""
    return tyre.linear_relaxation_x * tyre.lsgkp, tyre.linear_relaxation_y * tyre.lsgal
