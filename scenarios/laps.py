"""Laps of a circuit at the limits of a sports car: sideslip and mass, the twin off by 350 kg.

TiL Section 5; see `scenarios.experiment.sideslip_and_mass`.
"""

import sys

from scenarios.experiment import sideslip_and_mass

EXPERIMENT = sideslip_and_mass.experiment("laps")

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "laps", *sys.argv[1:]]))
