"""What is on a bus: messages, rates and gaps, signals by a database, and a map to begin with."""

import tomllib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scenarios.logs.columns import aligned
from scenarios.logs.proposal import Proposal, propose
from scenarios.logs.proposed_line import Seen
from twin import Drive, TwinError, Vehicle
from twin.car.signals import signals_of
from twin.logs.can import Bus, Frames, decoded, read_bus
from twin.logs.can_signals import Database, Message
from twin.logs.map import LogMap
from twin.logs.raw_log import Channel, RawLog, listed

_EXTENDED = 1 << 31
_MOST = 400  # identifiers that are shown; a hostile log has millions


class BusReport(NamedTuple):
    """What is told of a bus.

    Attributes:
        text: messages, signals and what is odd.
        map: proposed, as TOML; empty if nothing is known of any signal.
    """

    text: str
    map: str


def inspect_bus(path: Path, database_path: Path | None, vehicle: str | None) -> BusReport:
    """Messages and signals of a raw CAN log, and a map to begin with.

    Args:
        path: of the log.
        database_path: of its messages; None: only identifiers are told.
        vehicle: name or file of the car, which says what its signals mean; None: unknown.

    Raises:
        TwinError: the log, the database or the car cannot be read.
    """
    database = Database.load(database_path) if database_path else None
    car = signals_of(Vehicle.load(vehicle)) if vehicle else None
    bus = read_bus(path)
    parts = [_messages(path, bus, database)]
    if database is None:
        parts.append("No signals: the log is of frames, and a database (--dbc) tells them.")
        return BusReport("\n\n".join(parts), "")
    channels, short = decoded(bus, database)
    found = propose(_seen(database, channels), str(database_path), car)
    parts.append(_signals(database, channels, found))
    notes = [*database.notes]
    notes += [f"{name}: {count} frames are too short and left out." for name, count in short]
    notes += _not_there(bus, database)
    parts.append("\n".join(notes))
    if found is None:
        parts.append("No map is proposed: no signal has a name and unit that are known here.")
        return BusReport("\n\n".join(p for p in parts if p), "")
    parts.append(_tried(path, channels, found, vehicle))
    return BusReport("\n\n".join(p for p in parts if p), found.text)


def _messages(path: Path, bus: Bus, database: Database | None) -> str:
    header = ("id", "message", "bytes", "frames", "rate [Hz]", "longest gap [s]", "first", "last")
    known = database.messages if database else {}
    order = sorted(bus.frames, key=lambda i: (i not in known, i))
    rows = [header, *(_row(i, bus.frames[i], known.get(i), database) for i in order[:_MOST])]
    times = [(float(f.time[0]), float(f.time[-1])) for f in bus.frames.values() if f.time.size]
    start, end = min(t[0] for t in times), max(t[1] for t in times)
    total = sum(f.time.size for f in bus.frames.values())
    lines = [f"{path}: {total} frames of {len(order)} messages in {end - start:.6g} s"]
    if bus.without_data:
        lines.append(f"{bus.without_data} error and remote frames are left out.")
    lines.append(aligned(rows))
    if len(order) > _MOST:
        lines.append(f"... and {len(order) - _MOST} more identifiers")
    return "\n".join(lines)


def _row(
    identifier: int, frames: Frames, message: Message | None, database: Database | None
) -> tuple[str, ...]:
    time = frames.time
    span = float(time[-1] - time[0]) if time.size else 0.0
    least, most = int(frames.length.min()), int(frames.length.max())
    absent = "not in the database" if database else "?"
    return (
        shown(identifier),
        message.name if message else absent,
        f"{most}" if least == most else f"{least}-{most}",
        str(time.size),
        f"{(time.size - 1) / span:.4g}" if span > 0.0 else "-",
        f"{float(np.diff(time).max()):.3g}" if time.size > 1 else "-",
        f"{time[0]:.6g}" if time.size else "-",
        f"{time[-1]:.6g}" if time.size else "-",
    )


def shown(identifier: int) -> str:
    """An identifier as a person reads it; of 29 bits with x behind it, as candump has it."""
    return f"{identifier & ~_EXTENDED:#x}" + ("x" if identifier & _EXTENDED else "")


def _signals(database: Database, channels: dict[str, Channel], found: Proposal | None) -> str:
    header = ("signal", "unit", "samples", "least", "median", "largest", "may be")
    rows: list[tuple[str, ...]] = [header]
    meanings = found.meanings if found else {}
    for name, channel in channels.items():
        low, middle, high = (float(f(channel.values)) for f in (np.min, np.median, np.max))
        numbers = tuple(f"{number:.4g}" for number in (low, middle, high))
        unit = "".join(c for c in channel.unit if c.isprintable()) or "?"
        rows.append((name, unit, str(channel.values.size), *numbers, meanings.get(name, "")))
    return aligned(rows) if channels else f"No signal of {database.path.name} occurs twice."


def _not_there(bus: Bus, database: Database) -> list[str]:
    unknown = [i for i in bus.frames if i not in database.messages]
    notes = []
    if unknown:
        count = sum(bus.frames[i].time.size for i in unknown)
        ids = listed([shown(i) for i in sorted(unknown)])
        notes.append(f"{count} frames are not in the database: {ids}.")
    absent = [m.name for i, m in database.messages.items() if i not in bus.frames]
    if absent:
        notes.append(f"In the database, but not on the bus: {listed(absent)}.")
    return notes


def _seen(database: Database, channels: dict[str, Channel]) -> list[Seen]:
    return [
        Seen(
            message.name,
            signal.name,
            len(signal.bits),
            channels[f"{message.name}.{signal.name}"],
            [s.name for s in message.signals if s.name != signal.name],
        )
        for message in database.messages.values()
        for signal in message.signals
        if f"{message.name}.{signal.name}" in channels
    ]


def _tried(path: Path, channels: dict[str, Channel], found: Proposal, vehicle: str | None) -> str:
    """What becomes of the log by the proposed map."""
    begin = "A map by names and units, to be checked line by line. "
    if found.missing:
        return f"{begin}It is not complete: no signal for {'; '.join(found.missing)}."
    try:
        log_map = LogMap.of(tomllib.loads(found.text))
        car = signals_of(Vehicle.load(vehicle)) if vehicle else None
        drive = Drive.of_log(RawLog(path=path, channels=channels), log_map, car)
    except TwinError as error:
        return f"{begin}Not accepted yet: {error}"
    seconds = drive.time[-1] - drive.time[0]
    with_car = f" --vehicle {vehicle}" if vehicle else ""
    return (
        f"{begin}Tried: it gives a drive of {seconds:.6g} s. Save it, then check signs, units and "
        f"delays with\n  til inspect {path} --map map.toml{with_car}"
    )
