"""The scenario of KBF: a truck's load changes twice while it drives over a rough road.

Kalman-Bucy filters and the Twin-in-the-Loop observer look for it on the same drives, in both
readings of the paper's noise.
"""

import math
import sys
import time
from dataclasses import asdict
from pathlib import Path

from scenarios.cli.catalogue import Scenario, Settings
from scenarios.experiment.result import Result
from scenarios.papers.truck_drive import FULL_DURATION, NOISE, TruckCase, make_drive
from scenarios.papers.truck_estimators import ESTIMATORS, some
from scenarios.papers.truck_score import run_cases
from twin import TwinError

ESTIMATED = ("kalman-bucy", "kalman-bucy-matched", "kalman-bucy-literal", "til")


def cases(settings: Settings) -> list[TruckCase]:
    """Both readings of the paper's noise, as long as the settings say.

    Raises:
        TwinError: the settings ask for another noise.
    """
    if not math.isnan(settings.snr):
        raise TwinError(
            f"truck: snr is {settings.snr:g}; it has no such setting, the paper names its noise"
        )
    duration = min(settings.duration or FULL_DURATION, FULL_DURATION)
    return [TruckCase(name=name, noise=name, duration=duration) for name in NOISE]


def run(settings: Settings) -> Result:
    """The scenario."""
    start = time.perf_counter()
    rows = run_cases(cases(settings), some(*ESTIMATED), settings.seeds, jobs=settings.jobs)
    return Result(
        name="truck", settings=asdict(settings), seconds=time.perf_counter() - start, rows=rows
    )


def timeline(settings: Settings, path: Path) -> None:
    """The first seed's drive under the smaller noise as a Rerun recording."""
    from scenarios.timeline.truck import write_truck_timeline

    case = cases(settings)[0]
    drive = make_drive(case, settings.seeds[0])
    estimates = {name: ESTIMATORS[name](case, drive) for name in ("kalman-bucy-matched", "til")}
    write_truck_timeline(path, drive=drive, estimates=estimates, title="truck")


SCENARIO = Scenario(run=run, timeline=timeline, vehicle="truck")


if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "truck", *sys.argv[1:]]))
