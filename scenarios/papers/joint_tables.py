"""The joint observer in tables: every real vehicle, and the last rows of TiL Tables 5 and 6."""

import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from estimators.joint.observer import JointObserver, JointSettings
from estimators.score import rms_pct, settling_time
from scenarios.experiment import joint
from scenarios.experiment.progress import parallel
from scenarios.experiment.result import Result, Row
from scenarios.experiment.study import (
    TWIN,
    Case,
    Run,
    Study,
    find,
    noisy_drive,
    real_drive,
    variation,
)
from scenarios.papers import joint_peer_rows
from scenarios.papers.joint_peers import PEERS
from scenarios.plants.mismatch import MISMATCHES
from twin import LOAD, OUTPUTS, Vehicle

SNR = 10.0  # dB, as in TiL
COMPARED = (("mixed", "same"), ("mixed", "all-scales"))  # by all peers


def everything(seeds: int, jobs: int, out: Path) -> Result:
    """`mixed` against every real vehicle, and the other drives."""
    start = time.perf_counter()
    cases = [("mixed", name) for name in MISMATCHES]
    bounded = [("mixed", "same"), ("hard", "same")]
    cases += [("hard", "same"), ("straight", "same"), ("straight", "imu-bias")]
    cases += [("urban", "all-scales"), (joint.LOAD_CHANGE, "same")]
    # the others look at 37 twins, or through the whole drive many times over
    peers = [("staged", case) for case in cases if case[0] != joint.LOAD_CHANGE]
    peers += [(p, case) for p in PEERS if p != "staged" for case in COMPARED]
    found = [
        row
        for case in cases
        for row in joint.rows(*case, SNR, range(seeds), jobs, with_bound=case in bounded)
    ]
    found += [
        row for p, case in peers for row in joint_peer_rows.rows(p, *case, SNR, range(seeds), jobs)
    ]
    return Result(
        name="til-joint-all",
        settings={"seeds": seeds, "snr": SNR},
        seconds=time.perf_counter() - start,
        rows=found,
    )


def score(run: Run) -> list[tuple[float, float]]:
    """Rms error [%] and time until below 10 % for good [s], as of a study's laws.

    What the case's twin does not know of the load is estimated along with the study's parameters;
    of tyres, springs and sensors all is known, as it is to the laws.
    """
    study = find(run.study)
    clean = real_drive(run.study, run.duration)
    drive = noisy_drive(clean, run.case, run.seed)
    sd = [drive.settings["noise_sd"][name] for name in OUTPUTS]
    known = {name: variation()[name] for name in run.case.known}
    names = tuple(name for name in LOAD if name not in known)
    observer = JointObserver(
        Vehicle.load(TWIN), sd, JointSettings(parameters=names, sensor_errors=())
    )
    observer.reset(float(clean.truth["vx"][0]), known, road=drive.inputs[0, 9:13])
    estimate = observer.run(drive)
    return [
        (
            rms_pct(estimate[name], variation()[name], drive.dt),
            settling_time(estimate[name], variation()[name], drive.dt),
        )
        for name in study.parameters
    ]


def rows(study: Study, cases: Sequence[Case], seeds: Sequence[int], jobs: int) -> list[Row]:
    """The joint observer in the cases of a study whose noise is white on the sensors."""
    cases = [case for case in cases if case.snr < np.inf and case.noise_on == "rates"]
    todo = [
        Run(study=study.target, estimator="joint", case=case, seed=seed, initial=())
        for case in cases
        for seed in seeds
    ]
    scored = list(zip(todo, parallel(score, todo, jobs, f"{study.name} joint"), strict=True))
    found = []
    for case in cases:
        for i, name in enumerate(study.parameters):
            errors, times = zip(*(s[i] for run, s in scored if run.case == case), strict=True)
            one = partial(Row.over_seeds, case=case.name, quantity=name, estimator="joint")
            paper = dict(case.paper).get(name)
            found += [
                one(errors, metric="rms_pct", unit="%", paper=paper),
                one(times, metric="time_to_10pct", unit="s"),
            ]
    return found
