"""What the joint observer will know of a drive before it has been driven with a real car.

The observer runs over the noise-free drive of a car that it has the true parameters of: nothing is
left to correct, but its sensitivities, its gate of excitation, its linearisation errors and so the
evidence that it collects are those it will have. Noise and errors of the model are put in after.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.joint.model_error import LENGTH
from estimators.joint.observer import JointObserver, JointSettings
from twin import Drive, TwinError, Vehicle

Array = NDArray[np.float64]

EVERY = 0.25  # [s] between looks at the evidence
LONGEST = 600.0  # [s] that information is extrapolated to
_NEVER = 1e9  # [s], one segment that never ends: all evidence is in it


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelError:
    """How much less a real car tells than its twin's own copy.

    Attributes:
        residual_sd: (10,) of each channel, as if of a sample's white noise; empty: no more than
            the noise itself.
        widening: of the covariance, for what the model has wrong in all parts of a drive alike.
        grows: whether the widening grows beyond `model_error.LENGTH` seconds, as the observer's.
    """

    residual_sd: tuple[float, ...] = ()
    widening: float = 1.0
    grows: bool = False

    def factor(self, time: Array) -> Array:
        """Of the covariance at times [s]."""
        longer = np.maximum(1.0, time / LENGTH) if self.grows else np.ones_like(time)
        return self.widening * longer

    def noise_factor(self, noise_sd: Array) -> Array:
        """(10,) of the variance of each channel."""
        if not self.residual_sd:
            return np.ones_like(noise_sd)
        return np.maximum(1.0, (np.array(self.residual_sd) / noise_sd) ** 2)


NO_MODEL_ERROR = ModelError()
# Medians of the joint observer's own budget over eight drawn SUVs (`random_car` seeds 100 to 107)
# on 40 s of the mixed drive, SNR 20 dB
REAL_CAR = ModelError(
    residual_sd=(0.35, 0.47, 0.69, 0.063, 0.029, 0.033, 0.32, 0.34, 0.33, 0.36),
    widening=38.0,
    grows=True,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Information:
    """Information that a drive gives the joint observer, over time.

    Attributes:
        estimated: q names.
        prior: (q,) standard deviations before the drive.
        time: (K,) [s], from `EVERY` on.
        gained: (K, ny, q, q) Fisher's until then, by channel, the prior not included.
        noise_sd: (ny,) of a sample.
        segment: [s] for which the common speed of the twins is one unknown.
        repeats: whether the whole drive comes again, as passes do; else its second half goes on.
    """

    estimated: tuple[str, ...]
    prior: Array
    time: Array
    gained: Array
    noise_sd: Array
    segment: float
    repeats: bool = False


def information_of(
    vehicle: Vehicle,
    noise_sd: ArrayLike,
    drive: Drive,
    at: Mapping[str, float] | None = None,
    *,
    settings: JointSettings | None = None,
    repeats: bool = False,
) -> Information:
    """Collects the evidence of a drive.

    Args:
        vehicle: of the twins.
        noise_sd: (10,) standard deviation of a sample's white noise; NaN: a channel not used.
        drive: noise-free, of the vehicle with the parameters `at`; truth tells its first speed.
        at: deltas of the parameters by name.
        settings: of the observer; None: its own.
        repeats: see `Information`.

    Raises:
        TwinError: the drive is shorter than two looks, or a twin has blown up.
    """
    settings = settings or JointSettings()
    every = round(EVERY / drive.dt)
    if len(drive) < 2 * every:
        raise TwinError(
            f"plan: a drive of {drive.duration:.3g} s; allowed: {2 * EVERY:g} s or more"
        )
    observer = JointObserver(vehicle, noise_sd, replace(settings, segment=_NEVER))
    observer.reset(float(drive.truth["vx"][0]), at)
    gained = []
    for k in range(len(drive) // every):
        observer.run(drive[k * every : (k + 1) * every])
        gained.append(observer.segment_information)
    return Information(
        estimated=observer.estimated,
        prior=observer.prior,
        time=np.arange(1, len(gained) + 1) * np.float64(EVERY),
        gained=np.array(gained),
        noise_sd=np.asarray(noise_sd, dtype=np.float64),
        segment=settings.segment,
        repeats=repeats,
    )


def expected_sd(
    information: Information, time: ArrayLike, error: ModelError = NO_MODEL_ERROR
) -> Array:
    """(T, q) standard deviations at times, beyond the drive by extrapolation.

    Args:
        information: of a drive.
        time: (T,) [s].
        error: of the model.
    """
    time = np.atleast_1d(np.asarray(time, dtype=np.float64))
    gained = _at(information, _without_speed(information, error), time)
    before = np.diag(information.prior**-2.0)
    known = np.linalg.inv(before + gained)
    sd = np.sqrt(np.diagonal(known, axis1=1, axis2=2) * error.factor(time)[:, None])
    return np.minimum(sd, information.prior)


def seconds_until(
    information: Information, wanted: Mapping[str, float], error: ModelError = NO_MODEL_ERROR
) -> tuple[float, float]:
    """When all wanted standard deviations are reached, and by what factor they are missed at best.

    Args:
        information: of a drive.
        wanted: standard deviations by name.
        error: of the model.

    Returns:
        Seconds, inf if not within `LONGEST`; and the least over time of the largest ratio of a
        standard deviation to the wanted one.
    """
    grid = np.unique(np.concatenate([information.time, np.geomspace(EVERY, LONGEST, 160)]))
    ratio = _worst_ratio(information, wanted, grid, error)
    reached = np.flatnonzero(ratio <= 1.0)
    if not reached.size:
        return np.inf, float(ratio.min())
    k = int(reached[0])
    if k == 0:
        return float(grid[0]), float(ratio.min())
    # between the points the sd falls about as a power of time
    slope = np.log(ratio[k] / ratio[k - 1]) / np.log(grid[k] / grid[k - 1])
    return float(grid[k - 1] * ratio[k - 1] ** (-1.0 / slope)), float(ratio.min())


def _worst_ratio(
    information: Information, wanted: Mapping[str, float], time: Array, error: ModelError
) -> Array:
    """(T,) largest ratio of a standard deviation to the wanted one."""
    sd = expected_sd(information, time, error)
    columns = [information.estimated.index(name) for name in wanted]
    return (sd[:, columns] / np.array(list(wanted.values()))).max(axis=1)


def _without_speed(information: Information, error: ModelError) -> Array:
    """(K, q, q) cumulative, all channels together, the twins' speed another in every segment."""
    weight = np.nan_to_num(1.0 / error.noise_factor(information.noise_sd))
    total = np.einsum("kjab,j->kab", information.gained, weight)
    if "speed" not in information.estimated:
        return total
    speed = information.estimated.index("speed")
    size = max(1, round(information.segment / EVERY))
    result = np.empty_like(total)
    complete, start = np.zeros_like(total[0]), np.zeros_like(total[0])
    for k in range(len(total)):
        result[k] = complete + _marginal(total[k] - start, speed, float(information.prior[speed]))
        if (k + 1) % size == 0:
            complete, start = result[k], total[k]
    return result


def _marginal(information: Array, unknown: int, prior: float) -> Array:
    """Information (q, q) without that on an unknown, which has a prior sd of its own."""
    column = information[:, unknown].copy()
    left = information - np.outer(column, column) / (column[unknown] + prior**-2.0)
    left[unknown], left[:, unknown] = 0.0, 0.0
    return left


def _at(information: Information, gained: Array, time: Array) -> Array:
    """(T, q, q) cumulative information at times."""
    end, last = float(information.time[-1]), gained[-1]
    known = np.concatenate([[0.0], information.time])
    values = np.concatenate([np.zeros_like(gained[:1]), gained])

    def within(t: float) -> Array:
        k = min(int(np.searchsorted(known, t, side="right")) - 1, known.size - 2)
        part = (t - known[k]) / (known[k + 1] - known[k])
        return values[k] + part * (values[k + 1] - values[k])

    if information.repeats:
        return np.array([(t // end) * last + within(t % end) for t in time])
    half = within(0.5 * end)
    return np.array(
        [within(t) if t <= end else last + (t - end) / (0.5 * end) * (last - half) for t in time]
    )


def names_reached(
    information: Information, names: Sequence[str], share: float, error: ModelError, until: float
) -> dict[str, float]:
    """Seconds until each parameter's sd is below a share of its prior, inf if not in time."""
    found = {}
    for name in names:
        prior = float(information.prior[information.estimated.index(name)])
        seconds, _ = seconds_until(information, {name: share * prior}, error)
        found[name] = seconds if seconds <= until else np.inf
    return found
