"""The main job: a loaded SUV drives through town, its twin believes it empty and finds the mass.

TiL Section 4.2, Table 4.
"""

import sys

from estimators.til.law import ParameterLaw
from scenarios.driving.manoeuvres import urban
from scenarios.experiment.study import INFINITE, MASS, Case, Study, scenario

STUDY = Study(
    target="scenarios.mass:STUDY",
    manoeuvre=lambda duration: urban(duration=duration),
    laws={
        "til": (
            ParameterLaw(
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
            ),
        ),
        # TiL Eq. (14), corrected in sign
        "til-paper": (
            ParameterLaw(
                parameter="mass", signal="ax", instrument="measured", form="sign", gain=420.0
            ),
        ),
    },
    cases=(
        Case(name="noiseless, correct CM", snr=INFINITE, paper=(("mass", 0.64),)),
        Case(name="noisy, correct CM", snr=10.0, paper=(("mass", 1.61),)),
        Case(name="noisy, wrong CM", snr=10.0, known=MASS, paper=(("mass", 0.68),)),
    ),
)
SCENARIO = scenario(STUDY)

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "mass", *sys.argv[1:]]))
