"""A loaded SUV drives through town; its twin believes it empty and finds the 355 kg on board.

The main job: TiL Section 4.2, Table 4.
"""

import sys
from functools import partial

from scenarios.driving.manoeuvres import urban
from scenarios.experiment import single
from scenarios.experiment.experiment import INFINITE, MASS
from scenarios.experiment.laws import MASS_LAW, PAPER_MASS_LAW

_row = partial(single.row, urban)

EXPERIMENT = single.experiment(
    "mass",
    laws=(MASS_LAW,),
    paper=(PAPER_MASS_LAW,),
    table=(
        _row("noiseless, correct CM", INFINITE, {"mass": 0.64}),
        _row("noisy, correct CM", 10.0, {"mass": 1.61}),
        _row("noisy, wrong CM", 10.0, {"mass": 0.68}, knows=MASS),
    ),
    driven="noisy, correct CM",
)

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "mass", *sys.argv[1:]]))
