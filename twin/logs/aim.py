"""Logs of AiM's loggers, .xrk and .xrz (packed), with a clock of milliseconds (extra `aim`).

The library that reads them wants a log with GPS messages, as every AiM logger with a receiver
writes; it prints what it does not know of a file, which is left out here.
"""

import io
import zlib
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import TwinError
from twin.logs.log_time import spread
from twin.logs.raw_log import LARGEST_FILE, Channel, RawLog, Wanted, check_file_size, check_time
from twin.toml_file import reason

_LARGEST_UNPACKED = LARGEST_FILE // 4  # bytes; the library copies them a few times


def read_log(path: Path, wanted: Wanted) -> RawLog:
    """A log of anybody, each channel with its own times.

    Args:
        path: the file.
        wanted: what the map asks; AiM's files have times of their own.

    Raises:
        TwinError: the file cannot be read, or the map names a column of time.
    """
    if any(given is not None for given in wanted.time):
        raise TwinError(
            f"{path}: AiM's logs have times of their own; allowed: a map without [time]"
        )
    check_file_size(path)
    try:
        from libxrk import ChannelMetadata, aim_xrk
    except ImportError as error:
        raise TwinError(
            f"{path}: AiM's logs need libxrk: pip install 'twin-in-the-loop[aim]'"
        ) from error
    try:
        content = _unpacked(path)
        with redirect_stdout(io.StringIO()), np.errstate(all="ignore"):
            tables = aim_xrk(content).channels
    except TwinError:
        raise
    except ValueError as error:
        if "NULL pointer" in str(error):
            raise TwinError(
                f"{path}: has no GPS messages or no channels, so the library cannot read it; "
                f"allowed: a log with GPS, or an export as CSV"
            ) from error
        raise TwinError(f"{path}: cannot be read as AiM's log: {reason(error)[:200]}") from error
    except Exception as error:  # of every kind: the library raises what its parts do
        raise TwinError(f"{path}: cannot be read as AiM's log: {reason(error)[:200]}") from error
    channels: dict[str, Channel] = {}
    text: dict[str, str] = {}
    notes: list[str] = []
    for name, table in tables.items():
        unit = ChannelMetadata.from_channel_table(table).units
        values = np.asarray(table.column(name).to_numpy(), dtype=np.float64)
        if values.size < 2:
            text[name] = "it has one sample"
            continue
        channels[name] = _channel(path, name, table.column("timecodes"), values, unit, notes)
    if not channels:
        raise TwinError(
            f"{path}: has no numeric channels; allowed: channels of two samples or more"
        )
    return RawLog(path=path, channels=channels, text=text, notes=tuple(notes))


def _unpacked(path: Path) -> bytes:
    """The bytes of a log; of a packed one no more than fit."""
    body = path.read_bytes()
    if body[:1] == b"\x78":
        body = zlib.decompressobj().decompress(body, _LARGEST_UNPACKED + 1)
    if len(body) > _LARGEST_UNPACKED:
        raise TwinError(f"{path}: has over {_LARGEST_UNPACKED:,} bytes; allowed: a shorter log")
    return body


def _channel(
    path: Path, name: str, stamps: Any, values: np.ndarray, unit: str, notes: list[str]
) -> Channel:
    """One channel with its times in s; sentences go to the notes."""
    time = 1e-3 * stamps.to_numpy().astype(np.float64)
    check_time(path, f"time of {name[:40]!r}", time)
    time, about = spread(time)
    notes += [f"{name}: {sentence}" for sentence in about]
    return Channel(time=time, values=values, unit=unit)


def read_columns(path: Path) -> tuple[dict[str, Any], str | None]:
    """Nothing: a drive of ours is not kept as AiM's log."""
    check_file_size(path)
    return {}, None


def write(path: Path, columns: dict[str, Any], metadata: str) -> None:
    """Refuses: a drive of ours is not kept as AiM's log."""
    raise TwinError(f"{path}: drives are not written as AiM's logs; allowed: Parquet, CSV, MDF 4")
