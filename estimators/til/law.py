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
  a car that stands otherwise than its twin, is fitted along: it does not pull the parameter. Where
  it may jump, a sensor that is knocked or a hill that begins, the residual's mean over 0.2 s tells,
  which no change of the parameter could make as suddenly, and the offset is fitted anew. The
  form "integral", z = -1, is for a parameter that is itself a force: its gain has either sign, and
  what it has gathered may leak away again.

Laws may rest: at yaw rates beyond a gate (Eq. (24)), or where the instrument is too small to tell
anything but the errors of the model.

An observer that corrects the wheel speeds pulls on its twin: a correction K (w - w~) is a torque
I K (w - w~) on the wheel, which the tyre hands on to the road. The twin's speed then settles where
a~ = a whatever its mass, and hides it. *Compensation* takes that acceleration,
sum K (w - w~) I / (R M), out of the twin's signal before anything is made of it.

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
from typing import Literal, get_args

import numpy as np
from numba import njit
from numpy.typing import NDArray

from twin import OUTPUTS, PARAMETERS, WHEEL_SPEEDS, TwinError, Y

Array = NDArray[np.float64]
Form = Literal["sign", "least-squares", "integral"]

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
_YAW_RATE = Y.yaw_rate
_FIRST_WHEEL, _AFTER_WHEELS = WHEEL_SPEEDS.start, WHEEL_SPEEDS.stop

# Columns of a law's memory: covariance of parameter and offset, and the offset itself
PP, PO, OO, OFFSET = range(4)
ADDED = OFFSET  # by a law of the integral form, all in all
# and of the differentiating filter: whether it has begun, its two stages for vehicle and for twin
BEGUN, FILTER = 4, 5
# of the mode's filter, position and speed; the residual's short mean, and whether it told of a jump
# of the offset; and the place in the ring of lagged instruments
MODE, MEAN, JUMPED, PLACE, RING = 9, 11, 12, 13, 14

JUMP_TIME = 0.2  # [s] of the residual's short mean; chosen
JUMP = 4.0  # standard deviations of it that are no noise; chosen


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
        prior_sd: of the least-squares form, which demands it: of the parameter before the first
            sample.
        noise_density: of the least-squares form, which demands it: of the signal's noise [unit of
            the signal over the root of Hz]: standard deviation times the root of the sample time.
        drift: of the least-squares form, of the parameter [unit over the root of s]: forgetting.
        leak: of the integral form, of what the law itself has added [1/s].
        offset_sd: of the least-squares form, of the signal's offset; zero: there is none.
        offset_jump: of the least-squares form, the same after a jump of the offset, see the module;
            zero: it does not jump.
        filter_time: of the differentiating filter [s]; only `ACCELERATIONS` have one.
        least_wheel_speed: the law rests while vehicle or twin is slower [rad/s]: a car held by its
            brakes tells nothing of its mass.
        largest_yaw_rate: the law rests while the measured one is larger [rad/s], TiL Eq. (24).
        least_signal: the law rests while the instrument is smaller.
        compensation: of the twin's signal, what it gets for each rad/s by which a wheel of the
            vehicle is ahead of the twin's: gain on wheel speeds times I / (R M), see the module.
        largest_compensation: the law rests while it gets more, or no wheel tells: its twin is
            elsewhere, and what the tyres hand on is limited.
        largest: of the parameter, in either direction: what is physical.
    """

    parameter: str
    signal: str
    instrument: Literal["measured", "twin"] = "twin"
    form: Form = "least-squares"
    gain: float = 0.0
    scale: float = 1.0
    prior_sd: float = math.nan
    noise_density: float = math.nan
    drift: float = 0.0
    leak: float = 0.0
    offset_sd: float = 0.0
    offset_jump: float = 0.0
    filter_time: float = 0.02
    mode_frequency: float = 0.0
    mode_damping: float = 0.5
    lag: float = 0.0
    least_wheel_speed: float = 0.0
    largest_yaw_rate: float = math.inf
    least_signal: float = 0.0
    compensation: float = 0.0
    largest_compensation: float = math.inf
    largest: float = math.inf

    def __post_init__(self) -> None:
        """Checks names and numbers."""
        for kind, name, allowed in (
            ("parameter", self.parameter, PARAMETERS),
            ("signal", self.signal, SIGNALS),
            ("instrument", self.instrument, ("measured", "twin")),
            ("form", self.form, get_args(Form)),
        ):
            if name not in allowed:
                raise TwinError(f"law: {kind} is {name!r}; allowed: {', '.join(allowed)}")
        if self.scale == 0.0 or not math.isfinite(self.scale):
            raise TwinError(f"law: scale is {self.scale}; allowed: any number but 0")
        if not math.isfinite(self.gain) or (self.gain < 0.0 and self.form != "integral"):
            raise TwinError(f"law: gain is {self.gain}; allowed: 0 or more, finite")
        for name in (
            *("drift", "leak", "offset_sd", "offset_jump", "least_wheel_speed", "least_signal"),
            *("mode_frequency", "mode_damping", "lag", "compensation"),
        ):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise TwinError(f"law: {name} is {getattr(self, name)}; allowed: 0 or more")
        for name in ("largest_yaw_rate", "largest_compensation", "largest"):
            if not getattr(self, name) > 0.0:
                raise TwinError(f"law: {name} is {getattr(self, name)}; allowed: more than 0")
        demanded = ("prior_sd", "noise_density") if self.form == "least-squares" else ()
        for name in (*demanded, "filter_time"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise TwinError(f"law: {name} is {getattr(self, name)}; allowed: more than 0")

    @property
    def output(self) -> str:
        """The measurement that the signal is, or comes from."""
        return ACCELERATIONS.get(self.signal, self.signal)


FORMS = get_args(Form)
SIGN, LEAST_SQUARES, INTEGRAL = range(len(FORMS))
# Fields that compiled code takes as they are
_COPIED = (
    *("gain", "scale", "drift", "leak", "offset_jump", "filter_time", "mode_damping"),
    *("least_wheel_speed", "largest_yaw_rate", "least_signal", "compensation"),
    *("largest_compensation", "largest"),
)
# A law as compiled code sees it. A record goes into a function as one pointer; a tuple of arrays
# would cost more than the law.
LAW_DTYPE = np.dtype(
    [
        ("parameter", np.int64),
        ("output", np.int64),
        ("differentiated", np.bool_),
        ("measured", np.bool_),
        ("form", np.int64),  # place in `FORMS`
        ("gain", np.float64),
        ("scale", np.float64),
        ("intensity", np.float64),  # noise_density squared
        ("drift", np.float64),
        ("leak", np.float64),
        ("offset_jump", np.float64),
        ("filter_time", np.float64),
        ("mode_frequency", np.float64),  # [rad/s]
        ("mode_damping", np.float64),
        ("lag", np.int64),  # samples
        ("least_wheel_speed", np.float64),
        ("largest_yaw_rate", np.float64),
        ("least_signal", np.float64),
        ("compensation", np.float64),
        ("largest_compensation", np.float64),
        ("largest", np.float64),
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
        for name in _COPIED:
            row[name] = getattr(law, name)
        row["parameter"] = parameters.index(law.parameter)
        row["output"] = outputs.index(law.output)
        row["differentiated"] = law.signal in ACCELERATIONS
        row["measured"] = law.instrument == "measured"
        row["form"] = FORMS.index(law.form)
        row["intensity"] = np.nan_to_num(law.noise_density) ** 2
        row["mode_frequency"] = 2.0 * math.pi * law.mode_frequency
        row["lag"] = round(law.lag / dt)
    memory = np.zeros((len(laws), RING + max(table["lag"], default=0)))
    memory[:, PP] = [np.nan_to_num(law.prior_sd) ** 2 for law in laws]
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
    for name in ("least_wheel_speed", "compensation"):
        if getattr(law, name) > 0.0 and outputs[WHEEL_SPEEDS] != OUTPUTS[WHEEL_SPEEDS]:
            raise TwinError(
                f"law: {name} is {getattr(law, name)}; this black box, without wheel speeds, "
                "allows: 0"
            )
    if law.largest_yaw_rate < math.inf and outputs[_YAW_RATE : _YAW_RATE + 1] != ("yaw_rate",):
        raise TwinError(
            f"law: largest_yaw_rate is {law.largest_yaw_rate}; this black box, without a yaw rate, "
            "allows: inf"
        )


@njit(cache=True)
def _moving(y, least):
    """Whether the mean of the wheel speeds is at least so much [rad/s]."""
    total = 0.0
    for i in range(_FIRST_WHEEL, _AFTER_WHEELS):
        total += y[i]
    return total >= 4.0 * least


@njit(cache=True)
def _lead(y, twin_y):
    """By how much the vehicle's wheels are ahead of the twin's, summed [rad/s], and how many tell.

    A wheel speed that is not measured has not been corrected either.
    """
    lead, count = 0.0, 0
    for i in range(_FIRST_WHEEL, _AFTER_WHEELS):
        if not np.isnan(y[i]):
            lead += y[i] - twin_y[i]
            count += 1
    return lead, count


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
    is_elsewhere = False
    if law.compensation > 0.0:
        lead, count = _lead(y, twin_y)
        a_twin -= law.compensation * lead
        if law.largest_compensation < np.inf:
            is_elsewhere = count == 0 or law.compensation * abs(lead) > law.largest_compensation
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
    if is_elsewhere or abs(instrument) < law.least_signal:
        return 0.0
    if law.largest_yaw_rate < np.inf and not abs(y[_YAW_RATE]) <= law.largest_yaw_rate:
        return 0.0
    if law.form == SIGN:
        return law.gain * dt * np.sign(instrument) * (a_twin - a)
    if law.form == INTEGRAL:
        added = dt * (law.gain * (a - a_twin) - law.leak * memory[ADDED])
        memory[ADDED] += added
        return added
    if law.offset_jump > 0.0:
        _watch_offset(law, memory, instrument / law.scale, a_twin - a, dt)
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
def _watch_offset(law, memory, regressor, innovation, dt):
    """Opens the offset anew where the residual's short mean is more than noise and doubt allow."""
    share = min(dt / JUMP_TIME, 1.0)
    memory[MEAN] += share * (innovation - memory[OFFSET] - memory[MEAN])
    doubt = memory[PP] * regressor**2 + 2.0 * memory[PO] * regressor + memory[OO]
    memory[JUMPED] = 0.0
    if memory[MEAN] ** 2 > JUMP**2 * (0.5 * law.intensity / JUMP_TIME + doubt):
        memory[JUMPED] = 1.0
        memory[OO] += law.offset_jump**2
        memory[MEAN] = 0.0


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
