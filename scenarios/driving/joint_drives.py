"""Drives of the joint observer: what they excite decides what can be estimated at all."""

import numpy as np
from numpy.typing import NDArray

from scenarios.driving.manoeuvres import suv_wheelbase
from scenarios.driving.record import Manoeuvre, record
from twin import Drive, TwinError, Vehicle

Array = NDArray[np.float64]

DT = 0.001
SHORTEST_HALF = 10.0  # [s] of a drive with a load change: a start and a stop take nine


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
    distance: Array, starts: Array, length: float, sd: float, seed: int, wheelbase: float
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
        wheelbase: by which the rear wheels follow [m].
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
        for behind in (0.0, wheelbase)
        for side in (0, 1)
    ]
    return np.column_stack(columns)


def mixed(
    dt: float = DT, duration: float | None = None, *, wheelbase: float | None = None
) -> Manoeuvre:
    """Two minutes of slaloms with braking, bends and rough patches between 11 and 22 m/s.

    Chosen by the Cramer-Rao bound: noise at a given SNR grows with the rms of a channel, so that
    slow bends cost more than they tell, and quick slaloms tell the roll and yaw inertia.

    Args:
        dt: sample time [s].
        duration: how much of it [s]; all of it if None.
        wheelbase: of the car, whose rear wheels meet the bumps later [m]; the SUV's if None.
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
    road = rough_patches(
        distance, np.arange(15.0, 3000.0, 110.0), 90.0, 0.010, 11, wheelbase or suv_wheelbase()
    )
    return Manoeuvre(name="mixed", dt=dt, speed=speed, steering=steering, road=road)


def hard(dt: float = DT, duration: float | None = None) -> Manoeuvre:
    """A minute near the limit: full braking from 25 m/s, then bends of some 0.8 g."""
    n = round((duration or 60.0) / dt)
    time = np.arange(n) * dt
    speed = _ramps([(1.0, 14.0), *[(4.5, 25.0), (2.6, 9.0), (2.9, 14.0)] * 8], n, dt)
    phase = (time - 1.0) % 10.0
    turning = np.sin(np.pi * np.clip((phase - 6.2) / 3.4, 0.0, 1.0)) ** 2
    left = np.where((time - 1.0) % 20.0 < 10.0, 1.0, -1.0)
    slalom = 0.4 * np.sin(2.0 * np.pi * 1.3 * time) * (1.0 - turning)
    return Manoeuvre(
        name="hard",
        dt=dt,
        speed=speed,
        steering=np.clip(time, 0.0, 1.0) * (2.6 * left * turning + slalom),
        road=np.zeros((n, 4)),
    )


def straight(dt: float = DT, duration: float | None = None) -> Manoeuvre:
    """A minute straight on at 20 m/s on a level road: it tells nothing."""
    n = round((duration or 60.0) / dt)
    return Manoeuvre(
        name="straight",
        dt=dt,
        speed=np.full(n, 20.0),
        steering=np.zeros(n),
        road=np.zeros((n, 4)),
    )


def half_of_a_trip(dt: float = DT, duration: float | None = None) -> Manoeuvre:
    """Forty seconds like `mixed`, from a standstill to a standstill."""
    whole = duration or 40.0
    n = round(whole / dt)
    time = np.arange(n) * dt
    driving = whole - 9.0
    middle = mixed(dt, driving)
    speed = np.concatenate(
        [
            _ramps([(1.5, 0.0), (3.5, middle.speed[0])], round(5.0 / dt), dt) * 1.0,
            middle.speed,
            np.zeros(n - round(5.0 / dt) - middle.speed.size),
        ]
    )
    start = round(5.0 / dt)
    speed[:start] = np.where(time[:start] < 1.5, 0.0, speed[:start])
    braking = slice(start + middle.speed.size, n)
    left = np.clip(1.0 - (time[braking] - time[braking][0]) / 2.4, 0.0, 1.0)
    speed[braking] = middle.speed[-1] * left
    steering = np.zeros(n)
    steering[start : start + middle.speed.size] = middle.steering
    steering[braking] = middle.steering[-1] * left
    return Manoeuvre(
        name="half of a trip", dt=dt, speed=speed, steering=steering, road=np.zeros((n, 4))
    )


def load_change(before: Vehicle, after: Vehicle, duration: float | None = None) -> Drive:
    """Two halves of a trip; what is on board changes while the car stands between them.

    The halves are recorded one after the other, each from a settled standstill: that the body rises
    as somebody gets out is not shown, that it has risen is.

    Args:
        before: the car of the first half.
        after: that of the second.
        duration: of the whole [s]; None: 80 s.

    Raises:
        TwinError: it is too short for a start and a stop in each half.
    """
    half = None if duration is None else 0.5 * duration
    if half is not None and half < SHORTEST_HALF:
        raise TwinError(
            f"load change: duration is {duration:g} s; allowed: {2.0 * SHORTEST_HALF:g} or more"
        )
    halves = [record(vehicle, half_of_a_trip(duration=half)) for vehicle in (before, after)]
    first, second = halves
    return first.replace(
        time=np.arange(len(first) + len(second)) * first.dt,
        inputs=np.concatenate([half.inputs for half in halves]),
        measurements=np.concatenate([half.measurements for half in halves]),
        truth={name: np.concatenate([half.truth[name] for half in halves]) for name in first.truth},
        settings=first.settings | {"manoeuvre": "load change"},
    )
