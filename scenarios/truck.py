"""A truck's load changes twice on a rough road: Kalman-Bucy filters beside the TiL observer, KBF.

All estimators see the same drives, in both readings of the paper's noise.
"""

import sys

from scenarios.experiment import truck

ESTIMATED = ("kalman-bucy", "kalman-bucy-matched", "kalman-bucy-literal", "til")

EXPERIMENT = truck.experiment("truck", truck.CASES, truck.some(*ESTIMATED))

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "truck", *sys.argv[1:]]))
