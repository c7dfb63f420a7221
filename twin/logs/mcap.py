"""Logs in MCAP, as ROS 2 and others record them (extra `ros`); no ROS is needed.

A channel's name is its topic and the field of its message: `/vehicle/imu.linear_acceleration.x`,
`/wheels.velocity[0]`. Time is that of the message's header, where it has one, else when the message
was recorded.
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import TwinError
from twin.logs.log_time import spread
from twin.logs.raw_log import (
    Channel,
    RawLog,
    Wanted,
    check_file_size,
    check_size,
    check_time,
)
from twin.toml_file import reason

_LARGEST_CHUNK = 2**28  # bytes, unpacked
_MOST_OF_AN_ARRAY = 64  # entries of an array in a message that become channels
_DEEPEST = 8  # fields within fields


def read_log(path: Path, wanted: Wanted) -> RawLog:
    """A log of anybody, each channel with the times of its topic.

    Raises:
        TwinError: the file cannot be read, or the map names a column of time.
    """
    if any(given is not None for given in wanted.time):
        raise TwinError(f"{path}: MCAP has times of its own; allowed: a map without [time]")
    check_file_size(path)
    series: dict[str, _Topic] = {}
    text: dict[str, str] = {}
    try:
        with path.open("rb") as file:
            _check_chunks(path, file)
            file.seek(0)
            for topic, stamp, message in _messages(path, file, wanted.names, text):
                series.setdefault(topic, _Topic()).add(path, stamp, message)
    except TwinError:
        raise
    except ImportError as error:
        raise TwinError(
            f"{path}: MCAP needs mcap and mcap-ros2-support: pip install 'twin-in-the-loop[ros]'"
        ) from error
    except Exception as error:  # of every kind: the library raises what its parts do
        raise TwinError(f"{path}: cannot be read as MCAP: {reason(error)[:200]}") from error
    channels: dict[str, Channel] = {}
    notes: dict[str, None] = {}
    for topic, found in series.items():
        channels |= found.channels(path, topic, notes)
    if not channels:
        raise TwinError(f"{path}: has no numeric channels; allowed: messages with numbers")
    return RawLog(path=path, channels=channels, text=text, notes=tuple(notes))


class _Topic:
    """The messages of a topic, as they are read."""

    def __init__(self) -> None:
        self.recorded: list[float] = []
        self.stamps: list[float] = []
        self.fields: dict[str, list[float]] = {}
        self.size = 0

    def add(self, path: Path, recorded: float, message: Any) -> None:
        self.recorded.append(recorded)
        self.stamps.append(_stamp(message))
        before = len(self.recorded) - 1
        for name, value in _numbers(message, "", 0):
            values = self.fields.setdefault(name, [])
            values += [np.nan] * (before - len(values))
            values.append(value)
            self.size += 1
        check_size(path, 4 * self.size, "has")  # a list takes more than an array

    def channels(self, path: Path, topic: str, notes: dict[str, None]) -> dict[str, Channel]:
        """Channels by topic and field; sentences go to the notes."""
        if len(self.recorded) < 2:
            return {}
        time = np.array(self.stamps)
        if not (np.isfinite(time).all() and np.ptp(time) > 0.0):
            time = np.array(self.recorded)
            notes[f"{topic}: times are those of recording, as the messages have none."] = None
        order = np.argsort(time, kind="stable")
        if (np.diff(order) < 0).any():
            notes[f"{topic}: messages are put in the order of their times."] = None
        check_time(path, f"time of {topic[:40]!r}", time[order])
        spaced, about = spread(time[order])
        notes |= dict.fromkeys(f"{topic}: {sentence}" for sentence in about)
        result = {}
        for name, values in self.fields.items():
            values += [np.nan] * (time.size - len(values))
            result[topic + name] = Channel(time=spaced, values=np.array(values)[order])
        return result


def _check_chunks(path: Path, file: Any) -> None:
    """Refuses chunks that unpack to more than fits, or to more than they declare."""
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader

    total = 0
    for record in StreamReader(file, emit_chunks=True, record_size_limit=_LARGEST_CHUNK).records:
        if not isinstance(record, Chunk):
            continue
        total += record.uncompressed_size
        if record.uncompressed_size > _LARGEST_CHUNK:
            raise TwinError(
                f"{path}: a chunk declares {record.uncompressed_size:,} bytes; allowed: "
                f"{_LARGEST_CHUNK:,}"
            )
        check_size(path, total // 64, "declares")
        if record.compression == "lz4":
            import lz4.frame

            unpacker = lz4.frame.LZ4FrameDecompressor()
            found = len(unpacker.decompress(record.data, max_length=record.uncompressed_size + 1))
            if found > record.uncompressed_size:
                raise TwinError(f"{path}: a chunk unpacks to more bytes than it declares")


def _messages(
    path: Path, file: Any, names: frozenset[str], text: dict[str, str]
) -> Iterator[tuple[str, float, Any]]:
    """Topic, time of recording [s] and content of the messages whose topics are wanted."""
    from mcap.reader import make_reader

    decoders: dict[int, Callable[[bytes], Any] | None] = {}
    reader = make_reader(file)
    for schema, channel, message in reader.iter_messages():
        if channel.id not in decoders:
            decoders[channel.id] = _decoder(schema, channel, names, text)
        decode = decoders[channel.id]
        if decode is not None:
            yield channel.topic, 1e-9 * message.log_time, decode(message.data)


def _decoder(
    schema: Any, channel: Any, names: frozenset[str], text: dict[str, str]
) -> Callable[[bytes], Any] | None:
    """What makes numbers of a channel's messages; None if they are not wanted or not known."""
    topic = channel.topic
    if names and not any(name.startswith(topic) for name in names):
        text[topic] = "a topic that is not mapped"
        return None
    if channel.message_encoding == "json":
        return json.loads
    from mcap_ros2.decoder import DecoderFactory

    decode = DecoderFactory().decoder_for(channel.message_encoding, schema)
    if decode is None:
        encoding = f"{channel.message_encoding}, {schema.encoding if schema else 'no schema'}"
        text[topic] = f"messages of another kind: {encoding[:40]}"
    return decode


def _stamp(message: Any) -> float:
    """The time in a message's header [s]; NaN if it has none."""
    stamp = _field(_field(message, "header"), "stamp")
    seconds = _field(stamp, "sec")
    nanoseconds = _field(stamp, "nanosec")
    if not isinstance(seconds, int | float) or seconds <= 0:
        return np.nan
    return float(seconds) + 1e-9 * float(nanoseconds or 0)


def _field(message: Any, name: str) -> Any:
    return message.get(name) if isinstance(message, dict) else getattr(message, name, None)


def _numbers(message: Any, name: str, depth: int) -> Iterator[tuple[str, float]]:
    """Names and values of all numbers in a message."""
    if isinstance(message, bool | int | float | np.number):
        yield name, float(message)
    elif isinstance(message, str | bytes) or depth > _DEEPEST:
        return
    elif isinstance(message, dict):
        for key, value in message.items():
            yield from _numbers(value, f"{name}.{key}", depth + 1)
    elif hasattr(message, "__slots__") and not hasattr(message, "__len__"):
        for key in message.__slots__:
            yield from _numbers(getattr(message, key), f"{name}.{key}", depth + 1)
    elif hasattr(message, "__len__") and len(message) <= _MOST_OF_AN_ARRAY:
        for place, value in enumerate(message):
            yield from _numbers(value, f"{name}[{place}]", depth + 1)


def read_columns(path: Path) -> tuple[dict[str, Any], str | None]:
    """Nothing: a drive of ours is not kept as MCAP."""
    check_file_size(path)
    return {}, None


def write(path: Path, columns: dict[str, Any], metadata: str) -> None:
    """Refuses: a drive of ours is not kept as MCAP."""
    raise TwinError(f"{path}: drives are not written as MCAP; allowed: Parquet, CSV, MDF 4")
