"""A rough road at constant speed excites the pitch inertia: TiL Section 4.4, Table 6."""

import sys
from functools import partial

from scenarios.driving.manoeuvres import random_road
from scenarios.experiment import single
from scenarios.experiment.experiment import CM, INFINITE, MASS
from scenarios.experiment.laws import PAPER_PITCH_LAW, PITCH_LAW

ROAD_NOISE = 0.1  # half width of TiL Eq. (17)
_row = partial(single.row, random_road)
_noisy_road = partial(_row, road_noise=ROAD_NOISE)

EXPERIMENT = single.experiment(
    "pitch",
    laws=(PITCH_LAW,),
    paper=(PAPER_PITCH_LAW,),
    table=(
        _row("noiseless, noiseless road, correct mass, correct CM", INFINITE, {"Jyy": 0.11}),
        _noisy_road("noiseless, noisy road, correct mass, correct CM", INFINITE, {"Jyy": 3.19}),
        _row("noisy, noiseless road, correct mass, correct CM", 10.0, {"Jyy": 0.33}),
        _noisy_road("noisy, noisy road, correct mass, correct CM", 10.0, {"Jyy": 3.24}),
        _noisy_road("noisy, noisy road, wrong mass, correct CM", 10.0, {"Jyy": 2.38}, CM),
        _noisy_road("noisy, noisy road, correct mass, wrong CM", 10.0, {"Jyy": 5.51}, MASS),
        _noisy_road("noisy, noisy road, wrong mass, wrong CM", 10.0, {"Jyy": 10.20}, ()),
        _row(
            "noisy accelerations, noiseless road, correct mass, correct CM",
            10.0,
            {"Jyy": 0.33},
            noise_on="accelerations",
        ),
    ),
    driven="noisy, noiseless road, correct mass, correct CM",
)

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "pitch", *sys.argv[1:]]))
