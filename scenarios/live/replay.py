"""`til replay`: a log onto a bus, in real time or faster, so that all can be tried on a desk."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import models
from scenarios.live.bus import EXTENDED, Bus
from twin import Drive, TwinError, Vehicle
from twin.car.signals import signals_of
from twin.logs.can import FORMATS, read_bus
from twin.logs.drive import NoDrive
from twin.logs.map import LogMap, Source, unit_in_si
from twin.toml_file import reason

_CYCLE = 0.01  # [s] of a message whose database gives none
Frame = tuple[float, int, bytes]  # time [s], identifier, payload


@dataclass(frozen=True, slots=True, kw_only=True)
class Replay:
    """What `til replay` is asked for.

    Attributes:
        log: a raw CAN log, or a drive.
        interface, channel, options: of python-can.
        map: of the bus: what its signals are; None: the log is one of frames.
        database: of the bus; None: the one that the map names.
        log_map: of the log; None: it is a drive of ours.
        vehicle: whose file says what a log's signals mean; None: none is needed.
        rate: of each message [Hz]; None: as the database says.
        speed: how much faster than the clock.
        jitter: frames are sent up to so much earlier or later [s].
        loss: share of the frames that is lost.
        seed: of jitter and loss.
    """

    log: Path
    interface: str
    channel: str
    options: dict[str, Any] = field(default_factory=dict)
    map: Path | None = None
    database: Path | None = None
    log_map: Path | None = None
    vehicle: str | None = None
    rate: float | None = None
    speed: float = 1.0
    jitter: float = 0.0
    loss: float = 0.0
    seed: int = 0


def run(replay: Replay, say: Callable[[str], object]) -> int:
    """Plays a log; returns how many frames were sent.

    Raises:
        TwinError: the log, the map or the database cannot be read, or the bus cannot be opened.
    """
    frames = disturb(frames_of(replay), replay)
    bus = Bus(replay.interface, replay.channel, replay.options, say)
    say(f"plays {len(frames)} frames, {frames[-1][0] - frames[0][0]:.1f} s" if frames else "")
    sent, worst = 0, 0.0
    start, first = time.monotonic(), frames[0][0] if frames else 0.0
    try:
        for at, identifier, data in frames:
            wait = start + (at - first) / replay.speed - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            worst = max(worst, -wait)
            sent += bus.send(identifier, data)
    finally:
        bus.close()
    say(f"{sent} frames sent, at most {1e3 * worst:.1f} ms late")
    return sent


def frames_of(replay: Replay) -> list[Frame]:
    """The frames of a log in the order of time.

    Raises:
        TwinError: see `run`.
    """
    log = replay.log
    if replay.map is None and log.suffix.lower() in FORMATS:
        bus = read_bus(log)
        found = [
            (float(t), identifier, row[:n].tobytes())
            for identifier, of_one in bus.frames.items()
            for t, row, n in zip(of_one.time, of_one.payload, of_one.length, strict=True)
        ]
        return sorted(found, key=lambda frame: frame[0])
    if replay.map is None:
        raise TwinError(f"{log}: is no log of frames; allowed: with --map, the map of the bus")
    car = signals_of(Vehicle.load(replay.vehicle)) if replay.vehicle else None
    try:
        drive = Drive.load(log, replay.log_map, car)
    except NoDrive as error:
        raise TwinError(f"{log}: is no drive of ours; allowed: with --log-map") from error
    bus_map = LogMap.load(models.path(str(replay.map)))
    database = replay.database or bus_map.database
    if database is None:
        raise TwinError(f"{bus_map.path}: names no database; allowed: [can] in it, or --dbc")
    return sorted(
        _encoded(drive, bus_map, models.path(str(database)), replay.rate),
        key=lambda frame: frame[0],
    )


def _encoded(drive: Drive, bus_map: LogMap, path: Path, rate: float | None) -> Iterator[Frame]:
    """A drive as frames: each message at its own rate and phase."""
    try:
        import cantools  # an extra

        database: Any = cantools.database.load_file(str(path), strict=False)  # pyright: ignore[reportAttributeAccessIssue]
    except ImportError as error:
        raise TwinError("a CAN bus needs the extra can: pip install -e '.[can]'") from error
    except Exception as error:  # whatever cantools raises
        raise TwinError(f"{path}: cannot be read as database: {reason(error)[:200]}") from error
    sources = {source.name: (name, source) for name, source in bus_map.channels.items()}
    has = {*drive.input_names, *drive.output_names}
    messages = [
        m for m in database.messages if any(f"{m.name}.{s.name}" in sources for s in m.signals)
    ]
    for k, message in enumerate(messages):
        mapped = {
            s.name: sources[f"{message.name}.{s.name}"]
            for s in message.signals
            if f"{message.name}.{s.name}" in sources
        }
        mapped = {name: entry for name, entry in mapped.items() if entry[0] in has}
        if not mapped:
            continue
        if message.is_multiplexed():
            raise TwinError(f"{path}: {message.name} is multiplexed; allowed: none in a replay")
        cycle = 1.0 / rate if rate else (message.cycle_time or 1e3 * _CYCLE) * 1e-3
        at = np.arange(drive.time[0] + cycle * k / len(messages), drive.time[-1], cycle)
        columns = {s.name: np.full(at.size, float(s.offset or 0.0)) for s in message.signals}
        for signal in message.signals:
            if signal.name in mapped:
                name, source = mapped[signal.name]
                values = np.interp(at, drive.time, drive.channel(name))
                columns[signal.name] = _of_bus(values, name, source, signal, bus_map)
        identifier = message.frame_id | (EXTENDED if message.is_extended_frame else 0)
        for row, t in enumerate(at):
            values = {name: float(column[row]) for name, column in columns.items()}
            if all(np.isfinite(value) for value in values.values()):
                yield float(t), identifier, bytes(message.encode(values, strict=False))


def _of_bus(values: Any, name: str, source: Source, signal: Any, bus_map: LogMap) -> Any:
    """Our numbers as the bus has them, within what the signal can carry."""
    unit = source.unit or signal.unit
    if not unit:
        raise TwinError(f"{bus_map.path}: channels.{name}.unit is missing; allowed: name it")
    scale = source.sign * unit_in_si(name, unit, source.radius) * source.factor
    size = signal.length - (1 if signal.is_signed else 0)
    least, most = (-(2**size) if signal.is_signed else 0), 2**size - 1
    ends = sorted(signal.scale * end + signal.offset for end in (least, most))
    found = values / scale + source.offset
    return found if signal.is_float else np.clip(found, *ends)


def disturb(frames: list[Frame], replay: Replay) -> list[Frame]:
    """Frames with jitter, some of them lost; those of one message keep their order."""
    rng = np.random.default_rng(replay.seed)
    kept = rng.random(len(frames)) >= replay.loss
    shift = rng.uniform(-replay.jitter, replay.jitter, len(frames)) if replay.jitter else None
    moved = [
        (frame[0] + (float(shift[k]) if shift is not None else 0.0), *frame[1:])
        for k, frame in enumerate(frames)
        if kept[k]
    ]
    return sorted(moved, key=lambda frame: frame[0])
