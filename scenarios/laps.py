"""Laps of a circuit, and lane changes: a sports car at its limits, its twin off by 350 kg.

TiL Section 5, sideslip and mass together; see `scenarios.experiment.state_study`.
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from scenarios.cli.catalogue import Scenario, Settings, Tuning
from scenarios.experiment import state_study
from scenarios.experiment.progress import parallel
from scenarios.experiment.result import Result, Row
from scenarios.experiment.state_study import ESTIMATORS, TWIN, Run, Score, score

CASE = "mismatched"


def rows(todo: Sequence[Run], jobs: int, label: str) -> list[Row]:
    """The runs' errors, over the seeds of runs that differ in nothing else."""
    found: dict[tuple[str, str, str], list[Score]] = {}
    for run, one in zip(todo, parallel(score, todo, jobs, label), strict=True):
        found.setdefault((run.case, run.drive, run.estimator), []).append(one)
    return [row for key, scores in found.items() for row in _rows(*key, scores)]


def _rows(case: str, drive: str, estimator: str, scores: Sequence[Score]) -> list[Row]:
    row = partial(Row.over_seeds, case=f"{case}, {drive}", estimator=estimator)
    kept = [
        row([s.sideslip for s in scores], quantity="sideslip", metric="rmse", unit="deg"),
    ]
    if estimator == "static-map":
        return kept
    kept.append(row([s.mass for s in scores], quantity="mass", metric="rmse_last_60s", unit="kg"))
    if estimator == "double-track":
        return kept
    for k, axle in enumerate(("front", "rear")):
        forces = [s.axle_force[k] for s in scores]
        kept.append(row(forces, quantity=f"fy_{axle}", metric="rmse", unit="N"))
    return kept


def _runs(drive: str, settings: Settings) -> list[Run]:
    own = state_study.gains_from(settings.gains, CASE) if settings.gains else None
    return [
        replace(
            run,
            snr=settings.snr,
            duration=settings.duration,
            gains=own if run.estimator == "til" else None,
        )
        for run in state_study.runs([CASE], [drive], ESTIMATORS, settings.seeds)
    ]


def _scenario(drive: str) -> Scenario:
    def run(settings: Settings) -> Result:
        start = time.perf_counter()
        found = rows(_runs(drive, settings), settings.jobs, drive)
        return Result(
            name=drive,
            settings=asdict(settings),
            seconds=time.perf_counter() - start,
            rows=found,
        )

    def tune(tuning: Tuning) -> Result:
        from scenarios.tuning import states as tune_states

        return tune_states.run(CASE, tuning)

    def timeline(settings: Settings, path: Path) -> None:
        from scenarios.timeline import laps as timeline_laps

        timeline_laps.write(path, _runs(drive, settings), title=drive)

    return Scenario(
        run=run,
        tune=tune,
        timeline=timeline,
        default_snr=state_study.SNR,
        vehicle=TWIN,
        drive=lambda settings: state_study.clean_drive("same", drive, settings.duration),
        variation=lambda: {"mass": state_study.MISSING},
        takes_gains=True,
    )


LAPS = _scenario("laps")
LANE_CHANGE = _scenario("lane-change")

if __name__ == "__main__":
    from scenarios.__main__ import main

    sys.exit(main(["run", "laps", *sys.argv[1:]]))
