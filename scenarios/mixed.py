"""Two minutes of slaloms, braking and bumps: all load parameters, tyres and springs at once."""

import sys

from scenarios.experiment import joint

EXPERIMENT = joint.experiment("mixed")

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "mixed", *sys.argv[1:]]))
