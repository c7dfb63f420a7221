"""Samples from standard input, estimates to standard output: `til estimate -`.

A line is a JSON object, or one of a table of text, see `scenarios.logs.lines`. Names are ours, with
or without "input." and "measurement." as in a drive's file, or those of a map.
"""

import io
import json
import math
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TextIO

from estimators.til.default_observer import Default, default_observer
from estimators.til.stream import Sample, Stream
from scenarios.logs.lines import LineReader, Numbers
from scenarios.logs.pieces import ROAD
from scenarios.logs.stream_gaps import StreamGaps
from twin import INPUTS, OUTPUTS, TwinError, Vehicle
from twin.logs.map import LogMap
from twin.logs.text_file import encoding_of


def run(vehicle: str, map_path: Path | None, state: Path | None) -> int:
    """Observes standard input to its end; returns the exit status.

    Raises:
        TwinError: a file or a line is broken, a channel is missing, an input out of range, or the
            twin has blown up.
    """
    log_map = LogMap.load(map_path) if map_path else None
    car = Vehicle.load(vehicle)
    try:
        observe(car, _lines(sys.stdin), lambda line: print(line, flush=True), log_map, state)
    except BrokenPipeError:  # the reader has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def _lines(stdin: TextIO) -> TextIO:
    """Standard input in the encoding of its first bytes."""
    raw = getattr(stdin, "buffer", None)
    if not isinstance(raw, io.BufferedReader):
        return stdin
    return io.TextIOWrapper(raw, encoding=encoding_of(raw.peek(64)[:64]), errors="replace")


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
    stream, default, gaps = None, None, StreamGaps()
    reader = LineReader(log_map)
    for sample in reader.samples(lines):
        if stream is None or default is None:
            default, notes = _default_for(vehicle, sample)
            stream = Stream(default.observer, default.rolling_radius)
            if state and state.exists():
                stream.restore(state)
            for note in notes:
                print(f"til: {note}", file=report)
        inputs = {name: sample.get(name, 0.0 if name in ROAD else math.nan) for name in INPUTS}
        y = [sample.get(name, math.nan) for name in OUTPUTS]
        time, speed = sample.get("time", math.nan), sample.get("vx", math.nan)
        found = stream.update(time, list(inputs.values()), y, speed=speed)
        for sentence in gaps.take(time, inputs) if math.isfinite(time) else ():
            print(f"til: {sentence}", file=report)
        if found:
            missing = {"missing": list(gaps.missing)} if gaps.missing else {}
            write(json.dumps(told(found, stream, default) | missing))
    if stream is None:
        raise TwinError("standard input: has no samples; allowed: lines of JSON or CSV")
    if state:
        stream.save(state)
    for note in (*reader.notes(), *gaps.notes()):
        print(f"til: {note}", file=report)
    counts = ", ".join(f"{count} {name}" for name, count in stream.counts.items() if count)
    print(f"til: samples: {counts}", file=report)
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


def told(sample: Sample, stream: Stream, default: Default) -> dict[str, object]:
    """An estimate by its names, as JSON has it."""
    observer = stream.observer
    states = dict(zip(observer.twin.states, sample.states.tolist(), strict=True))
    found: dict[str, object] = {"time": round(sample.time, 9)}
    sd = observer.parameter_sd()
    for name in default.parameters:
        found[name] = float(sample.parameters[observer.twin.parameters.index(name)])
        if name in sd:
            found[f"{name}_sd"] = sd[name]
    found["sideslip"] = math.atan2(states["vy"], max(states["vx"], 1.0))
    found |= {name: states[name] for name in ("vx", "vy", "yaw_rate")}
    resting = [
        name
        for name, bound in default.largest.items()
        if abs(float(str(found[name]))) >= 0.999 * bound
    ]
    found["trustworthy"] = sample.trustworthy and not resting
    if resting:
        found["at_bound"] = resting
    if observer.rejected:
        found["rejected"] = list(observer.rejected)
    return found
