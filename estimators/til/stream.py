"""Samples as they come, at any time stamps, become samples of the twin's step.

Between two samples inputs and measurements are linear. A gap is bridged: inputs are held,
measurements are missing. After a long one the twin starts again at the measured speed and keeps
what is known of the parameters. The same holds for samples in which an input is missing: nothing
counts as measured in them. Samples that come late, twice or without a time are dropped and
counted; when nothing but late ones come the clock was set back, and a new time begins.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from estimators.til.observer import Observer
from estimators.til.snapshot import load_snapshot, save_snapshot
from twin import LONGEST_GAP, WHEELS

Array = NDArray[np.float64]

LONGEST_STEP = 0.15  # [s] between samples; what is longer is a gap. Chosen: a channel of 10 Hz
FASTEST = 150.0  # [m/s] at which a twin can start
SET_BACK = 10  # late samples in a row, in order among themselves, that make a new time; chosen
_SLACK = 1e-3  # of a step: time stamps are rounded


class Sample(NamedTuple):
    """What is estimated at a time.

    Attributes:
        time: of the twin's step [s], in the time of the samples.
        parameters: (np,) deltas from the nominal vehicle.
        states: (nx,) of the twin.
        trustworthy: see `estimators.til.measurement_validation`.
    """

    time: float
    parameters: Array
    states: Array
    trustworthy: bool


class Stream:
    """Feeds an observer with samples of any time stamps.

    Attributes:
        observer: it belongs to the stream from now on.
        counts: samples that were taken, and dropped: late, without a time, or without the inputs
            and speed that a start needs; those with inputs that were held; and gaps, restarts and
            clocks set back.
    """

    def __init__(self, observer: Observer, rolling_radius: float) -> None:
        """Args: rolling_radius: of the wheels [m], see `rolling_radius`."""
        self.observer = observer
        self.counts = dict.fromkeys(
            ("taken", "late", "untimed", "incomplete", "held", "gaps", "restarts", "set_back"), 0
        )
        self._radius = rolling_radius
        self._time = math.nan  # of the last sample
        self._complete = math.nan  # of the last sample with all inputs
        self._start = math.nan  # of the twin's first step
        self._steps = 0  # since then
        self._u = np.full(len(observer.twin.inputs), np.nan)
        self._y = np.full(len(observer.twin.outputs), np.nan)
        self._late: list[float] = []
        self._unknown = np.empty(0), np.empty(0)  # states and parameters before any step

    def update(
        self, time: float, u: ArrayLike, y: ArrayLike, speed: float = math.nan
    ) -> Sample | None:
        """Takes a sample; returns the estimate at the twin's last step until then.

        Args:
            time: [s].
            u: (nu,) inputs; what is not finite is held from the last sample, and nothing counts
                as measured meanwhile, see `twin.LONGEST_GAP`.
            y: (ny,) measurements, NaN where there is none.
            speed: measured [m/s], if it is; else the wheels tell it where a twin starts.

        Returns:
            The estimate; None if the sample was dropped, or ends no step of the twin.

        Raises:
            TwinError: an input is out of range, or the twin has blown up.
        """
        y = np.array(y, dtype=np.float64)
        if not math.isfinite(time):
            self.counts["untimed"] += 1
            return None
        if not self._is_new(time):
            self.counts["late"] += 1
            return None
        u, held = self._held(np.array(u, dtype=np.float64))
        if held and not time - self._complete <= LONGEST_GAP:
            self.counts["incomplete"] += 1
            if not math.isnan(self._time):
                self._time = -math.inf  # the twin starts again when the inputs are back
            return None
        gap = time - self._time
        if math.isnan(gap) or gap > LONGEST_GAP:
            speed = speed if math.isfinite(speed) else self._measured_speed(y)
            if held or not abs(speed) < FASTEST:
                self.counts["incomplete"] += 1
                return None
            self._begin(time, max(speed, 0.0), fresh=math.isnan(gap))
        elif gap > LONGEST_STEP:
            self.counts["gaps"] += 1
        if held:
            self.counts["held"] += 1
            y[:] = np.nan
        else:
            self._complete = time
        sample = self._advance(time, u, y)
        if held:
            self.observer.distrust()
            sample = sample and sample._replace(trustworthy=False)
        self.counts["taken"] += 1
        self._time, self._u, self._y = time, u, y
        return sample

    def save(self, path: str | Path) -> None:
        """Writes all that decides what comes next, whole or not at all.

        Raises:
            TwinError: the file cannot be written.
        """
        save_snapshot(path, self.observer, self._own())

    def _own(self) -> dict[str, Array]:
        """What decides what comes next beside the observer."""
        clock = np.array([self._time, self._start, self._steps], dtype=np.float64)
        counts = np.array(list(self.counts.values()), dtype=np.float64)
        return {"clock": clock, "counts": counts, "u": self._u, "y": self._y}

    def restore(self, path: str | Path) -> None:
        """Goes on where a stream of the same vehicle and observer was saved.

        Raises:
            TwinError: the file is missing, broken or of another vehicle or observer.
        """
        more = load_snapshot(path, self.observer, self._own())
        self._time, self._start, steps = more["clock"].tolist()
        self._complete = self._time
        self._steps = int(steps)
        self._u, self._y = more["u"], more["y"]
        self.counts = dict(zip(self.counts, map(int, more["counts"]), strict=True))
        self._late = []

    def start_again(self, *, fresh: bool = False) -> None:
        """Starts the twin anew at the next sample, after it has blown up.

        Args:
            fresh: whether what is known of the parameters goes, too.
        """
        self._time = math.nan if fresh else -math.inf

    def _is_new(self, time: float) -> bool:
        """Whether a sample is later than the last, or the clock was set back."""
        if not time <= self._time:
            self._late = []
            return True
        if self._late and time <= self._late[-1]:
            self._late = []
        self._late.append(time)
        if len(self._late) < SET_BACK:
            return False
        self._late = []
        self.counts["set_back"] += 1
        self._time = -math.inf
        return True

    def _held(self, u: Array) -> tuple[Array, bool]:
        """Inputs, those that are not finite from the last sample; whether there are any."""
        bad = ~np.isfinite(u)
        if not bad.any():
            return u, False
        return np.where(bad, self._u, u), True

    def _measured_speed(self, y: Array) -> float:
        speeds = [y[i] for i in _wheels(self.observer) if math.isfinite(y[i])]
        return self._radius * float(np.median(speeds)) if speeds else math.nan

    def _begin(self, time: float, speed: float, *, fresh: bool) -> None:
        if fresh:
            self.observer.reset(speed)
        else:
            self.counts["restarts"] += 1
            self.observer.restart(speed)
        self._time, self._start, self._steps = math.nan, time, 0

    def _advance(self, time: float, u: Array, y: Array) -> Sample | None:
        """Steps the twin up to a time; nothing is between a start and itself."""
        twin = self.observer.twin
        last = math.floor((time - self._start) / twin.dt + _SLACK)
        if last < self._steps:
            return None
        due = self._start + np.arange(self._steps, last + 1) * twin.dt
        if math.isnan(self._time):
            inputs, measurements = u[None], y[None]
        else:
            times, both_u = np.array([self._time, time]), np.array([self._u, u])
            both_y = np.array([self._y, y])
            inputs, measurements = between(due, times, both_u, both_y, _SLACK * twin.dt)
        states, p = self._unknown
        for row_u, row_y in zip(inputs, measurements, strict=True):
            states = twin.read_states()
            p = self.observer.update(row_u, row_y)
        self._steps = last + 1
        return Sample(float(due[-1]), p, states, self.observer.trustworthy)


@njit(cache=True)
def between(at, time, inputs, measurements, slack):
    """Inputs and measurements at other times: linear, but held and missing across gaps.

    Args:
        at: (m,) rising [s], within those of the samples.
        time: (n,) rising [s], n at least 2.
        inputs: (n, nu) finite.
        measurements: (n, ny).
        slack: what counts as the time of a sample [s].

    Returns:
        (m, nu) and (m, ny).
    """
    u = np.empty((at.size, inputs.shape[1]))
    y = np.empty((at.size, measurements.shape[1]))
    after = 1
    for k in range(at.size):
        while after < time.size - 1 and at[k] > time[after] + slack:
            after += 1
        before, step = after - 1, time[after] - time[after - 1]
        # a sample's own value counts even where its neighbour is missing
        if at[k] > time[after] - slack:
            u[k], y[k] = inputs[after], measurements[after]
        elif at[k] < time[before] + slack:
            u[k], y[k] = inputs[before], measurements[before]
        elif step > LONGEST_STEP:
            u[k], y[k] = inputs[before], np.nan
        else:
            share = (at[k] - time[before]) / step
            u[k] = inputs[before] + share * (inputs[after] - inputs[before])
            y[k] = measurements[before] + share * (measurements[after] - measurements[before])
    return u, y


def rolling_radius(observer: Observer) -> float:
    """Speed over wheel speed of the twin as it rolls [m]; the twin is left rolling."""
    twin = observer.twin
    observer.reset(10.0)
    states = twin.read_states()
    spins = [states[twin.states.index(f"wheel_speed_{wheel}")] for wheel in WHEELS]
    return float(states[twin.states.index("vx")] / np.mean(spins))


def _wheels(observer: Observer) -> list[int]:
    outputs = observer.twin.outputs
    return [i for i, name in enumerate(outputs) if name.startswith("wheel_speed")]
