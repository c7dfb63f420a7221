"""What a driver is to do: speeds, steering and road over time, for any car."""

import numpy as np
from numpy.typing import NDArray

from scenarios.driving.circuit import circuit
from scenarios.driving.double_lane_change import lane_change, speeds_through, stretch
from scenarios.driving.path import Piece, follow_on, path_of
from scenarios.driving.record import CourseManoeuvre, Manoeuvre
from scenarios.driving.speed_profile import GRAVITY, Course, Limits, course_of, times
from twin import Vehicle
from twin.road import random_walk_heights

Array = NDArray[np.float64]

# An urban drive of two minutes, chosen: seconds, and the speed in km/h at their end. None: the car
# coasts, no foot on a pedal.
URBAN = (
    (2.0, 0.0),
    *((6.0, 32.0), (5.0, 32.0), (5.0, None), (5.0, 0.0), (3.0, 0.0)),
    *((9.0, 50.0), (4.0, 48.0), (6.0, None), (4.0, 25.0), (4.0, 42.0), (6.0, 0.0), (4.0, 0.0)),
    *((4.0, 22.0), (3.0, 22.0), (5.0, 45.0), (5.0, None), (6.0, 0.0), (3.0, 0.0)),
    *((8.0, 50.0), (3.0, 50.0), (6.0, None), (5.0, 10.0), (5.0, 38.0), (4.0, 36.0)),
)


def urban(dt: float = 0.001, duration: float | None = None) -> Manoeuvre:
    """Straight urban driving with stops, starts and coasting up to 50 km/h; about two minutes.

    Args:
        dt: sample time [s].
        duration: how much of it [s]; all of it if None.
    """
    whole = sum(seconds for seconds, _ in URBAN)
    n = round(min(duration or whole, whole) / dt)
    time = np.arange(n) * dt
    speed = np.empty(n)
    start, before = 0.0, 0.0
    for seconds, kmh in URBAN:
        now = (time >= start) & (time < start + seconds)
        share = (time[now] - start) / seconds
        if kmh is None:
            speed[now] = np.nan
        else:
            after = kmh / 3.6
            # a raised cosine: smooth pedals, as a person's
            speed[now] = before + (after - before) * 0.5 * (1.0 - np.cos(np.pi * share))
            before = after
        start += seconds
    return Manoeuvre(name="urban", dt=dt, speed=speed, steering=np.zeros(n), road=np.zeros((n, 4)))


def swept_steer(
    dt: float = 0.001,
    duration: float | None = None,
    *,
    speed: float = 25.0,
    amplitude: float = 0.5,
    highest: float = 4.0,
    sweep: float = 20.0,
) -> Manoeuvre:
    """Sweeps of the hand wheel from 0 to 4 Hz at constant speed (TiL Section 4.3).

    The paper gives neither speed nor amplitude; chosen: some 0.5 g at the lower frequencies.

    Args:
        dt: sample time [s].
        duration: [s]; two sweeps if None.
        speed: [m/s].
        amplitude: of the hand wheel [rad].
        highest: frequency [Hz].
        sweep: length of one [s].
    """
    n = round((duration or 2.0 * sweep) / dt)
    time = np.arange(n) * dt % sweep
    return Manoeuvre(
        name="swept steer",
        dt=dt,
        speed=np.full(n, speed),
        steering=amplitude * np.sin(np.pi * highest * time**2 / sweep),
        road=np.zeros((n, 4)),
    )


def random_road(
    dt: float = 0.001,
    duration: float | None = None,
    *,
    speed: float = 20.0,
    wheelbase: float | None = None,
    seed: int = 0,
) -> Manoeuvre:
    """Straight on at constant speed over the random walk of TiL Eq. (16).

    The paper gives neither speed nor length; chosen: 20 m/s, one minute.

    Args:
        dt: sample time [s].
        duration: [s]; a minute if None.
        speed: [m/s].
        wheelbase: which the rear wheels follow behind [m]; the SUV's if None.
        seed: of the road, the same for all laws and noises.
    """
    n = round((duration or 60.0) / dt)
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, n * dt, n, endpoint=False)
    return Manoeuvre(
        name="random road",
        dt=dt,
        speed=np.full(n, speed),
        steering=np.zeros(n),
        road=random_walk_heights(rng, time, delay=(wheelbase or suv_wheelbase()) / speed),
    )


def suv_wheelbase() -> float:
    """Of the car that the studies of one car drive [m]."""
    return Vehicle.load("suv").figures.wheelbase


def laps(
    dt: float = 0.001,
    duration: float | None = None,
    *,
    limits: Limits,
    start: float = 20.0,
    count: int = 2,
) -> CourseManoeuvre:
    """Laps of `scenarios.driving.circuit` at the limits of a car, from a rolling start.

    Args:
        dt: sample time [s].
        duration: [s]; what the laps take if None.
        limits: of the car.
        start: speed at the start [m/s].
        count: of the laps, if there is no duration.
    """
    lap = circuit()
    if duration is not None:  # no lap is faster than the fastest speed
        count = 1 + int(duration * limits.speed / (lap.step * (lap.x.size - 1)))
    # beyond the line the driver sees the next lap's first straight
    course = course_of(follow_on([lap] * (count + 1)), limits, start=start)
    seconds = duration or times(course)[count * (lap.x.size - 1)]
    return _along("laps", course, dt, seconds)


def lane_changes(
    dt: float = 0.001,
    duration: float | None = None,
    *,
    limits: Limits,
    lateral: float = 1.0,
    speeds: tuple[float, ...] = (25.0, 35.0, 30.0, 40.0, 22.0, 32.0),
    straight: float = 150.0,
    start: float = 15.0,
) -> CourseManoeuvre:
    """Double lane changes with braking in a row, and straights to speed up between them.

    What TiL Section 5 validates with; speeds are not given: chosen. Each is the track of ISO
    3888-1, its lengths stretched so that the speed takes the given lateral acceleration.

    Args:
        dt: sample time [s].
        duration: [s]; what the speeds take if None, else they come round again.
        limits: of the car.
        lateral: acceleration on the ways across and back [g].
        speeds: on entering the lane changes, if the straights are long enough for them [m/s].
        straight: before each of them [m].
        start: speed at the start [m/s].
    """
    rounds = 1 if duration is None else 1 + int(duration * max(speeds) / (straight * len(speeds)))
    parts, ceilings = [], [np.full(1, np.inf)]
    for speed in speeds * rounds:
        parts += [
            path_of([Piece(straight, 0.0, 0.0)]),
            lane_change(stretch(speed, lateral * GRAVITY)),
        ]
        ceilings += [np.full(parts[-2].x.size - 1, np.inf), speeds_through(speed, parts[-1])[1:]]
    end = sum(part.x.size - 1 for part in parts)
    parts.append(parts[0])  # the driver looks ahead
    ceilings.append(ceilings[1])
    course = course_of(follow_on(parts), limits, start=start, ceiling=np.concatenate(ceilings))
    return _along("lane changes", course, dt, duration or times(course)[end])


def _along(name: str, course: Course, dt: float, seconds: float) -> CourseManoeuvre:
    road = np.zeros((round(seconds / dt), 4))
    return CourseManoeuvre(name=name, dt=dt, course=course, road=road)
