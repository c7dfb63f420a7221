"""A minute near the limit: all load parameters, tyres and springs, the friction among them."""

import sys

from scenarios.experiment import joint

EXPERIMENT = joint.experiment("hard")

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "hard", *sys.argv[1:]]))
