"""A swept steer at constant speed excites the roll and yaw inertia: TiL Section 4.3, Table 5."""

import sys
from functools import partial

from scenarios.driving.manoeuvres import swept_steer
from scenarios.experiment import single
from scenarios.experiment.experiment import CM, INFINITE
from scenarios.experiment.laws import PAPER_ROLL_LAW, PAPER_YAW_LAW, ROLL_LAW, YAW_LAW

WRONG_MASS = CM
WRONG_MASS_AND_CM = ()
PLACE = ("mass", "cm_x", "cm_y", "cm_z")
_row = partial(single.row, swept_steer)


def _paper(jxx: float, jzz: float) -> dict[str, float]:
    return {"Jxx": jxx, "Jzz": jzz}


EXPERIMENT = single.experiment(
    "roll-yaw",
    laws=(ROLL_LAW, YAW_LAW),
    paper=(PAPER_ROLL_LAW, PAPER_YAW_LAW),
    table=(
        _row("noiseless, correct mass, correct CM", INFINITE, _paper(0.38, 0.96)),
        _row("noiseless, wrong mass, correct CM", INFINITE, _paper(4.22, 0.25), WRONG_MASS),
        _row("noisy, correct mass, correct CM", 10.0, _paper(23.91, 6.18)),
        _row("noisy, wrong mass, correct CM", 10.0, _paper(26.50, 5.38), WRONG_MASS),
        _row("noisy, wrong mass, wrong CM", 10.0, _paper(45.43, 26.50), WRONG_MASS_AND_CM),
        _row(
            "noisy accelerations, correct mass, correct CM", 10.0, _paper(23.91, 6.18),
            noise_on="accelerations",
        ),
        _row(
            "noisy, correct mass, correct CM, unknown products of inertia", 10.0, knows=PLACE
        ),
    ),
    driven="noisy, correct mass, correct CM",
)  # fmt: skip

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "roll-yaw", *sys.argv[1:]]))
