"""Identifiability of the load in a drive: the Cramer-Rao bound on each parameter.

With white sensor noise of standard deviation sd_j and the sensitivities S_i = dy/dp_i of the
outputs over the whole drive, Fisher's information is

    I_ik = sum over channels j and samples n of S_i[n, j] S_k[n, j] / sd_j^2.

No unbiased estimator has a smaller standard deviation than 1 / sqrt(I_ii) where all else is known,
or sqrt((I^-1)_ii) where all parameters of I are unknown. The sensitivities are differences between
runs of the black box, which is never looked into.

The bound assumes that the estimator is unbiased, has the vehicle's own model and exact inputs, and
knows the speed at the start, where the car has settled under its load. It may therefore integrate:
a wheel speed that drifts from the twin's over two minutes tells the mass to a few grams, and no
model of a real car is that good. A law that uses one channel, or not all samples, is to be held
against the bound of just these. Prior knowledge is not counted: an estimator that starts within a
narrow prior can be better. And it bounds the root mean square of the error over seeds, not its
median size, which for a normal error is 0.67 of that.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimators.til.observer import Observer
from twin import PARAMETER, PARAMETERS, Drive, Twin, TwinError

Array = NDArray[np.float64]

# Differences are good to some 1e-4 of a sensitivity. Of scaled information, less than the square of
# that is error: the combination of parameters is not identifiable.
LEAST_INFORMATION = 1e-8
# Share that a parameter has in such a combination before it counts as touched
LEAST_SHARE = 1e-6


def sensitivities(
    twin: Twin,
    drive: Drive,
    parameters: Sequence[str],
    at: Mapping[str, float],
    *,
    speed: float,
    offsets: Mapping[str, float] | None = None,
) -> Array:
    """What a parameter changes in the outputs of the open-loop twin over a drive.

    Args:
        twin: the black box, ours from now on.
        drive: gives the inputs; its measurements play no part.
        parameters: of `twin.PARAMETERS`, p of them.
        at: the deltas around which to differ, by name; zero where not given.
        speed: at the start of the drive [m/s].
        offsets: by name, instead of the steps of their records.

    Returns:
        (p, N, 10) derivatives [unit of the output over that of the parameter].

    Raises:
        TwinError: an unknown parameter, one that no rigid body can have, or the twin blew up.
    """
    observer = Observer(twin, [])
    for name in parameters:
        if name not in PARAMETERS:
            raise TwinError(
                f"cramer_rao: parameter {name!r} is unknown; allowed: {', '.join(PARAMETERS)}"
            )

    def outputs(load: Mapping[str, float]) -> Array:
        observer.reset(speed, load)
        run = observer.run(drive)
        for name, value in load.items():
            if abs(run[name][0] - value) > 1e-9 * (1.0 + abs(value)):
                raise TwinError(
                    f"cramer_rao: {name} is {value:g}; allowed: of a rigid body, such as "
                    f"{run[name][0]:g} with the other parameters as they are"
                )
        return run.outputs

    return central_differences(
        outputs,
        parameters,
        at,
        {name: PARAMETER[name].step for name in parameters} | dict(offsets or {}),
    )


def central_differences(
    outputs: Callable[[Mapping[str, float]], Array],
    parameters: Sequence[str],
    at: Mapping[str, float],
    offsets: Mapping[str, float],
) -> Array:
    """(p, N, ny) derivatives of any black box's outputs (N, ny), given its parameters by name."""
    columns = []
    for name in parameters:
        middle, h = at.get(name, 0.0), offsets[name]
        above, below = ({**at, name: middle + sign * h} for sign in (1.0, -1.0))
        columns.append((outputs(above) - outputs(below)) / (2.0 * h))
    return np.array(columns)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CramerRaoBound:
    """The least standard deviations with which p parameters can be estimated.

    Attributes:
        parameters: p names.
        information: (p, p) Fisher's, of the parameters in their units.
        single: (p,) standard deviation if all the others are known; inf: not identifiable.
        joint: (p,) if all of them are unknown; inf: not distinguishable from the others.
        correlation: (p, p) of the errors of the joint estimate; NaN where joint is inf.
    """

    parameters: tuple[str, ...]
    information: Array
    single: Array
    joint: Array
    correlation: Array

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Parameters that the channels do not identify, or not apart from each other."""
        pairs = zip(self.parameters, self.joint, strict=True)
        return tuple(name for name, sd in pairs if np.isinf(sd))


def cramer_rao(
    parameters: Sequence[str], sensitivity: Array, sd: Array, *, free_offsets: bool = False
) -> CramerRaoBound:
    """The Cramer-Rao bound.

    Args:
        parameters: p names.
        sensitivity: (p, N, ny) derivatives of the outputs; leave out samples that are not used.
        sd: (ny,) standard deviation of each channel's white noise; NaN: the channel is not used.
        free_offsets: whether each channel has an unknown constant offset besides, such as a bias.

    Raises:
        TwinError: a shape does not fit, a channel in use has no noise, a derivative is not finite.
    """
    sensitivity, sd = np.asarray(sensitivity, dtype=np.float64), np.asarray(sd, dtype=np.float64)
    _check(parameters, sensitivity, sd)
    used = ~np.isnan(sd)
    scaled = sensitivity[:, :, used] / sd[used]
    if not np.isfinite(scaled).all():
        raise TwinError("cramer_rao: a sensitivity is not finite; allowed: finite numbers")
    if free_offsets and scaled.shape[1]:
        scaled = scaled - scaled.mean(axis=1, keepdims=True)  # what an offset leaves to be seen
    flat = scaled.reshape(len(parameters), -1)
    information = flat @ flat.T
    with np.errstate(divide="ignore"):
        single = 1.0 / np.sqrt(np.diag(information))
    joint, correlation = _invert(information, single)
    return CramerRaoBound(
        parameters=tuple(parameters),
        information=information,
        single=single,
        joint=joint,
        correlation=correlation,
    )


def _invert(information: Array, single: Array) -> tuple[Array, Array]:
    """Joint standard deviations and correlations, of what is identifiable."""
    seen = np.isfinite(single)
    scale = np.where(seen, single, 0.0)
    values, vectors = np.linalg.eigh(scale[:, None] * information * scale)
    null = values <= LEAST_INFORMATION
    touched = (vectors[:, null] ** 2).sum(axis=1) > LEAST_SHARE
    rest = vectors[:, ~null]
    covariance = rest / values[~null] @ rest.T  # in units of the single standard deviations
    spread = np.where(touched, np.nan, np.sqrt(np.diag(covariance)))
    joint = np.where(touched, np.inf, scale * spread)
    return joint, covariance / np.outer(spread, spread)


def _check(parameters: Sequence[str], sensitivity: Array, sd: Array) -> None:
    if sensitivity.ndim != 3 or sensitivity.shape[::2] != (len(parameters), sd.size):
        raise TwinError(
            f"cramer_rao: sensitivity has shape {sensitivity.shape}; allowed: "
            f"({len(parameters)} parameters, samples, {sd.size} channels)"
        )
    if (sd <= 0.0).any() or np.isinf(sd).any():
        raise TwinError(
            f"cramer_rao: standard deviations of the noise are {sd.tolist()}; allowed: more than 0 "
            "(without noise there is no limit), or NaN for a channel that is not used"
        )
