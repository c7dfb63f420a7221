"""The baseline: robust regression of force on acceleration, one trip at a time.

    F = M a + c + d v^2,    where the motor drives, all signals smoothed over 1.5 s.

It is what one writes in ten lines: the accelerometer as it is, no losses, no warming-up, no
whitening, samples with a light brake left in by chance.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from estimators.weigh.regression import LEAST_SAMPLES, robust_least_squares
from estimators.weigh.trip import Trip

Array = NDArray[np.float64]

SMOOTHING = 1.5  # [s]
LEAST_SPEED = 3.0  # [m/s]


def apparent_mass(trip: Trip) -> float:
    """Slope of force over acceleration [kg]; NaN where there is too little to go by."""
    size = max(1, round(SMOOTHING * trip.rate))
    signals = (trip.force, trip.acceleration, trip.speed**2)
    force, acceleration, squared = (uniform_filter1d(np.nan_to_num(s), size) for s in signals)
    used = (force > 0.0) & (trip.speed > LEAST_SPEED) & np.isfinite(trip.acceleration)
    if np.count_nonzero(used) < LEAST_SAMPLES or np.ptp(acceleration[used]) == 0.0:
        return float("nan")
    columns = np.column_stack((acceleration, np.ones_like(force), squared))[used]
    weak = np.full(3, 1e6)  # no prior
    return float(robust_least_squares(columns, force[used], weak)[0][0])
