"""Laws that correct one load parameter from one signal: TiL Eqs. (14), (15), (18), (24).

A heavier vehicle answers the same force with less acceleration. Where a is the vehicle's signal
and a~ the twin's, the innovation e = a~ - a therefore has the sign of a~ times that of the missing
mass, and a correction has the form

    d(parameter)/dt = k z e,        z: the regressor, k > 0: a gain.

(The paper prints a - a~ with k > 0, which runs away.) Two choices make a law:

* the *instrument*, the signal that z is made of. The paper takes the measured one. Its noise also
  stands in e: E[sgn(a + n) (a~ - a - n)] is not zero at a = a~, so noise alone drives the estimate.
  The twin's own signal carries no measurement noise, and the law is unbiased.
* the *form*: "sign", z = sgn(.), with a constant gain as in the paper; or "least-squares", z = the
  signal itself with the gains of a recursive least-squares fit with forgetting: the Kalman filter
  of e = (a~ / scale) missing + offset + noise. The offset, a bias of the sensor or gravity seen by
  a car that stands otherwise than its twin, is fitted along: it does not pull the parameter.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from twin import OUTPUTS, PARAMETERS, TwinError

Array = NDArray[np.float64]

# Signals that a law can use: what the sensors give, and the angular accelerations [rad/s2]. These
# come from the rates by the same causal filter for vehicle and twin, s / (filter_time s + 1)^2: it
# differentiates below its corner, and delays both by two filter times, so that the delay cancels.
ACCELERATIONS = ("roll_acceleration", "pitch_acceleration", "yaw_acceleration")
SIGNALS = OUTPUTS + ACCELERATIONS

# Columns of a law's memory: covariance of parameter and offset, and the offset itself
PP, PO, OO, OFFSET = range(4)
# and of the differentiating filter: whether it has begun, its two stages for vehicle and for twin
BEGUN, FILTER = 4, 5
MEMORY = 9


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterLaw:
    """How one signal corrects one load parameter.

    Attributes:
        parameter: of `twin.PARAMETERS`.
        signal: of `SIGNALS`.
        instrument: whose signal the regressor is made of.
        form: "sign" or "least-squares", see the module.
        gain: of the sign form, unit of the parameter per second and unit of the signal.
        scale: of the least-squares form, the nominal value of the parameter: what divides the
            force or moment in the twin.
        prior_sd: of the least-squares form, of the parameter before the first sample.
        noise_density: of the least-squares form, of the signal's noise [unit of the signal over
            the root of Hz]: standard deviation times the root of the sample time.
        drift: of the least-squares form, of the parameter [unit over the root of s]: forgetting.
        offset_sd: of the least-squares form, of the signal's offset; zero: there is none.
        filter_time: of the differentiating filter [s]; only angular accelerations have one.
        least_wheel_speed: the law rests while vehicle or twin is slower [rad/s]: a car held by its
            brakes tells nothing of its mass.
    """

    parameter: str
    signal: str
    instrument: Literal["measured", "twin"] = "twin"
    form: Literal["sign", "least-squares"] = "least-squares"
    gain: float = 0.0
    scale: float = 1.0
    prior_sd: float = 1.0
    noise_density: float = 1.0
    drift: float = 0.0
    offset_sd: float = 0.0
    filter_time: float = 0.02
    least_wheel_speed: float = 0.0

    def __post_init__(self) -> None:
        """Checks names and numbers."""
        for kind, name, allowed in (
            ("parameter", self.parameter, PARAMETERS),
            ("signal", self.signal, SIGNALS),
            ("instrument", self.instrument, ("measured", "twin")),
            ("form", self.form, ("sign", "least-squares")),
        ):
            if name not in allowed:
                raise TwinError(f"law: {kind} is {name!r}; allowed: {', '.join(allowed)}")
        for name in ("gain", "drift", "offset_sd", "least_wheel_speed"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise TwinError(f"law: {name} is {getattr(self, name)}; allowed: 0 or more")
        for name in ("scale", "prior_sd", "noise_density", "filter_time"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise TwinError(f"law: {name} is {getattr(self, name)}; allowed: more than 0")


class Laws(NamedTuple):
    """Parameter laws as compiled code sees them, a row each."""

    parameter: NDArray[np.int64]
    output: NDArray[np.int64]
    differentiated: NDArray[np.bool_]
    measured: NDArray[np.bool_]
    sign: NDArray[np.bool_]
    gain: Array
    scale: Array
    intensity: Array  # noise_density squared
    drift: Array
    filter_time: Array
    least_wheel_speed: Array


def _output(signal: str) -> int:
    """The column of the sensor that a signal comes from."""
    return OUTPUTS.index(signal.replace("acceleration", "rate"))


def compile_laws(laws: Sequence[ParameterLaw]) -> tuple[Laws, Array]:
    """The laws as arrays, and the memory (n, MEMORY) that they start with."""
    table = Laws(
        np.array([PARAMETERS.index(law.parameter) for law in laws], dtype=np.int64),
        np.array([_output(law.signal) for law in laws], dtype=np.int64),
        np.array([law.signal in ACCELERATIONS for law in laws], dtype=np.bool_),
        np.array([law.instrument == "measured" for law in laws], dtype=np.bool_),
        np.array([law.form == "sign" for law in laws], dtype=np.bool_),
        np.array([law.gain for law in laws], dtype=np.float64),
        np.array([law.scale for law in laws], dtype=np.float64),
        np.array([law.noise_density**2 for law in laws], dtype=np.float64),
        np.array([law.drift for law in laws], dtype=np.float64),
        np.array([law.filter_time for law in laws], dtype=np.float64),
        np.array([law.least_wheel_speed for law in laws], dtype=np.float64),
    )
    memory = np.zeros((len(laws), MEMORY))
    memory[:, PP] = [law.prior_sd**2 for law in laws]
    memory[:, OO] = [law.offset_sd**2 for law in laws]
    return table, memory


@njit(cache=True)
def _moving(y, least):
    """Whether the mean of the wheel speeds is at least so much [rad/s]."""
    return y[6] + y[7] + y[8] + y[9] >= 4.0 * least


@njit(cache=True)
def advance_law(laws, k, memory, y, twin_y, dt):
    """The correction of law k's parameter in one sample.

    Args:
        laws: all laws.
        k: the law's row.
        memory: (MEMORY,) of this law.
        y: (10,) measurements.
        twin_y: (10,) outputs of the twin.
        dt: sample time [s].
    """
    a, a_twin = y[laws.output[k]], twin_y[laws.output[k]]
    if laws.differentiated[k]:
        if memory[BEGUN] == 0.0:
            memory[BEGUN] = 1.0
            memory[FILTER : FILTER + 2] = a
            memory[FILTER + 2 : FILTER + 4] = a_twin
        decay = dt / (laws.filter_time[k] + dt)
        a = _differentiate(memory[FILTER : FILTER + 2], a, decay, dt)
        a_twin = _differentiate(memory[FILTER + 2 : FILTER + 4], a_twin, decay, dt)
    least = laws.least_wheel_speed[k]
    if least > 0.0 and not (_moving(y, least) and _moving(twin_y, least)):
        return 0.0
    instrument = a if laws.measured[k] else a_twin
    if laws.sign[k]:
        return laws.gain[k] * dt * np.sign(instrument) * (a_twin - a)
    return _fit(
        memory,
        instrument / laws.scale[k],
        a_twin - a,
        laws.intensity[k] / dt,
        laws.drift[k] ** 2 * dt,
    )


@njit(cache=True)
def _differentiate(stages, value, decay, dt):
    """One sample of s / (filter_time s + 1)^2: two low passes, the rate of the second."""
    stages[0] += decay * (value - stages[0])
    change = decay * (stages[0] - stages[1])
    stages[1] += change
    return change / dt


@njit(cache=True)
def _fit(memory, regressor, innovation, noise, growth):
    """A Kalman step of parameter and offset; returns the correction of the parameter."""
    pp, po, oo = memory[PP], memory[PO], memory[OO]
    hp, ho = pp * regressor + po, po * regressor + oo
    spread = noise + regressor * hp + ho
    residual = (innovation - memory[OFFSET]) / spread
    memory[PP] = pp - hp * hp / spread + growth
    memory[PO] = po - hp * ho / spread
    memory[OO] = oo - ho * ho / spread
    memory[OFFSET] += ho * residual
    return hp * residual
