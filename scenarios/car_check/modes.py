"""Ride, pitch, roll and wheel hop of a car: eigenvalues of its body on springs and tyres."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin import INPUTS, OUTPUTS, STATES, TRAVEL_RATES, TRAVELS, Twin, X
from twin.kernel import step

Array = NDArray[np.float64]

_SPEED = 20.0  # [m/s]; a rolling tyre does not hold its contact patch as a standing one does
_BODY = 7.0  # [Hz]; modes below it are the body's, above it the wheels'
_STEPS = (1e-5, 1e-4)  # of positions [m, rad] and of rates, for differences
_POSITIONS = [X.z, X.roll, X.pitch, *range(*TRAVELS.indices(len(STATES)))]
_RATES = [X.vz, X.roll_rate, X.pitch_rate, *range(*TRAVEL_RATES.indices(len(STATES)))]


class Mode(NamedTuple):
    """An eigenmode; NaN where there is none that swings."""

    frequency: float  # undamped [Hz]
    damping: float  # ratio of the critical one


class Modes(NamedTuple):
    """Of a car on a level road."""

    ride: Mode
    pitch: Mode
    roll: Mode
    hop: Mode  # mean of the wheels'


_NONE = Mode(float("nan"), float("nan"))


def modes_of(twin: Twin) -> Modes:
    """The modes about rolling straight ahead.

    Raises:
        TwinError: the car does not settle on its wheels.
    """
    twin.reset(_SPEED)
    values, vectors = np.linalg.eig(_linearised(twin))
    figures = twin.vehicle.figures
    # amplitudes at a corner of the body: of heave, roll and pitch
    lever = np.array([1.0, 0.5 * float(np.mean(figures.track)), 0.5 * figures.wheelbase])
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag <= 0.0:  # one of each pair; what creeps back is no mode that swings
            continue
        frequency = abs(value) / (2.0 * np.pi)
        shares = np.abs(vector[:3]) * lever
        found.append((Mode(float(frequency), float(-value.real / abs(value))), shares))
    body = [one for one in found if one[0].frequency < _BODY]
    hops = [mode for mode, _ in found if mode.frequency >= _BODY]
    named = {}
    for name, column in (("roll", 1), ("pitch", 2), ("ride", 0)):
        share = [shares[column] / max(float(shares.sum()), 1e-30) for _, shares in body]
        named[name] = body.pop(int(np.argmax(share)))[0] if body else _NONE
    return Modes(**named, hop=Mode(*np.mean(hops, axis=0).tolist()) if hops else _NONE)


def _linearised(twin: Twin) -> Array:
    """(14, 14) of heave, roll, pitch and four travels: rates and accelerations over both."""
    before = twin.snapshot()
    n = len(_POSITIONS)
    matrix = np.zeros((2 * n, 2 * n))
    matrix[:n, n:] = np.eye(n)
    for column, (state, size) in enumerate(
        [(state, _STEPS[0]) for state in _POSITIONS] + [(state, _STEPS[1]) for state in _RATES]
    ):
        ends = []
        for sign in (1.0, -1.0):
            dx = np.zeros(len(STATES))
            dx[state] = sign * size
            if state == X.pitch:  # the car goes on along the road, not along its nose
                dx[X.vz] = _SPEED * np.sin(sign * size)
            twin.restore(before)
            twin.correct(dx)
            step(twin.car, np.zeros(len(INPUTS)), np.empty(len(OUTPUTS)))
            ends.append(twin.data.qacc[[2, 3, 4, *twin.car.travel_dof]].copy())
        matrix[n:, column] = (ends[0] - ends[1]) / (2.0 * size)
    twin.restore(before)
    return matrix
