"""Road profiles: ISO 8608 with two coherent tracks, and the random walk of TiL Eq. (16)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from twin.errors import TwinError

Array = NDArray[np.float64]

REFERENCE_SPATIAL_FREQUENCY = 0.1  # n0 of ISO 8608 [1/m]
SPATIAL_BAND = (0.011, 2.83)  # where ISO 8608 defines the spectrum [1/m]
ROUGHNESS = {name: 16e-6 * 4.0**i for i, name in enumerate("ABCDEFGH")}
"""Geometric mean of the displacement spectrum G_d(n0) of the ISO 8608 classes [m3]."""

_SPACING = 0.05  # of the stored profile [m]: 7 points in the shortest wave of the band


class Road:
    """A left and a right track over the travelled distance, periodic in the length of the road."""

    def __init__(self, tracks: Array, spacing: float):
        """Makes a road from equidistant heights.

        Args:
            tracks: heights [m], columns left and right. Shape (n, 2).
            spacing: distance of two rows [m].
        """
        self.length = len(tracks) * spacing
        closed = np.vstack([tracks, tracks[:1]])
        self._spline = CubicSpline(np.arange(len(closed)) * spacing, closed, bc_type="periodic")

    def heights(self, distance: ArrayLike) -> Array:
        """Heights [m] of the left and right track at distances [m] of shape (n,). Shape (n, 2)."""
        return self._spline(np.asarray(distance, dtype=float))

    def wheel_heights(self, distance: ArrayLike, wheelbase: float) -> Array:
        """Heights under the wheels of a vehicle: the rear axle follows `wheelbase` behind.

        Args:
            distance: travelled by the front axle [m], the integral of the speed. Shape (n,).
            wheelbase: [m].

        Returns:
            Heights [m] under fl fr rl rr. Shape (n, 4).
        """
        front = np.asarray(distance, dtype=float)
        return np.hstack([self.heights(front), self.heights(front - wheelbase)])


def iso8608_road(
    rng: np.random.Generator,
    *,
    length: float,
    road_class: str = "C",
    coherence_decay: float = 2.0,
) -> Road:
    """Draws a Gaussian road with the spectrum of ISO 8608 and two coherent tracks.

    Each track has the one-sided displacement spectrum G_d(n) = G_d(n0) (n / n0)^-2 between 0.011
    and 2.83 cycles per metre. The tracks are in phase, with the exponential coherence
    |gamma(n)| = exp(-coherence_decay n), the one-parameter form that Bogsjoe (Coherence of road
    roughness in left and right wheel-path, Vehicle System Dynamics 46, 2008) fits to measured
    roads: long waves lift both sides, short ones do not.

    Args:
        rng: the source of chance.
        length: period of the road [m]; at least 1 / 0.011 = 91 m, the longest wave.
        road_class: "A" (smooth) to "H", by the geometric mean of its class.
        coherence_decay: [m]; 0 makes the tracks equal, infinity independent. Default: chosen.
    """
    if road_class not in ROUGHNESS:
        raise TwinError(f"road class: {road_class!r} is none of {', '.join(ROUGHNESS)}")
    if not length >= 1 / SPATIAL_BAND[0]:
        raise TwinError(f"road length: {length} m, must be at least {1 / SPATIAL_BAND[0]:.0f} m")
    if not coherence_decay >= 0:
        raise TwinError(f"road coherence_decay: {coherence_decay} m, must not be negative")
    n_points = int(np.ceil(length / _SPACING))
    frequency = np.fft.rfftfreq(n_points, _SPACING)
    in_band = (frequency >= SPATIAL_BAND[0]) & (frequency <= SPATIAL_BAND[1])
    n = frequency[in_band]
    density = ROUGHNESS[road_class] * (n / REFERENCE_SPATIAL_FREQUENCY) ** -2
    coherence = np.exp(-coherence_decay * n)
    white = rng.standard_normal((2, 2, n.size))
    common, other = white[:, 0] + 1j * white[:, 1]
    spectrum = np.zeros((2, frequency.size), dtype=complex)
    amplitude = np.sqrt(density * frequency[1]) * n_points / 2
    spectrum[0, in_band] = amplitude * common
    spectrum[1, in_band] = amplitude * (coherence * common + np.sqrt(1 - coherence**2) * other)
    return Road(np.fft.irfft(spectrum, n_points).T, _SPACING)


def random_walk_heights(
    rng: np.random.Generator, time: Array, *, delay: float, intensity: float = 0.01
) -> Array:
    """Random-walk road of TiL Eq. (16), the same under the left and the right wheels.

    The paper's standard deviation is read as an intensity: the height walks by
    intensity * sqrt(dt) per sample, so the road does not depend on the sample time. The rear axle
    follows by wheelbase / speed (the paper prints the inverse).

    Args:
        rng: the source of chance.
        time: equidistant [s]. Shape (n,).
        delay: wheelbase / speed [s].
        intensity: sigma_z [m/sqrt(s)].

    Returns:
        Heights [m] under fl fr rl rr, zero at the start. Shape (n, 4).
    """
    steps = intensity * np.sqrt(np.diff(time)) * rng.standard_normal(len(time) - 1)
    front = np.concatenate([[0.0], np.cumsum(steps)])
    rear = np.interp(time - delay, time, front, left=0.0)
    return np.column_stack([front, front, rear, rear])


def noisy_heights(rng: np.random.Generator, heights: Array, epsilon: float, lag: int) -> Array:
    """Known road heights with the multiplicative noise of TiL Eq. (17).

    It enters on the front wheels' profile, left and right alike; the rear wheels follow on it.

    Args:
        rng: the source of chance.
        heights: [m]. Shape (n, 4).
        epsilon: half width of the uniform factor about one.
        lag: samples by which the rear axle follows.

    Returns:
        Heights times draws from [1 - epsilon, 1 + epsilon]. Shape (n, 4).
    """
    factor = rng.uniform(1 - epsilon, 1 + epsilon, len(heights) + lag)
    front, rear = factor[lag:], factor[: len(heights)]
    return heights * np.column_stack([front, front, rear, rear])
