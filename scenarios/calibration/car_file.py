"""The file of a calibrated car: what was found, and from what."""

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomli_w

import models
from estimators.least_squares import Fit
from scenarios.calibration.task import Task
from scenarios.experiment.result import replacing, versions
from scenarios.logs.free_parameters import FREE
from twin import Vehicle


def write(path: Path, task: Task, logs: Sequence[Path], found: Fit) -> None:
    """Writes what was found, and from what, as TOML; whole or not at all."""
    fixed = dict(task.candidate.values)
    content: dict[str, Any] = {
        "vehicle": _base(task.candidate.vehicle, path),
        "logs": [log.name for log in logs],
        "log_sha256": [hashlib.sha256(log.read_bytes()).hexdigest() for log in logs],
        "from_s": [float(drive.time[0]) for drive in task.drives],
        "to_s": [float(drive.time[-1]) for drive in task.drives],
        "signals": list(task.signals),
        "residuals_rms_before": found.rms_before,
        "residuals_rms_after": found.rms_after,
        "evaluations": found.evaluations,
        "converged": found.converged,
        "versions": versions(),
        "fixed": {name: float(v) for name, v in fixed.items() if name not in task.free},
        "gains": {f"{of}->{to}": float(g) for (to, of), g in task.candidate.gains.items()},
        "values": {},
    }
    table = zip(task.free, found.values, found.low, found.high, found.at_bound, strict=True)
    for name, value, low, high, at_bound in table:
        content["values"][name] = {
            "value": float(value),
            "low_95": float(low),
            "high_95": float(high),
            "unit": FREE[name].unit,
            "at_bound": bool(at_bound),
            "prior_sd": task.prior_sd.get(name, FREE[name].prior_sd),
        }
    with replacing(path) as partial_file:
        partial_file.write_bytes(tomli_w.dumps(content).encode())


def _base(vehicle: Vehicle, path: Path) -> str:
    """The car as its calibration names it: by its name, or by its file seen from there."""
    if vehicle.source.parent == models.path("suv").parent:
        return vehicle.source.stem
    return os.path.relpath(vehicle.source, path.parent)
