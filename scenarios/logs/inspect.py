"""What is in a log: channels, rates, gaps and units, and whether its signs can be right."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scenarios.logs.bus import inspect_bus
from scenarios.logs.checks import Check, checks
from scenarios.logs.columns import aligned
from scenarios.logs.findings import findings
from scenarios.logs.pieces import longest_stretch
from twin import Drive, Vehicle
from twin.car.signals import signals_of
from twin.logs import can
from twin.logs.can import is_bus_log
from twin.logs.drive import NoDrive
from twin.logs.formats import format_of
from twin.logs.map import LogMap
from twin.logs.raw_log import Channel, RawLog, Wanted
from twin.logs.resampling import gaps
from twin.logs.units import CHANNELS, our_unit


class Inspection(NamedTuple):
    """What is told of a log.

    Attributes:
        text: for people.
        map: a map to begin with, as TOML; empty if none is proposed.
    """

    text: str
    map: str = ""


def inspect_log(
    path: Path, map_path: Path | None, vehicle: str | None = None, database: Path | None = None
) -> Inspection:
    """What `til inspect` prints.

    Args:
        path: of the log.
        map_path: of its map; None: it is a drive of ours, or a raw CAN log.
        vehicle: name or file of the car, against which steering and torques are checked.
        database: of a raw CAN log's messages; None: the one that the map names.

    Raises:
        TwinError: the log, the map or the car cannot be read, or they do not fit.
    """
    if map_path is None and (database is not None or is_bus_log(path)):
        return Inspection(*inspect_bus(path, database, vehicle))
    car = Vehicle.load(vehicle) if vehicle else None
    if map_path is None:
        try:
            return Inspection(_of_drive(path, Drive.load(path), car))
        except NoDrive:
            log = format_of(path).read_log(path, Wanted())
        return Inspection(
            _channels(log)
            + "\n\nNo checks: the log is of another program, and a map (--map) tells its channels."
        )
    log_map = LogMap.load(map_path)
    if database is not None:
        log_map = replace(log_map, database=database)
    reader = can if log_map.database else format_of(path)
    log = reader.read_log(path, log_map.wanted)
    drive = Drive.of_log(log, log_map, signals_of(car) if car else None)
    done = "\n".join(f"  {line}" for line in drive.settings["log"]["done"])
    return Inspection(
        f"{_channels(log)}\n\nBy the map {map_path}:\n{done}\n\n{_checks(drive, car)}"
    )


def _of_drive(path: Path, drive: Drive, car: Vehicle | None) -> str:
    names = (*drive.input_names, *drive.output_names)
    channels = {
        name: Channel(
            time=drive.time,
            values=drive.channel(name),
            unit=our_unit(name) if name in CHANNELS else "",
        )
        for name in names
    }
    return f"{_channels(RawLog(path=path, channels=channels))}\n\n{_checks(drive, car)}"


def _channels(log: RawLog) -> str:
    header = ("channel", "unit", "rate [Hz]", "samples", "missing", "gaps", "longest gap [s]")
    rows = [(*header, "least", "median", "largest")]
    rows += [(name, *_row(channel)) for name, channel in log.channels.items()]
    rows += [(name, kind) for name, kind in log.text.items()]
    times = [channel.time for channel in log.channels.values()]
    start, end = min(t[0] for t in times), max(t[-1] for t in times)
    title = f"{log.path}: {len(log.channels)} channels from {start:.6g} to {end:.6g} s"
    if start > 1e6:  # since 1970, as a rule
        title += f", {end - start:.6g} s in all"
    return "\n".join([title, *log.notes, aligned(rows)])


def _row(channel: Channel) -> tuple[str, ...]:
    good = np.isfinite(channel.values)
    values, time = channel.values[good], channel.time[good]
    span = channel.time[-1] - channel.time[0]
    rate = f"{(channel.time.size - 1) / span:.5g}" if span > 0.0 else "-"
    found = gaps(time) if time.size > 1 else []
    longest = f"{max(length for _, length in found):.3g}" if found else "-"
    spread = (
        [f"{number(values):.4g}" for number in (np.min, np.median, np.max)] if good.any() else []
    )
    return (
        channel.unit or "?",
        rate,
        str(channel.time.size),
        str(int((~good).sum())),
        str(len(found)),
        longest,
        *spread,
    )


def _checks(drive: Drive, car: Vehicle | None) -> str:
    rows = [("check", "correlation", "slope", "unit", "lag [s]", "verdict")]
    longest = longest_stretch(drive)
    rows += [_shown(check) for check in checks(longest, car)]
    found = findings(longest, car)
    lines = [f"  {finding}" for finding in found] or ["  nothing that does not fit."]
    if car is None:
        lines.append("  Without --vehicle, torques and the steering's unit are not checked.")
    if len(longest) < len(drive):
        lines.append(
            f"  Looked at {longest.time[0]:.6g} to {longest.time[-1]:.6g} s, the longest time "
            "without a gap."
        )
    return "\n".join([aligned(rows), "", "Findings:", *lines])


def _shown(check: Check) -> tuple[str, ...]:
    numbers = (f"{check.correlation:.3f}", f"{check.slope:.4g}", f"{check.lag:.2f}")
    correlation, slope, lag = ("-" if text == "nan" else text for text in numbers)
    return (check.name, correlation, slope, check.unit, lag, check.verdict)
