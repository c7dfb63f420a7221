"""Roll and yaw inertia from a swept steer at constant speed: TiL Section 4.3, Table 5."""

import sys

from estimators.til.law import ParameterLaw
from scenarios.driving.manoeuvres import swept_steer
from scenarios.experiment.study import CM, INFINITE, Case, Study, scenario

WRONG_MASS = CM
WRONG_MASS_AND_CM = ()


def _paper(jxx: float, jzz: float) -> tuple[tuple[str, float], ...]:
    return (("Jxx", jxx), ("Jzz", jzz))


STUDY = Study(
    target="scenarios.roll_yaw:STUDY",
    manoeuvre=lambda duration: swept_steer(duration=duration),
    laws={
        # The modes are those of the car on its springs and on its tyres at 25 m/s; gains are those
        # of `til tune roll-yaw`, rounded.
        "til": (
            ParameterLaw(
                parameter="Jxx",
                signal="roll_acceleration",
                scale=834.0,  # kg m2, the twin's chassis
                prior_sd=150.0,
                noise_density=0.0075,  # rad/s2 per root of Hz
                drift=0.015,
                filter_time=0.03,
                mode_frequency=2.0,
                mode_damping=0.5,
            ),
            ParameterLaw(
                parameter="Jzz",
                signal="yaw_acceleration",
                scale=3933.0,
                prior_sd=700.0,
                noise_density=0.014,
                drift=0.07,
                filter_time=0.03,
                mode_frequency=0.8,
                mode_damping=0.65,
            ),
        ),
        # TiL Eq. (15), corrected in sign
        "til-paper": (
            ParameterLaw(
                parameter="Jxx", signal="roll_acceleration", instrument="measured", form="sign",
                gain=3800.0,
            ),
            ParameterLaw(
                parameter="Jzz", signal="yaw_acceleration", instrument="measured", form="sign",
                gain=1400.0,
            ),
        ),
    },
    cases=(
        Case(name="noiseless, correct mass, correct CM", snr=INFINITE, paper=_paper(0.38, 0.96)),
        Case(
            name="noiseless, wrong mass, correct CM", snr=INFINITE, known=WRONG_MASS,
            paper=_paper(4.22, 0.25),
        ),
        Case(name="noisy, correct mass, correct CM", snr=10.0, paper=_paper(23.91, 6.18)),
        Case(
            name="noisy, wrong mass, correct CM", snr=10.0, known=WRONG_MASS,
            paper=_paper(26.50, 5.38),
        ),
        Case(
            name="noisy, wrong mass, wrong CM", snr=10.0, known=WRONG_MASS_AND_CM,
            paper=_paper(45.43, 26.50),
        ),
        Case(
            name="noisy accelerations, correct mass, correct CM", snr=10.0,
            noise_on="accelerations", paper=_paper(23.91, 6.18),
        ),
        Case(
            name="noisy, correct mass, correct CM, unknown products of inertia", snr=10.0,
            known=("mass", "cm_x", "cm_y", "cm_z"),
        ),
    ),
)  # fmt: skip
SCENARIO = scenario(STUDY)

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "roll-yaw", *sys.argv[1:]]))
