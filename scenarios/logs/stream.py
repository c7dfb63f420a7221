"""Samples from standard input, estimates to standard output: `til estimate -`.

A line is a JSON object, or a row of CSV under a row of names. Names are ours, with or without
"input." and "measurement." as in a drive's file, or those of a map.
"""

import csv
import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TextIO

import numpy as np

from estimators.til.stream import Sample, Stream
from scenarios.logs.default_observer import Default, default_observer
from scenarios.logs.pieces import ROAD
from twin import INPUTS, OUTPUTS, TwinError, Vehicle
from twin.logs.csv import MARK
from twin.logs.map import LogMap, Source, unit_in_si

Numbers = dict[str, float]  # of one sample, in our names and units
_TIMES = ("time", "t")
_PREFIXES = ("input.", "measurement.")


def run(vehicle: str, map_path: Path | None, state: Path | None) -> int:
    """Observes standard input to its end; returns the exit status.

    Raises:
        TwinError: a file or a line is broken, a channel is missing, an input out of range, or the
            twin has blown up.
    """
    log_map = LogMap.load(map_path) if map_path else None
    car = Vehicle.load(vehicle)
    try:
        observe(car, sys.stdin, lambda line: print(line, flush=True), log_map, state)
    except BrokenPipeError:  # the reader has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def observe(
    vehicle: Vehicle,
    lines: Iterable[str],
    write: Callable[[str], object],
    log_map: LogMap | None = None,
    state: Path | None = None,
    report: TextIO | None = None,
) -> Stream | None:
    """Observes lines as they come, and tells at the end what became of them.

    Args:
        vehicle: of the twin.
        lines: of JSON or CSV.
        write: takes an estimate as a line of JSON.
        log_map: names, units and signs of the lines; None: ours.
        state: file to go on from, if it is there, and to leave.
        report: what notes go to; None: standard error.

    Raises:
        TwinError: see `run`.
    """
    report = report or sys.stderr
    stream, default = None, None
    for sample in _samples(lines, log_map):
        if stream is None or default is None:
            default, notes = _default_for(vehicle, sample)
            stream = Stream(default.observer, default.rolling_radius)
            if state and state.exists():
                stream.restore(state)
            for note in notes:
                print(f"til: {note}", file=report)
        u = [sample.get(name, 0.0 if name in ROAD else math.nan) for name in INPUTS]
        y = [sample.get(name, math.nan) for name in OUTPUTS]
        found = stream.update(sample.get("time", math.nan), u, y, speed=sample.get("vx", math.nan))
        if found:
            write(_line(found, stream, default))
    if stream is None:
        raise TwinError("standard input: has no samples; allowed: lines of JSON or CSV")
    if state:
        stream.save(state)
    told = ", ".join(f"{count} {name}" for name, count in stream.counts.items() if count)
    print(f"til: samples: {told}", file=report)
    return stream


def _default_for(vehicle: Vehicle, sample: Numbers) -> tuple[Default, tuple[str, ...]]:
    """The observer for the channels of a first sample, and what to say of it.

    Raises:
        TwinError: an input is missing.
    """
    for name in INPUTS:
        if name not in sample and name not in ROAD:
            raise TwinError(
                f"standard input: {name} is missing in the first sample; allowed: all inputs but "
                "road heights"
            )
    names = {name for name in OUTPUTS if name in sample}
    default = default_observer(vehicle, names, mass="ax" in names)
    notes = [*default.left_out]
    if "ax" not in names:
        notes.append("mass cannot be estimated without ax.")
    return default, tuple(notes)


def _line(sample: Sample, stream: Stream, default: Default) -> str:
    """An estimate as a line of JSON."""
    observer = stream.observer
    states = dict(zip(observer.twin.states, sample.states.tolist(), strict=True))
    told: dict[str, object] = {"time": round(sample.time, 9)}
    sd = observer.parameter_sd()
    for name in default.parameters:
        told[name] = float(sample.parameters[observer.twin.parameters.index(name)])
        if name in sd:
            told[f"{name}_sd"] = sd[name]
    told["sideslip"] = math.atan2(states["vy"], max(states["vx"], 1.0))
    told |= {name: states[name] for name in ("vx", "vy", "yaw_rate")}
    resting = [
        name
        for name, bound in default.largest.items()
        if abs(float(str(told[name]))) >= 0.999 * bound
    ]
    told["trustworthy"] = sample.trustworthy and not resting
    if resting:
        told["at_bound"] = resting
    if observer.rejected:
        told["rejected"] = list(observer.rejected)
    return json.dumps(told)


def _samples(lines: Iterable[str], log_map: LogMap | None) -> Iterator[Numbers]:
    named = _Named(log_map) if log_map else _ours
    for row in _rows(lines):
        yield named(row)


def _rows(lines: Iterable[str]) -> Iterator[Mapping[str, float]]:
    """Numbers by the names that the lines give them; NaN where there is none."""
    names: list[str] = []
    for number, raw in enumerate(lines, 1):
        line = raw.strip().removeprefix("\ufeff")
        if not line or line.startswith(MARK.strip()) or line.startswith("#"):
            continue
        if line.startswith("{"):
            yield _of_json(line, number)
        elif not names:
            names = [name.strip() for name in next(csv.reader([line]))]
        else:
            cells = next(csv.reader([line]))
            if len(cells) != len(names):
                raise TwinError(
                    f"standard input: line {number} has {len(cells)} entries; allowed: "
                    f"{len(names)}, as the row of names"
                )
            yield {
                name: _number(cell, name, number) for name, cell in zip(names, cells, strict=True)
            }


def _of_json(line: str, number: int) -> dict[str, float]:
    try:
        content = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise TwinError(f"standard input: line {number} is no JSON: {error}") from None
    return {str(name): _number(value, name, number) for name, value in content.items()}


def _number(value: object, name: str, line: int) -> float:
    if value is None or (isinstance(value, str) and value.strip() in ("", "-", "null", "NA")):
        return math.nan
    try:
        return float(value)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError):
        raise TwinError(
            f"standard input: {name[:40]} is {str(value)[:20]!r} in line {line}; allowed: a number"
        ) from None


def _ours(row: Mapping[str, float]) -> Numbers:
    """A sample that has our names."""
    found: Numbers = {}
    for name, value in row.items():
        for prefix in _PREFIXES:
            name = name.removeprefix(prefix)
        found["time" if name in _TIMES else name] = value
    if "time" not in found:
        raise TwinError("standard input: has no time; allowed: a column or key time [s]")
    return found


class _Named:
    """Samples of a map's names and units, in ours."""

    def __init__(self, log_map: LogMap) -> None:
        self.map = log_map
        self.scales = {name: self._scale(name, s) for name, s in log_map.channels.items()}

    def __call__(self, row: Mapping[str, float]) -> Numbers:
        found: Numbers = dict(self.map.constants)
        time = self.map.time_name or next((name for name in _TIMES if name in row), "time")
        for name in (time, *(source.name for source in self.map.channels.values())):
            if name not in row:
                raise TwinError(f"standard input: {name!r}, which the map names, is missing")
        found["time"] = row[time] * (self.map.time_unit or 1.0)
        for name, source in self.map.channels.items():
            scale = self.scales[name]
            found[name] = float(np.clip(scale * (row[source.name] - source.offset), -1e300, 1e300))
        return found

    def _scale(self, name: str, source: Source) -> float:
        """Ours per number of the lines."""
        if source.unit is None:
            raise TwinError(f"{self.map.path}: channels.{name}.unit is missing; a stream needs it")
        if source.delay:
            raise TwinError(
                f"{self.map.path}: channels.{name}.delay is {source.delay:g}; allowed in a stream: "
                "0"
            )
        return source.sign * unit_in_si(name, source.unit, source.radius) * source.factor
