"""Recorded drives, observed one by one: `til estimate`.

What is finished is kept: each log has a JSON file in the folder, with a fingerprint of the log, its
map, the vehicle and the estimator. A batch that was interrupted goes on where it stopped.
"""

import hashlib
import json
import os
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios.experiment.progress import parallel
from scenarios.experiment.result import Result, json_text, replacing, versions
from scenarios.logs.answer import Answer, answer, sideslip
from scenarios.logs.answer_text import lines_of
from scenarios.logs.estimators import ESTIMATORS, Found
from scenarios.logs.findings import Finding, findings, hills
from scenarios.logs.guesses import with_guesses
from scenarios.logs.mass_interval import unlike_forces, with_hills, with_torque_accuracy
from scenarios.logs.pieces import lacking, measured, prepared
from scenarios.logs.report import write_log_report
from scenarios.logs.trust_spans import distrust_gaps
from scenarios.timeline.timeline import write_timeline
from twin import Drive, TwinError, Vehicle
from twin.car.fingerprint import fingerprint
from twin.car.guesses import guesses_of
from twin.car.signals import signals_of
from twin.logs.input_gaps import gaps_of, sentences
from twin.logs.mapped_log import NEEDS
from twin.logs.raw_log import check_file_size
from twin.toml_file import reason

Array = NDArray[np.float64]

_KEPT = ("mass", "vx", "vy", "yaw_rate", "roll", "pitch")  # what else the history holds


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One log and what is done with it.

    Attributes:
        log: the file.
        map: of its channels; None: it is a drive of ours.
        vehicle: name or file.
        estimator: of `ESTIMATORS`.
        out: where files go, and how they are called: `out / name`.
        name: without ending.
        report: whether a page for people is written.
    """

    log: Path
    map: Path | None
    vehicle: str
    estimator: str
    out: Path
    name: str
    report: bool = False

    def file(self, ending: str) -> Path:
        """Of the folder, by its ending."""
        return self.out / f"{self.name}.{self.estimator}{ending}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of a log.

    Attributes:
        log: as it was given.
        fingerprint: see `fingerprint_of`.
        answer: what is known after it; None if it failed.
        done: sentences: what was done with the log, and what cannot be estimated.
        trustworthy: whether the estimates are at the end; None where nobody looked.
        faults: sentences, each of which makes the estimates not trustworthy.
        kept: whether a run before this one made it.
        error: one line if it failed, else empty.
    """

    log: str
    fingerprint: str = ""
    answer: Answer | None = None
    done: tuple[str, ...] = ()
    trustworthy: bool | None = None
    faults: tuple[str, ...] = ()
    kept: bool = False
    error: str = ""


def run(
    logs: Sequence[Path],
    *,
    vehicle: str,
    map_path: Path | None,
    estimators: Sequence[str],
    jobs: int,
    out: Path,
    report: bool = False,
) -> tuple[dict[str, Any], str, list[str]]:
    """Observes logs; returns the result as JSON, the same as text, and a line for each bad log.

    Raises:
        TwinError: the vehicle's files are missing or broken, or the folder cannot be written.
    """
    start = time.perf_counter()
    Vehicle.load(vehicle)  # before any log is read
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TwinError(f"{out}: cannot be written: {error.strerror}") from error
    tasks = [
        Task(
            log=log,
            map=map_path,
            vehicle=vehicle,
            estimator=estimator,
            out=out,
            name=name,
            report=report,
        )
        for log, name in zip(logs, _names(logs), strict=True)
        for estimator in dict.fromkeys(estimators)
    ]
    outcomes = parallel(observe, tasks, jobs, "estimate")
    result = Result(
        name="estimate",
        settings={"vehicle": vehicle, "map": map_path},
        seconds=time.perf_counter() - start,
        rows=(),
    ).to_json()
    del result["rows"]
    result["logs"] = [
        _finite(_told(task, outcome)) for task, outcome in zip(tasks, outcomes, strict=True)
    ]
    text = "\n".join(_as_text(task, one) for task, one in zip(tasks, outcomes, strict=True))
    return result, text, [one.error for one in outcomes if one.error]


def observe(task: Task) -> Outcome:
    """One log, if it is not done already: writes timeline, history and, last, the result."""
    try:
        check_file_size(task.log)
        mark = fingerprint_of(task)
        before = _read(task, mark)
        if before is not None:
            return before
        found, done = _found(task)
        outcome = Outcome(
            log=str(task.log),
            fingerprint=mark,
            answer=answer(found, Vehicle.load(task.vehicle)),
            done=(*done, *found.done),
            trustworthy=_at_end(found),
            faults=found.faults,
        )
        _write_timeline(task, found)
        _write_history(task, found)
        if task.report:
            _write_report(task, found, outcome)
        content = _told(task, outcome)
        with replacing(task.file(".json")) as partial:
            partial.write_text(json_text(_finite(content)) + "\n", encoding="utf-8")
        return outcome
    except (TwinError, OSError) as error:
        why = reason(error) if isinstance(error, OSError) else " ".join(str(error).split())
        named = why if str(task.log) in why else f"{task.log}: {why}"
        return Outcome(log=str(task.log), error=named)


def fingerprint_of(task: Task) -> str:
    """Hash of all that decides the result: log, map, vehicle, estimator and versions.

    Raises:
        TwinError: a file cannot be read.
    """
    vehicle = Vehicle.load(task.vehicle)
    content = hashlib.sha256(fingerprint(vehicle).encode())
    guesses = [guess.name for guess in guesses_of(vehicle)[0]]
    content.update(json.dumps([task.estimator, versions(), guesses]).encode())
    for path in (task.log, task.map):
        if path is None:
            continue
        try:
            with path.open("rb") as file:
                content.update(hashlib.file_digest(file, "sha256").digest())
        except OSError as error:
            raise TwinError(f"{path}: cannot be read: {error.strerror}") from error
    return content.hexdigest()


def _found(task: Task) -> tuple[Found, tuple[str, ...]]:
    """What the estimator finds, and what was done before."""
    vehicle = Vehicle.load(task.vehicle)
    drive = Drive.load(task.log, task.map, signals_of(vehicle))
    return estimate_of(drive, vehicle, task.estimator)


def estimate_of(
    drive: Drive, vehicle: Vehicle, estimator: str = "til"
) -> tuple[Found, tuple[str, ...]]:
    """What an estimator finds of a drive, its checks included; and what was done before.

    Args:
        drive: a log in our channels.
        vehicle: of the twin.
        estimator: of `ESTIMATORS`.

    Raises:
        TwinError: the drive lacks what the estimator needs, or the twin has blown up.
    """
    log = prepared(drive, float(vehicle.compile().opt.timestep))
    told = tuple(drive.settings.get("log", {}).get("done", ()))
    if not told:
        names = measured(log.pieces)
        wanted = {quantity: lacking(quantity, names) for quantity in NEEDS}
        told = tuple(sentences(gaps_of(drive.settings)))
        told += tuple(
            f"{quantity} cannot be estimated without {', '.join(missing)}."
            for quantity, missing in wanted.items()
            if missing
        )
    longest = max(log.pieces, key=len)
    wrong = findings(longest, vehicle)
    observe_by = ESTIMATORS[estimator]
    found = observe_by(vehicle, log)
    if estimator != "joint":  # whose prior has them
        found = with_guesses(found, vehicle, lambda car: observe_by(car, log))
    found = with_hills(found, hills(longest, vehicle))
    found = with_torque_accuracy(found, vehicle)
    found = found._replace(estimate=distrust_gaps(found.estimate, log.pieces[0]))
    wrong += unlike_forces(found, longest, vehicle)
    return _with_findings(found, wrong), (*told, *log.done)


def _with_findings(found: Found, wrong: Sequence[Finding]) -> Found:
    """Nothing is trustworthy of a log whose channels cannot be what its map says."""
    faults = tuple(str(finding) for finding in wrong if finding.severity == "fault")
    notes = tuple(str(finding) for finding in wrong if finding.severity != "fault")
    estimate = found.estimate
    if faults:
        nowhere = np.zeros(estimate.time.size, dtype=np.bool_)
        estimate = replace(estimate, trustworthy=nowhere)
    return found._replace(
        estimate=estimate, done=(*found.done, *notes), faults=(*faults, *found.faults)
    )


def _at_end(found: Found) -> bool | None:
    trustworthy = found.estimate.trustworthy
    return None if trustworthy is None else bool(trustworthy[-1])


def _write_timeline(task: Task, found: Found) -> None:
    write_timeline(
        task.file(".rrd"),
        vehicle=Vehicle.load(task.vehicle),
        drive=found.drive,
        estimate=found.estimate,
        parameters=found.parameters,
        title=f"{task.name}, {task.estimator}",
    )


def _write_history(task: Task, found: Found) -> None:
    """Estimates over time as Parquet: time, parameters, states, and whether to trust them."""
    import pyarrow as pa  # not at the top, as ever
    import pyarrow.parquet as pq

    estimate = found.estimate
    names = dict.fromkeys((*found.parameters, *_KEPT))
    columns: dict[str, Any] = {"time": estimate.time, "sideslip": sideslip(found)}
    if estimate.sideslip_sd is not None:
        columns["sideslip_sd"] = estimate.sideslip_sd
    columns |= {name: estimate[name] for name in names}
    if estimate.trustworthy is not None:
        columns["trustworthy"] = estimate.trustworthy
    with replacing(task.file(".parquet")) as partial:
        pq.write_table(pa.table(columns), partial)


def _write_report(task: Task, found: Found, outcome: Outcome) -> None:
    if outcome.answer is None:
        return
    names = {"log": task.log.name, "map": task.map and task.map.name, "vehicle": task.vehicle}
    write_log_report(
        task.file(".html"),
        found=found,
        answer=outcome.answer,
        vehicle=Vehicle.load(task.vehicle),
        done=outcome.done,
        settings=names | {"estimator": task.estimator},
    )


def _read(task: Task, mark: str) -> Outcome | None:
    """What a run before made of the same; None if there is none or something has changed."""
    path = task.file(".json")
    endings = (".json", ".rrd", ".parquet", *((".html",) if task.report else ()))
    if not all(task.file(ending).is_file() for ending in endings):
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["fingerprint"] != mark:
            return None
        for name in ("name", "estimator"):
            content.pop(name)
        content |= {"answer": Answer.from_json(content["answer"]), "kept": True}
        content |= {name: tuple(content[name]) for name in ("done", "faults")}
        return Outcome(**content)
    except (ValueError, TypeError, KeyError):
        return None


def _finite(value: Any) -> Any:
    """What JSON can hold: no NaN, no infinity."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _names(logs: Sequence[Path]) -> list[str]:
    """A name for each log's files: its own, with its folders where two logs share one."""
    stems = [log.stem for log in logs]
    if len(set(stems)) == len(stems):
        return stems
    try:
        root = os.path.commonpath([log.resolve().parent for log in logs])
    except ValueError:
        root = "/"
    names = ["-".join(log.resolve().relative_to(root).parts) for log in logs]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise TwinError(f"{repeated[0]}: is given twice; allowed: each log once")
    return names


def _told(task: Task, outcome: Outcome) -> dict[str, Any]:
    """A log's result as JSON keeps it."""
    return {"name": task.name, "estimator": task.estimator} | asdict(outcome)


def _as_text(task: Task, outcome: Outcome) -> str:
    """What is known after a log and what was done with it, line by line."""
    if outcome.error:
        return f"{task.log}: failed"
    kept = f"kept from before, in {task.file('.json')}" if outcome.kept else ""
    end = {True: "at the end the estimates are trustworthy", None: "",
           False: "AT THE END THE ESTIMATES ARE NOT TRUSTWORTHY"}[outcome.trustworthy]  # fmt: skip
    notes = ", ".join(part for part in (end, kept) if part)
    title = f"{task.log}, {task.estimator}" + (f": {notes}" if notes else "")
    known = [] if outcome.answer is None else lines_of(outcome.answer)
    lines = [*known, *outcome.done, *(f"NOT TRUSTWORTHY: {fault}" for fault in outcome.faults)]
    lines += [f"report: {task.file('.html')}"] if task.report else []
    return "\n".join([title, *(f"  {line}" for line in lines)])
