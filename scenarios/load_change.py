"""Two passengers get out at a stop halfway, and the joint observer follows the load."""

import sys

from scenarios.experiment import joint

EXPERIMENT = joint.experiment(joint.LOAD_CHANGE)

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "load-change", *sys.argv[1:]]))
