"""What the wheel asks of a tyre, whatever its model: forces, stiffness and relaxation, compiled.

To add a model: write a module like `twin.tyre.linear`, with FIELDS and three compiled functions of
the same arguments; then name it in MODELS and call it in the three functions here. A tyre's record
has its model's number in `model`; the tyres of one car may be of different models.
"""

from twin.compiled.simd import absolute, anywhere, inlined, where
from twin.toml_fields import Field
from twin.tyre import linear
from twin.tyre.linear import linear_forces, linear_relaxation, linear_stiffness
from twin.tyre.magic_formula import magic_formula, relaxation_lengths, slip_stiffnesses
from twin.tyre.shapes import Tyre, compiled

MAGIC_FORMULA, LINEAR = 0.0, 1.0
# Of the models that a TOML file describes: number and fields by the model's name
MODELS: dict[str, tuple[float, tuple[Field, ...]]] = {"linear": (LINEAR, linear.FIELDS)}


@inlined
def _is(tyre, model):
    return absolute(tyre.model - model) < 0.5


@inlined
def _two(condition, yes, no):
    return where(condition, yes[0], no[0]), where(condition, yes[1], no[1])


@compiled
def forces(
    tyre: Tyre, fz: float, kappa: float, alpha: float, gamma: float, vx: float, side: float
) -> tuple[float, float, float, float, float]:
    """Computes the steady-state forces and moments of a tyre at combined slip.

    Args:
        tyre: the tyre's record.
        fz: wheel load [N].
        kappa: longitudinal slip -v_sx/|v_x| [-].
        alpha: slip angle atan(v_sy/|v_x|) [rad].
        gamma: inclination about x [rad].
        vx: speed of the wheel centre along x [m/s].
        side: +1 for the tyre as measured, -1 for its mirror image.

    Returns:
        F_x, F_y [N], M_x, M_y, M_z [N m] at the contact point, signs as in `magic_formula`.
    """
    out = magic_formula(tyre, fz, kappa, alpha, gamma, vx, side)
    is_linear = _is(tyre, LINEAR)
    if anywhere(is_linear):
        other = linear_forces(tyre, fz, kappa, alpha, gamma, vx, side)
        fx, fy = _two(is_linear, (other[0], other[1]), (out[0], out[1]))
        mx, my = _two(is_linear, (other[2], other[3]), (out[2], out[3]))
        out = (fx, fy, mx, my, where(is_linear, other[4], out[4]))
    return out


@compiled
def stiffness(tyre: Tyre, fz: float, gamma: float) -> tuple[float, float]:
    """Returns the slopes of F_x over kappa [N] and of -F_y over alpha [N/rad], positive.

    Args:
        tyre: the tyre's record.
        fz: wheel load [N].
        gamma: inclination [rad].
    """
    out = slip_stiffnesses(tyre, fz, gamma)
    is_linear = _is(tyre, LINEAR)
    if anywhere(is_linear):
        out = _two(is_linear, linear_stiffness(tyre, fz, gamma), out)
    return out


@compiled
def relaxation(tyre: Tyre, fz: float, gamma: float) -> tuple[float, float]:
    """Returns the relaxation lengths along and across [m], positive.

    Args:
        tyre: the tyre's record.
        fz: wheel load [N].
        gamma: inclination [rad].
    """
    out = relaxation_lengths(tyre, fz, gamma)
    is_linear = _is(tyre, LINEAR)
    if anywhere(is_linear):
        out = _two(is_linear, linear_relaxation(tyre, fz, gamma), out)
    return out
