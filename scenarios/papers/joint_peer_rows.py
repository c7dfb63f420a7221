"""Rows of the joint observer's peers, over the same noisy drives."""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.experiment.joint import NAMES, Run, clean_drive, truth, units
from scenarios.experiment.progress import parallel
from scenarios.experiment.result import Row
from scenarios.experiment.study import TWIN
from scenarios.papers.joint_peers import PAPER_LAWS, PEERS
from scenarios.plants.mismatch import MISMATCHES, real_drive
from twin import OUTPUTS, Vehicle

Array = NDArray[np.float64]


class PeerScore(NamedTuple):
    """Of one run: errors at the end and claimed sd by parameter; no sd where it claims none."""

    error: dict[str, float]
    sd: dict[str, float]


def score(peer: str, run: Run) -> PeerScore:
    """Scores one run of a peer, started from an empty car."""
    clean = clean_drive(run.drive, run.mismatch, run.duration)
    drive = real_drive(clean, MISMATCHES[run.mismatch], run.snr, np.random.default_rng(run.seed))
    sd = [drive.settings["noise_sd"][name] for name in OUTPUTS]
    estimate = PEERS[peer](Vehicle.load(TWIN), drive, sd, float(clean.truth["vx"][0]))
    off = estimate.parameters[-1, : len(NAMES)] - truth(drive)[-1]
    if estimate.sd is not None:
        names = estimate.estimated
        claimed = dict(zip(names, estimate.sd[-1].tolist(), strict=True))
    else:
        names, claimed = tuple(law.parameter for law in PAPER_LAWS), {}
    return PeerScore({name: float(off[NAMES.index(name)]) for name in names}, claimed)


def rows(
    peer: str,
    drive: str,
    mismatch: str,
    snr: float,
    seeds: Sequence[int],
    jobs: int,
    duration: float | None = None,
) -> list[Row]:
    """All seeds of a peer: errors, and coverage where it claims a standard deviation."""
    todo = [Run(drive=drive, mismatch=mismatch, snr=snr, seed=s, duration=duration) for s in seeds]
    clean_drive(drive, mismatch, duration)
    scores = parallel(partial(score, peer), todo, jobs, f"{drive} {mismatch} {peer}")
    one = partial(Row.over_seeds, case=f"{drive}, {mismatch}", estimator=peer)
    found, covered = [], []
    for name in scores[0].error:
        unit = units()[NAMES.index(name)]
        errors = np.abs([s.error[name] for s in scores])
        found.append(one(100.0 * errors / unit, quantity=name, metric="pct", unit="%"))
        if scores[0].sd:
            sds = np.array([s.sd[name] for s in scores])
            found.append(one(100.0 * sds / unit, quantity=name, metric="claimed_sd_pct", unit="%"))
            covered.append(errors <= 2.0 * sds)
    if covered:
        shares = np.mean(covered, axis=0)
        found.append(one(shares, quantity="all", metric="coverage", unit="1"))
    return found
