"""Pitch inertia from a random road at constant speed: TiL Section 4.4, Table 6."""

import sys

from estimators.til.law import ParameterLaw
from scenarios.driving.manoeuvres import random_road
from scenarios.experiment.study import CM, INFINITE, MASS, Case, Study, scenario


def _paper(jyy: float) -> tuple[tuple[str, float], ...]:
    return (("Jyy", jyy),)


ROAD_NOISE = 0.1  # half width of TiL Eq. (17)

STUDY = Study(
    target="scenarios.pitch:STUDY",
    manoeuvre=lambda duration: random_road(duration=duration),
    laws={
        # The noisy road drives the twin, so its own signal is no clean instrument. The measured one
        # of 150 ms ago is: independent of both noises of now, and in antiphase by the pitch mode.
        # Gains are those of `til tune pitch`, rounded.
        "til": (
            ParameterLaw(
                parameter="Jyy",
                signal="pitch_acceleration",
                instrument="measured",
                lag=0.15,
                scale=-3640.0,  # kg m2, the twin's chassis
                prior_sd=600.0,
                noise_density=0.003,  # rad/s2 per root of Hz
                drift=15.0,
                filter_time=0.08,
            ),
        ),
        # TiL Eq. (18), corrected in sign
        "til-paper": (
            ParameterLaw(
                parameter="Jyy", signal="pitch_acceleration", instrument="measured", form="sign",
                gain=4200.0,
            ),
        ),
    },
    cases=(
        Case(
            name="noiseless, noiseless road, correct mass, correct CM", snr=INFINITE,
            paper=_paper(0.11),
        ),
        Case(
            name="noiseless, noisy road, correct mass, correct CM", snr=INFINITE,
            road_noise=ROAD_NOISE, paper=_paper(3.19),
        ),
        Case(name="noisy, noiseless road, correct mass, correct CM", snr=10.0, paper=_paper(0.33)),
        Case(
            name="noisy, noisy road, correct mass, correct CM", snr=10.0, road_noise=ROAD_NOISE,
            paper=_paper(3.24),
        ),
        Case(
            name="noisy, noisy road, wrong mass, correct CM", snr=10.0, road_noise=ROAD_NOISE,
            known=CM, paper=_paper(2.38),
        ),
        Case(
            name="noisy, noisy road, correct mass, wrong CM", snr=10.0, road_noise=ROAD_NOISE,
            known=MASS, paper=_paper(5.51),
        ),
        Case(
            name="noisy, noisy road, wrong mass, wrong CM", snr=10.0, road_noise=ROAD_NOISE,
            known=(), paper=_paper(10.20),
        ),
        Case(
            name="noisy accelerations, noiseless road, correct mass, correct CM", snr=10.0,
            noise_on="accelerations", paper=_paper(0.33),
        ),
    ),
)  # fmt: skip
SCENARIO = scenario(STUDY)

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "pitch", *sys.argv[1:]]))
