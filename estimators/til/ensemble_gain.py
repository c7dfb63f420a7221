"""A linear law of correction from how twins erred, without a search: a reduced K, TiL Eq. (23).

The errors of many plausible cars (`estimators.til.forecast_errors`) give a linear model of the
error,

    x(k+1) = A x(k) + w(k),    e(k) = C x(k) + v(k),    x: states, e: innovations, vehicle less twin

by least squares, w and v being what it leaves: what the twin lacks and the sensors add. They belong
together, as a force that the twin lacks shows in an acceleration at once. Two ways lead from there
to a gain:

* `optimal_gain`, unsupervised: the covariances of w and v give the linear gain of least variance in
  closed form, that of Kalman with correlated noises. Most of its 210 entries do next to nothing;
  `kept_entries` says which matter, `of_rank` how many combinations of outputs do.
* `sparse_gain`, supervised: a LASSO of the errors on the innovations of their block, state by
  state, without the model.

A car is as good as its mirror image. `mirrored` doubles the data by it, so that no gain turns the
car one way only.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from estimators.til.forecast_errors import BLOCK, CORRECTED, ForecastErrors
from estimators.til.gains import FEED_THROUGH
from twin import OUTPUTS, TwinError

Array = NDArray[np.float64]

CORRELATED = 5  # blocks: w and v count as white beyond it; chosen
LARGEST_FEED_THROUGH = 0.9  # of an acceleration on its own speed; 1 takes the twin's tyres away
ODD = ("y", "roll", "yaw", "vy", "ay", "roll_rate", "yaw_rate")  # change their sign in a mirror
_OTHER_SIDE = {"fl": "fr", "fr": "fl", "rl": "rr", "rr": "rl"}
_ROUNDS, _DAMPING = 0, 0.5
_SWEEPS = 200  # of the coordinate descent


class ErrorModel(NamedTuple):
    """How an error moves and shows, in blocks of `BLOCK`."""

    transition: Array  # (n, n) A
    output: Array  # (ny, n) C
    process: Array  # (n, n) covariance of w
    noise: Array  # (ny, ny) of v
    cross: Array  # (n, ny) of w and v


class EnsembleGain(NamedTuple):
    """A linear gain and what its entries do.

    `gain` is what one block corrects; K is `gain / BLOCK`, per second.
    """

    gain: Array  # (n, ny)
    innovation: Array  # (ny, ny) covariance of the innovations under this gain
    error: Array  # (n, n) covariance of the errors before a block's correction


def mirrored(drives: Sequence[ForecastErrors]) -> list[ForecastErrors]:
    """The drives and their mirror images, left for right."""
    states, state_sign = _mirror(CORRECTED)
    outputs, output_sign = _mirror(OUTPUTS)
    return [
        *drives,
        *(
            ForecastErrors(
                one.before[:, states] * state_sign,
                one.after[:, states] * state_sign,
                one.innovations[:, outputs] * output_sign,
            )
            for one in drives
        ),
    ]


def _mirror(names: Sequence[str]) -> tuple[list[int], Array]:
    """Where each name's mirror image stands, and its sign."""
    ends = [name.rpartition("_") for name in names]
    other = [
        f"{head}_{_OTHER_SIDE[end]}" if end in _OTHER_SIDE else name
        for name, (head, _, end) in zip(names, ends, strict=True)
    ]
    sign = np.array([-1.0 if name in ODD else 1.0 for name in names])
    return [list(names).index(name) for name in other], sign


def mirror_pairs() -> Array:
    """(m, n, ny) entries of a gain that are one in a mirror: 1, or -1 for a change of sign."""
    states, state_sign = _mirror(CORRECTED)
    outputs, output_sign = _mirror(OUTPUTS)
    found = []
    for i in range(len(CORRECTED)):
        for j in range(len(OUTPUTS)):
            other, sign = (states[i], outputs[j]), state_sign[i] * output_sign[j]
            if other < (i, j) or (other == (i, j) and sign < 0.0):
                continue  # its other side is there, or it is none: it turns the car one way
            pair = np.zeros((len(CORRECTED), len(OUTPUTS)))
            pair[other], pair[i, j] = sign, 1.0
            found.append(pair)
    return np.array(found)


def error_model(drives: Sequence[ForecastErrors]) -> ErrorModel:
    """Fits the linear model of the error.

    Args:
        drives: of several cars.

    Raises:
        TwinError: too few blocks for so many states.
    """
    before = np.vstack([one.before for one in drives])
    after = np.vstack([np.hstack([one.after, one.innovations]) for one in drives])
    n = before.shape[1]
    if len(before) < 10 * n:
        raise TwinError(
            f"ensemble: has {len(before)} blocks of {BLOCK:g} s; allowed: {10 * n} or more"
        )
    fitted: Array = np.asarray(np.linalg.lstsq(before, after, rcond=None)[0], dtype=np.float64)
    left = tuple(np.hstack([one.after, one.innovations]) - one.before @ fitted for one in drives)
    covariance = _long_run(left, CORRELATED)
    return ErrorModel(
        fitted.T[:n], fitted.T[n:], covariance[:n, :n], covariance[n:, n:], covariance[:n, n:]
    )


def _long_run(residuals: Sequence[Array], length: int) -> Array:
    """Covariance of white noise with the same mean square over so many blocks."""
    means = [
        one[: len(one) // length * length].reshape(-1, length, one.shape[1]).mean(axis=1)
        for one in residuals
    ]
    together = np.vstack(means)
    return length * together.T @ together / len(together)


def optimal_gain(model: ErrorModel) -> EnsembleGain:
    """The linear gain of least variance, in closed form.

    Raises:
        TwinError: there is none, as some growing error shows in no output.
    """
    a, c = model.transition, model.output
    try:
        error = solve_discrete_are(a.T, c.T, model.process, model.noise, s=model.cross)
    except np.linalg.LinAlgError as problem:
        raise TwinError(f"ensemble: has no optimal gain: {problem}") from None
    innovation = c @ error @ c.T + model.noise
    gain = np.linalg.solve(innovation, (a @ error @ c.T + model.cross).T).T
    return EnsembleGain(gain, innovation, error)


def shares(found: EnsembleGain) -> Array:
    """(n, ny) what each entry corrects, over all that its state is corrected by; rms of both."""
    alone = np.abs(found.gain) * np.sqrt(np.diag(found.innovation))
    together = np.sqrt(np.diag(found.gain @ found.innovation @ found.gain.T))
    return alone / np.maximum(together, 1e-300)[:, None]


def kept_entries(found: EnsembleGain, least: float) -> Array:
    """(n, ny) the gain without entries whose share is less."""
    return np.where(shares(found) >= least, found.gain, 0.0)


def directions(found: EnsembleGain) -> Array:
    """(r, n, ny) parts of the gain, the largest first: its singular vectors in units of the errors.

    Their sum is the gain.
    """
    states, outputs = np.sqrt(np.diag(found.error)), np.sqrt(np.diag(found.innovation))
    left, values, right = np.linalg.svd(found.gain * outputs / states[:, None], full_matrices=False)
    parts = np.einsum("ir,r,rj->rij", left, values, right)
    return parts * states[:, None] / outputs


def of_rank(found: EnsembleGain, rank: int) -> Array:
    """(n, ny) the nearest gain that uses so many combinations of the outputs."""
    return directions(found)[:rank].sum(axis=0)


def sparse_gain(drives: Sequence[ForecastErrors], penalty: float) -> Array:
    """(n, ny) a gain by sparse regression of the errors on the innovations of each block.

    Args:
        drives: the data.
        penalty: of the LASSO, share of the least one that leaves no entry; the larger, the fewer.

    Raises:
        TwinError: the penalty is not between 0 and 1.
    """
    if not 0.0 <= penalty < 1.0:
        raise TwinError(f"ensemble: penalty is {penalty}; allowed: 0 or more, less than 1")
    innovations = np.vstack([one.innovations for one in drives])
    return lasso(innovations, np.vstack([one.after for one in drives]), penalty)


def lasso(regressors: Array, targets: Array, penalty: float) -> Array:
    """(n, m) coefficients of n targets on m regressors, each standardised, by coordinate descent.

    Args:
        regressors: (N, m).
        targets: (N, n).
        penalty: on the sum of moduli, share of the least that leaves no coefficient.
    """
    scale, unit = np.sqrt(np.mean(regressors**2, 0)), np.sqrt(np.mean(targets**2, 0))
    scale, unit = np.maximum(scale, 1e-300), np.maximum(unit, 1e-300)
    gram = regressors.T @ regressors / len(regressors) / np.outer(scale, scale)
    moment = targets.T @ regressors / len(regressors) / np.outer(unit, scale)
    level = penalty * np.abs(moment).max(axis=1)
    found = np.zeros_like(moment)
    for _ in range(_SWEEPS):
        before = found.copy()
        for j in range(len(gram)):
            free = moment[:, j] - found @ gram[:, j] + found[:, j] * gram[j, j]
            found[:, j] = np.sign(free) * np.maximum(np.abs(free) - level, 0.0) / gram[j, j]
        if np.abs(found - before).max() < 1e-9:
            break
    return found * unit[:, None] / scale


def entries(gain: Array) -> dict[tuple[str, str], float]:
    """The gain as `estimators.til.observer.Observer` takes it [per second], zeros left out.

    An acceleration corrects its own speed by `LARGEST_FEED_THROUGH` at most.

    Args:
        gain: (n, ny) what one block corrects.
    """
    found = {}
    for state, row in zip(CORRECTED, gain / BLOCK, strict=True):
        for output, value in zip(OUTPUTS, row.tolist(), strict=True):
            largest = LARGEST_FEED_THROUGH if (state, output) in FEED_THROUGH else np.inf
            if value != 0.0:
                found[state, output] = min(value, largest)
    return found
