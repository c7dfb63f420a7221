"""A minute straight on at constant speed: a drive on which nothing is identifiable."""

import sys

from scenarios.experiment import joint

EXPERIMENT = joint.experiment("straight")

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "straight", *sys.argv[1:]]))
