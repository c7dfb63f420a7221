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

Two more make a regressor of a better signal:

* a *mode*. The twin runs free: with a wrong roll inertia it also rolls to another angle, and its
  springs then pull it back. Below the frequency of the roll mode that undoes what the inertia did:
  the difference of the accelerations is not a~ times the missing share, but
  s^2 / (s^2 + 2 zeta w s + w^2) of it. The same filter on the instrument turns it into that.
* a *lag*. Where the twin itself is driven by a noisy input, a road known with an error, its signal
  is no clean instrument either. The measured signal of a while ago is independent of both noises of
  now. A negative scale says that a mode has turned it over in the meantime.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from twin import OUTPUTS, PARAMETERS, TwinError

Array = NDArray[np.float64]

# Signals that a law can use: what the sensors give, and accelerations [m/s2, rad/s2]. These come
# from a measured rate by the same causal filter for vehicle and twin, s / (filter_time s + 1)^2: it
# differentiates below its corner, and delays both by two filter times, so that the delay cancels.
ACCELERATIONS = {
    "heave_acceleration": "vz",
    "roll_acceleration": "roll_rate",
    "pitch_acceleration": "pitch_rate",
    "yaw_acceleration": "yaw_rate",
}
SIGNALS = (*OUTPUTS, *ACCELERATIONS)
_WHEEL_SPEEDS = OUTPUTS[6:]

# Columns of a law's memory: covariance of parameter and offset, and the offset itself
PP, PO, OO, OFFSET = range(4)
# and of the differentiating filter: whether it has begun, its two stages for vehicle and for twin
BEGUN, FILTER = 4, 5
# of the mode's filter, position and speed; and the place in the ring of lagged instruments
MODE, PLACE, RING = 9, 11, 12


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterLaw:
    """How one signal corrects one load parameter.

    Attributes:
        parameter: of `twin.PARAMETERS`; the black box at hand must have it.
        signal: of `SIGNALS`; the black box at hand must have what it comes from.
        instrument: whose signal the regressor is made of.
        form: "sign" or "least-squares", see the module.
        gain: of the sign form, unit of the parameter per second and unit of the signal.
        scale: of the least-squares form, the nominal value of the parameter: what divides the
            force or moment in the twin. Negative for an instrument in antiphase.
        mode_frequency: of the free twin [Hz], which the regressor is filtered by; zero: none.
        mode_damping: damping ratio of that mode.
        lag: of the instrument [s].
        prior_sd: of the least-squares form, of the parameter before the first sample.
        noise_density: of the least-squares form, of the signal's noise [unit of the signal over
            the root of Hz]: standard deviation times the root of the sample time.
        drift: of the least-squares form, of the parameter [unit over the root of s]: forgetting.
        offset_sd: of the least-squares form, of the signal's offset; zero: there is none.
        filter_time: of the differentiating filter [s]; only `ACCELERATIONS` have one.
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
    mode_frequency: float = 0.0
    mode_damping: float = 0.5
    lag: float = 0.0
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
        if self.scale == 0.0 or not math.isfinite(self.scale):
            raise TwinError(f"law: scale is {self.scale}; allowed: any number but 0")
        for name in (
            *("gain", "drift", "offset_sd", "least_wheel_speed"),
            *("mode_frequency", "mode_damping", "lag"),
        ):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise TwinError(f"law: {name} is {getattr(self, name)}; allowed: 0 or more")
        for name in ("prior_sd", "noise_density", "filter_time"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise TwinError(f"law: {name} is {getattr(self, name)}; allowed: more than 0")

    @property
    def output(self) -> str:
        """The measurement that the signal is, or comes from."""
        return ACCELERATIONS.get(self.signal, self.signal)


# A law as compiled code sees it. A record goes into a function as one pointer; a tuple of arrays
# would cost more than the law.
LAW_DTYPE = np.dtype(
    [
        ("parameter", np.int64),
        ("output", np.int64),
        ("differentiated", np.bool_),
        ("measured", np.bool_),
        ("sign", np.bool_),
        ("gain", np.float64),
        ("scale", np.float64),
        ("intensity", np.float64),  # noise_density squared
        ("drift", np.float64),
        ("filter_time", np.float64),
        ("mode_frequency", np.float64),  # [rad/s]
        ("mode_damping", np.float64),
        ("lag", np.int64),  # samples
        ("least_wheel_speed", np.float64),
    ],
    align=True,
)


def compile_laws(
    laws: Sequence[ParameterLaw],
    dt: float,
    outputs: tuple[str, ...] = OUTPUTS,
    parameters: tuple[str, ...] = PARAMETERS,
) -> tuple[NDArray[np.void], Array]:
    """The laws as records of `LAW_DTYPE`, and the memory, a row each, that they start with.

    Args:
        laws: what corrects which parameter.
        dt: sample time [s].
        outputs: of the black box at hand.
        parameters: of the black box at hand.

    Raises:
        TwinError: a law needs what the black box does not have.
    """
    for law in laws:
        _check_names(law, outputs, parameters)
    table = np.zeros(len(laws), LAW_DTYPE)
    for row, law in zip(table, laws, strict=True):
        for name in ("gain", "scale", "drift", "filter_time", "mode_damping", "least_wheel_speed"):
            row[name] = getattr(law, name)
        row["parameter"] = parameters.index(law.parameter)
        row["output"] = outputs.index(law.output)
        row["differentiated"] = law.signal in ACCELERATIONS
        row["measured"] = law.instrument == "measured"
        row["sign"] = law.form == "sign"
        row["intensity"] = law.noise_density**2
        row["mode_frequency"] = 2.0 * math.pi * law.mode_frequency
        row["lag"] = round(law.lag / dt)
    memory = np.zeros((len(laws), RING + max(table["lag"], default=0)))
    memory[:, PP] = [law.prior_sd**2 for law in laws]
    memory[:, OO] = [law.offset_sd**2 for law in laws]
    return table, memory


def _check_names(law: ParameterLaw, outputs: tuple[str, ...], parameters: tuple[str, ...]) -> None:
    signals = (*outputs, *(a for a, rate in ACCELERATIONS.items() if rate in outputs))
    for kind, name, allowed in (
        ("parameter", law.parameter, parameters),
        ("signal", law.signal, signals),
    ):
        if name not in allowed:
            raise TwinError(f"law: {kind} is {name!r}; this black box allows: {', '.join(allowed)}")
    if law.least_wheel_speed > 0.0 and outputs[6:] != _WHEEL_SPEEDS:
        raise TwinError(
            f"law: least_wheel_speed is {law.least_wheel_speed}; this black box, without wheel "
            "speeds, allows: 0"
        )


@njit(cache=True)
def _moving(y, least):
    """Whether the mean of the wheel speeds is at least so much [rad/s]."""
    return y[6] + y[7] + y[8] + y[9] >= 4.0 * least


@njit(cache=True)
def advance_law(law, memory, y, twin_y, dt, active=True):
    """The correction of a law's parameter in one sample.

    Args:
        law: a record of `LAW_DTYPE`.
        memory: the law's own.
        y: (ny,) measurements; NaN is none, and corrects nothing.
        twin_y: (ny,) outputs of the twin.
        dt: sample time [s].
        active: whether it may correct; its filters go on all the same.
    """
    a, a_twin = y[law.output], twin_y[law.output]
    if np.isnan(a):
        return 0.0
    if law.differentiated:
        if memory[BEGUN] == 0.0:
            memory[BEGUN] = 1.0
            memory[FILTER], memory[FILTER + 1] = a, a
            memory[FILTER + 2], memory[FILTER + 3] = a_twin, a_twin
        a = _differentiate(memory, FILTER, a, law.filter_time, dt)
        a_twin = _differentiate(memory, FILTER + 2, a_twin, law.filter_time, dt)
    instrument = _regressor(law, memory, a if law.measured else a_twin, dt)
    least = law.least_wheel_speed
    if not active:
        return 0.0
    if least > 0.0 and not (_moving(y, least) and _moving(twin_y, least)):
        return 0.0
    if law.sign:
        return law.gain * dt * np.sign(instrument) * (a_twin - a)
    noise, growth = law.intensity / dt, law.drift * law.drift * dt
    return _fit(memory, instrument / law.scale, a_twin - a, noise, growth)


@njit(cache=True)
def _regressor(law, memory, signal, dt):
    """One sample of the instrument, filtered by the mode and lagged."""
    if law.mode_frequency > 0.0:
        w = law.mode_frequency
        position, speed = memory[MODE], memory[MODE + 1]
        signal -= 2.0 * law.mode_damping * w * speed + w * w * position
        memory[MODE + 1] = speed + signal * dt
        memory[MODE] = position + memory[MODE + 1] * dt
    if law.lag > 0:
        place = RING + int(memory[PLACE])
        signal, memory[place] = memory[place], signal
        memory[PLACE] = (memory[PLACE] + 1.0) % law.lag
    return signal


@njit(cache=True)
def _differentiate(memory, stage, value, filter_time, dt):
    """One sample of s / (filter_time s + 1)^2: two low passes, the rate of the second."""
    decay = dt / (filter_time + dt)
    memory[stage] += decay * (value - memory[stage])
    change = decay * (memory[stage] - memory[stage + 1])
    memory[stage + 1] += change
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
