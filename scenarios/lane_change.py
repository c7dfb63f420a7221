"""Double lane changes and braking of a sports car: sideslip and mass, the twin off by 350 kg.

TiL Section 5; see `scenarios.experiment.sideslip_and_mass`.
"""

import sys

from scenarios.experiment import sideslip_and_mass

EXPERIMENT = sideslip_and_mass.experiment("lane-change")

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "lane-change", *sys.argv[1:]]))
