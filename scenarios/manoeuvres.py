"""What a driver is to do: speeds, steering and road over time, for any car."""

import numpy as np
from numpy.typing import NDArray

from scenarios.record import Manoeuvre

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
