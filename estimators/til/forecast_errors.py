"""How a twin errs on the drives of known cars: what a linear law of correction can learn from.

The twin is set to the car's true states, with a known small error on top, forecasts for half a
second, and is set anew. What its states are off by at the end of a block of samples, and its
outputs in it, are the data: known errors tell how an error moves and what it shows in the outputs,
what is left is what the model lacks and the sensors add.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from twin import PARAMETERS, STATES, WHEEL_ANGLES, Drive, Twin
from twin.kernel import correct, read_states, set_parameters, step

Array = NDArray[np.float64]

BLOCK = 0.01  # [s]; chosen: shorter than any mode but the wheels' spin
FORECAST = 0.5  # [s]; chosen
# Position, yaw and the wheels' angles show in no output
UNSEEN = ("x", "y", "yaw", *STATES[WHEEL_ANGLES])
CORRECTED = tuple(name for name in STATES if name not in UNSEEN)
# Known errors at the start of a forecast, of the order of those that an observer meets; chosen
START_SD: Mapping[str, float] = {
    "z": 0.002, "roll": 0.003, "pitch": 0.003, "vx": 0.2, "vy": 0.15, "vz": 0.02,
    "roll_rate": 0.02, "pitch_rate": 0.02, "yaw_rate": 0.03,
    **{name: 0.002 for name in STATES if name.startswith("suspension_travel")},
    **{name: 0.02 for name in STATES if name.startswith("suspension_rate")},
    **{name: 0.6 for name in STATES if name.startswith("wheel_speed")},
}  # fmt: skip


class ForecastErrors(NamedTuple):
    """Errors of one drive, vehicle less twin, by blocks of `BLOCK`.

    `before[k]`, `after[k]` and `innovations[k]` belong to one block; the blocks follow one another.
    """

    before: Array  # (N, n) of the states `CORRECTED` at the start of a block
    after: Array  # (N, n) at its end
    innovations: Array  # (N, ny) of the outputs, mean over the block


def forecast_errors(
    twin: Twin, drive: Drive, rng: np.random.Generator, parameters: Mapping[str, float]
) -> ForecastErrors:
    """Errors of a twin on a drive whose truth is known.

    Args:
        twin: what forecasts; at the end it is somewhere.
        drive: of a simulated car, with all its states in its truth.
        rng: of the known errors.
        parameters: deltas in force, by name.
    """
    true = np.column_stack([drive.truth[name] for name in STATES])
    block, blocks = round(BLOCK / drive.dt), round(FORECAST / BLOCK)
    n = (len(drive) - 1) // (block * blocks) * blocks  # whole forecasts
    seen = [STATES.index(name) for name in CORRECTED]
    sd = np.array([START_SD.get(name, 0.0) for name in STATES])
    known = sd * rng.standard_normal((n // blocks, len(STATES)))
    p = np.array([parameters.get(name, 0.0) for name in PARAMETERS])
    twin.reset(float(drive.truth["vx"][0]))
    set_parameters(twin.car, p)
    before, after = np.empty((2, n, len(STATES)))
    moved = np.isin(np.arange(len(STATES)), seen).astype(np.float64)
    innovations = np.empty((n, drive.measurements.shape[1]))
    inputs = np.ascontiguousarray(drive.inputs)
    _forecast(
        twin.car, inputs, drive.measurements, true, known, moved, block, blocks,
        before, after, innovations,
    )  # fmt: skip
    twin.check()
    return ForecastErrors(before[:, seen], after[:, seen], innovations)


@njit(cache=True, nogil=True)
def _forecast(
    car, inputs, measurements, true, known, moved, block, blocks, before, after, innovations
):
    """Fills the errors of each block."""
    x = np.empty(true.shape[1])
    y = np.empty(measurements.shape[1])
    innovations[:] = 0.0
    for k in range(innovations.shape[0]):
        start = k * block
        read_states(car, x)
        if k % blocks == 0:
            correct(car, moved * (true[start] - x) - known[k // blocks])
            read_states(car, x)
        before[k] = true[start] - x
        for i in range(start, start + block):
            step(car, inputs[i], y)
            innovations[k] += (measurements[i] - y) / block
        read_states(car, x)
        after[k] = true[start + block] - x
