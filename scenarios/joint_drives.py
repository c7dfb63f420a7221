"""Drives of the joint observer: what they excite decides what can be estimated at all."""

import numpy as np
from numpy.typing import NDArray

from scenarios.record import Manoeuvre

Array = NDArray[np.float64]

WHEELBASE, TRACK = 2.9, 1.65  # of the SUV [m]: where a wheel meets the same bump
DT = 0.001


def _ramps(parts: list[tuple[float, float]], n: int, dt: float) -> Array:
    """Speeds [m/s] over time: raised cosines between (seconds, speed at their end)."""
    speed = np.empty(n)
    start, before = 0.0, parts[0][1]
    time = np.arange(n) * dt
    for seconds, after in parts:
        now = (time >= start) & (time < start + seconds)
        share = (time[now] - start) / seconds
        speed[now] = before + (after - before) * 0.5 * (1.0 - np.cos(np.pi * share))
        start, before = start + seconds, after
    speed[time >= start] = before
    return speed


def rough_patches(
    distance: Array, starts: Array, length: float, sd: float, seed: int
) -> Array:
    """(N, 4) road heights [m] under the wheels, rough on patches and flat between them.

    Left and right are independent, the rear wheels follow in the track of the front ones. The
    profile is white noise smoothed over a footprint-like 0.3 m and 3 m: bumps that shake the wheels
    as well as the body.

    Args:
        distance: (N,) travelled [m].
        starts: of the patches [m].
        length: of each [m].
        sd: of the height within a patch [m].
        seed: of the road, the same for all noises.
    """
    grid = 0.05  # m
    places = np.arange(-10.0, distance[-1] + 20.0, grid)
    rng = np.random.default_rng(seed)
    white = rng.standard_normal((places.size, 2))
    heights = np.zeros_like(white)
    for wavelength, share in ((0.4, 0.35), (3.0, 1.0)):
        half = np.arange(-3.0 * wavelength, 3.0 * wavelength + grid, grid)
        kernel = np.exp(-0.5 * (half / (0.35 * wavelength)) ** 2)
        for side in range(2):
            smooth = np.convolve(white[:, side], kernel, mode="same")
            heights[:, side] += share * smooth / smooth.std()
    envelope = np.zeros(places.size)
    for start in starts:
        inside = np.clip((places - start) / length, 0.0, 1.0)
        envelope += np.sin(np.pi * inside) ** 2
    heights *= sd * np.minimum(envelope, 1.0)[:, None]
    columns = [
        np.interp(distance - behind, places, heights[:, side])
        for behind in (0.0, WHEELBASE)
        for side in (0, 1)
    ]
    return np.column_stack(columns)


def mixed(dt: float = DT, duration: float | None = None) -> Manoeuvre:
    """Two minutes of slaloms with braking, bends and rough patches between 11 and 22 m/s.

    Chosen by the Cramer-Rao bound: noise at a given SNR grows with the rms of a channel, so that
    slow bends cost more than they tell, and quick slaloms tell the roll and yaw inertia.
    """
    whole = 120.0
    n = round(min(duration or whole, whole) / dt)
    time = np.arange(n) * dt
    speed = _ramps([(1.0, 14.0), *[(4.0, 22.0), (1.0, 22.0), (3.2, 11.0), (0.8, 12.0)] * 14], n, dt)
    bends = 0.2 * np.sin(2.0 * np.pi * time / 17.0)
    # sweeps of seven seconds from 0.8 to 3.2 Hz
    sweep = time % 7.0
    slalom = 1.0 * np.sin(2.0 * np.pi * (0.8 * sweep + 0.5 * 2.4 / 7.0 * sweep**2))
    fade = np.clip(time / 0.5, 0.0, 1.0)
    steering = fade * (bends + slalom) * (15.0 / np.maximum(speed, 8.0))
    distance = np.cumsum(speed) * dt
    road = rough_patches(distance, np.arange(15.0, 3000.0, 110.0), 90.0, 0.010, seed=11)
    return Manoeuvre(name="mixed", dt=dt, speed=speed, steering=steering, road=road)
