"""Keeps an estimate of a rigid body physically possible, by the least likely-changing step.

Mass must stay positive, the principal moments positive, and none of them may exceed the sum of the
others. Both conditions on the inertia tensor J are linear in its entries once the principal axes v
are known: v' J v is a moment, tr J - 2 v' J v the slack of the triangle inequality. Among all
parameters that satisfy such a condition c' z >= b the one nearest in the metric of the estimate's
own covariance P is z + P c (b - c' z) / (c' P c): what is known well moves least, and what is
correlated moves along.
"""

import numpy as np
from numba import njit

# Least share of the nominal mass and of the least nominal moment that is left of a body; the twin
# itself refuses less than 0.3 of them
LEAST_SHARE = 0.32
# Least slack of the triangle inequality, of the largest moment
LEAST_SLACK = 2e-3
ROUNDS = 8  # the axes turn a little with each step

# Where the load stands among the parameters: mass, three of the CM, then Jxx Jyy Jzz Jxy Jxz Jyz
MASS, INERTIA = 0, 4
_ROWS = np.array([0, 1, 2, 0, 0, 1])
_COLUMNS = np.array([0, 1, 2, 1, 2, 2])


@njit(cache=True, nogil=True)
def tensor(nominal, theta):
    """(3, 3) inertia of the parameters (np,) beside the nominal (np,) [kg m2]."""
    found = np.empty((3, 3))
    for k in range(6):
        value = nominal[INERTIA + k] + theta[INERTIA + k]
        found[_ROWS[k], _COLUMNS[k]] = value
        found[_COLUMNS[k], _ROWS[k]] = value
    return found


@njit(cache=True, nogil=True)
def _meet(z, covariance, column, wanted):
    """Moves z (q,) until column' z has risen by what is wanted; tells whether it can."""
    along = covariance @ column
    size = column @ along
    if not size > 0.0:
        return False
    z += along * (wanted / size)
    return True


@njit(cache=True, nogil=True)
def project(z, covariance, index, nominal, theta):
    """Moves estimates to the nearest possible body.

    Args:
        z: (q,) estimates, changed in place; the first p are parameters, others come after.
        covariance: (q, q) of z.
        index: (p,) of each parameter in theta.
        nominal: (np,) the unloaded body; with a NaN nothing is known of it, and nothing moves.
        theta: (np,) all parameters; those of index receive z.
    """
    p = index.size
    for i in range(p):
        theta[index[i]] = z[i]
    if not np.isfinite(nominal[MASS : INERTIA + 6].sum()):
        return
    column = np.zeros(z.size)
    least_moment = LEAST_SHARE * min(nominal[4], min(nominal[5], nominal[6]))
    for _ in range(ROUNDS):
        for i in range(p):
            theta[index[i]] = z[i]
        changed = False
        shortfall = (LEAST_SHARE - 1.0) * nominal[MASS] - theta[MASS]
        if shortfall > 0.0:
            for i in range(p):
                column[i] = 1.0 if index[i] == MASS else 0.0
            changed = _meet(z, covariance, column, shortfall)
        moments, axes = np.linalg.eigh(tensor(nominal, theta))
        if moments[0] < least_moment:
            _fill(column, index, axes[:, 0], 0.0, 1.0)
            changed |= _meet(z, covariance, column, least_moment - moments[0])
        elif moments[0] + moments[1] - moments[2] < LEAST_SLACK * moments[2]:
            _fill(column, index, axes[:, 2], 1.0, -2.0)
            slack = moments[0] + moments[1] - moments[2]
            changed |= _meet(z, covariance, column, 1.5 * LEAST_SLACK * moments[2] - slack)
        if not changed:
            return


@njit(cache=True, nogil=True)
def _fill(column, index, axis, trace, moment):
    """Gradient of trace * tr J + moment * axis' J axis with respect to the estimates."""
    for i in range(index.size):
        k = index[i] - INERTIA
        column[i] = 0.0
        if 0 <= k < 6:
            row, other = _ROWS[k], _COLUMNS[k]
            if row == other:
                column[i] = trace + moment * axis[row] ** 2
            else:
                column[i] = 2.0 * moment * axis[row] * axis[other]
