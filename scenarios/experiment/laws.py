"""Laws of the SUV's load parameters: our defaults, and the paper's with its signs corrected."""

from collections.abc import Mapping
from dataclasses import replace

from estimators.til.law import ParameterLaw
from scenarios.experiment.experiment import Gain, Recipe

MASS_LAW = ParameterLaw(
    parameter="mass",
    signal="ax",
    instrument="twin",
    form="least-squares",
    scale=2125.8,  # kg, the twin's chassis
    prior_sd=400.0,  # kg: a full car
    noise_density=0.02,  # an IMU of 0.6 m/s2 at 1 kHz
    drift=0.1,  # kg per root of second: 1 kg in two minutes
    offset_sd=0.05,  # m/s2: half a degree of pitch
    least_wheel_speed=3.0,  # rad/s, 1 m/s
)

# The modes are those of the car on its springs and on its tyres at 25 m/s; gains are those of
# `til tune roll-yaw`, rounded.
ROLL_LAW = ParameterLaw(
    parameter="Jxx",
    signal="roll_acceleration",
    scale=834.0,  # kg m2, the twin's chassis
    prior_sd=150.0,
    noise_density=0.0075,  # rad/s2 per root of Hz
    drift=0.015,
    filter_time=0.03,
    mode_frequency=2.0,
    mode_damping=0.5,
)
YAW_LAW = ParameterLaw(
    parameter="Jzz",
    signal="yaw_acceleration",
    scale=3933.0,
    prior_sd=700.0,
    noise_density=0.014,
    drift=0.07,
    filter_time=0.03,
    mode_frequency=0.8,
    mode_damping=0.65,
)

# Where the twin is driven by a noisy road its own signal is no clean instrument. The measured one
# of 150 ms ago is: independent of both noises of now, and in antiphase by the pitch mode. Gains are
# those of `til tune pitch`, rounded.
PITCH_LAW = ParameterLaw(
    parameter="Jyy",
    signal="pitch_acceleration",
    instrument="measured",
    lag=0.15,
    scale=-3640.0,  # kg m2, the twin's chassis
    prior_sd=600.0,
    noise_density=0.003,  # rad/s2 per root of Hz
    drift=15.0,
    filter_time=0.08,
)
# Where the twin knows the road exactly its own signal is a clean instrument. The mode is that of
# the SUV; all chosen by a drive on which all else was known: within 4 % after 20 s.
PITCH_LAW_OF_A_KNOWN_ROAD = ParameterLaw(
    parameter="Jyy",
    signal="pitch_acceleration",
    scale=3640.0,
    prior_sd=600.0,
    noise_density=0.02,
    drift=1.0,
    filter_time=0.03,
    mode_frequency=1.7,
    mode_damping=0.5,
)


def _paper(parameter: str, signal: str, gain: float) -> ParameterLaw:
    """TiL Eqs. (14), (15) and (18), corrected in sign."""
    return ParameterLaw(
        parameter=parameter, signal=signal, instrument="measured", form="sign", gain=gain
    )


PAPER_MASS_LAW = _paper("mass", "ax", 420.0)
PAPER_ROLL_LAW = _paper("Jxx", "roll_acceleration", 3800.0)
PAPER_YAW_LAW = _paper("Jzz", "yaw_acceleration", 1400.0)
PAPER_PITCH_LAW = _paper("Jyy", "pitch_acceleration", 4200.0)

# One law for each parameter, to run all of them at once
ALL_LAWS = (MASS_LAW, PITCH_LAW_OF_A_KNOWN_ROAD, ROLL_LAW, YAW_LAW)
ALL_PAPER_LAWS = (PAPER_MASS_LAW, PAPER_PITCH_LAW, PAPER_ROLL_LAW, PAPER_YAW_LAW)


def recipes(laws: tuple[ParameterLaw, ...], paper: tuple[ParameterLaw, ...]) -> dict[str, Recipe]:
    """Our laws as `til`, the paper's as `til-paper`."""
    return {
        name: Recipe(estimator=name, laws=own, tunable=lambda _, own=own: gains_of(own))
        for name, own in (("til", laws), ("til-paper", paper))
    }


def gains_of(laws: tuple[ParameterLaw, ...]) -> tuple[Gain, ...]:
    """What can be tuned of each law: bounds span the decades that make sense for its parameter."""
    found = []
    for law in laws:
        fields = {"gain": (1.0, 1e4)}
        if law.form != "sign":
            fields = {
                "noise_density": (1e-3, 1.0),
                "drift": (1e-4 * law.prior_sd, 1e-1 * law.prior_sd),
            }
        found += [
            Gain(f"{law.parameter} {field}", low, high, getattr(law, field))
            for field, (low, high) in fields.items()
        ]
    return tuple(found)


def with_gains(
    laws: tuple[ParameterLaw, ...], values: Mapping[str, float]
) -> tuple[ParameterLaw, ...]:
    """The laws with these gains, named as in `gains_of`."""
    changed = {law.parameter: law for law in laws}
    for name, value in values.items():
        parameter, field = name.split()
        changed[parameter] = replace(changed[parameter], **{field: value})
    return tuple(changed.values())
