"""A drive: what a vehicle was given and what its sensors showed, simulated or recorded."""

import dataclasses
import json
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import TwinError
from twin.logs.car_signals import CarSignals
from twin.logs.formats import format_of
from twin.logs.frames import columns_of, frame_of, log_of_frame
from twin.logs.input_gaps import mended
from twin.logs.map import LogMap
from twin.logs.mapped_log import by_map, read_by_map
from twin.logs.raw_log import RawLog
from twin.toml_file import reason

FORMAT_VERSION = 1
# Samples count as uniform when no step differs by more than this from the mean one, relatively.
_UNIFORMITY = 1e-6
_SLOWEST = 1.0  # [m/s]; below it sideslip is computed as at this speed, as its angle means nothing


class NoDrive(TwinError):
    """A file that is sound but another program's log."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """Inputs and measurements over time, and the truth that only scoring touches.

    The arrays are copied and made read-only. A simulated drive and a recorded log differ only in
    the truth, which is empty for the latter.

    Attributes:
        time: (N,) strictly increasing [s], at least two samples.
        inputs: (N, nu) finite, C-contiguous.
        input_names: nu names, as in `twin.channels.INPUTS`.
        measurements: (N, ny) C-contiguous; NaN where a channel is missing.
        output_names: ny names, as in `twin.channels.OUTPUTS`; a log may carry `FURTHER_OUTPUTS`
            behind them.
        truth: of each name (N,), also of what is constant in time; NaN where it is not known.
        settings: what made the drive (scenario, seed, snr, versions, ...), kept as JSON keeps it.

    Raises:
        TwinError: a shape, a name or a value is not as above.
    """

    time: NDArray[np.float64]
    inputs: NDArray[np.float64]
    input_names: tuple[str, ...]
    measurements: NDArray[np.float64]
    output_names: tuple[str, ...]
    truth: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        time = _frozen("time", self.time)
        inputs = _frozen("inputs", self.inputs)
        measurements = _frozen("measurements", self.measurements)
        input_names, output_names = tuple(self.input_names), tuple(self.output_names)
        _check_time(time)
        _check_names((*input_names, *output_names))
        _check_shape("inputs", inputs, (time.size, len(input_names)))
        _check_shape("measurements", measurements, (time.size, len(output_names)))
        _check_finite(inputs, input_names)
        truth = {name: _frozen(f"truth {name}", values) for name, values in self.truth.items()}
        for name, values in truth.items():
            _check_shape(f"truth {name}", values, (time.size,))
        for name, value in (
            ("time", time),
            ("inputs", inputs),
            ("input_names", input_names),
            ("measurements", measurements),
            ("output_names", output_names),
            ("truth", truth),
            ("settings", _as_json_keeps_it(self.settings)),
        ):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        """Number of samples."""
        return self.time.size

    @property
    def duration(self) -> float:
        """From the first sample to the last [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def dt(self) -> float:
        """Sample time [s].

        Raises:
            TwinError: the samples are not uniform in time.
        """
        mean = self.duration / (len(self) - 1)
        steps = np.diff(self.time)
        rounding = 2.0 * np.spacing(np.abs(self.time).max())
        if np.abs(steps - mean).max() > _UNIFORMITY * mean + rounding:
            raise TwinError(
                f"drive: time has steps of {steps.min():.6g} to {steps.max():.6g} s, "
                "must be uniform: resample it"
            )
        return mean

    def channel(self, name: str) -> NDArray[np.float64]:
        """The (N,) column of an input or a measurement.

        Raises:
            TwinError: there is no channel of that name.
        """
        if name in self.input_names:
            return self.inputs[:, self.input_names.index(name)]
        if name in self.output_names:
            return self.measurements[:, self.output_names.index(name)]
        names = ", ".join((*self.input_names, *self.output_names))
        raise TwinError(f"drive: has no channel {name!r}, only {names}")

    @property
    def sideslip(self) -> NDArray[np.float64]:
        """(N,) sideslip angle [rad]: the truth's, else the measured one; NaN where none is."""
        measured = dict(zip(self.output_names, self.measurements.T, strict=True))
        for known in (self.truth, measured):
            if "sideslip" in known:
                return known["sideslip"]
            if "vx" in known and "vy" in known:
                return np.arctan2(known["vy"], np.maximum(known["vx"], _SLOWEST))
        return np.full(len(self), np.nan)

    def __getitem__(self, samples: slice) -> Self:
        """The drive of some samples, as in `drive[1000:5000]`; with a step, of every so many.

        Raises:
            TwinError: it is no slice, or fewer than two samples are left.
        """
        if not isinstance(samples, slice) or (samples.step or 1) < 1:
            raise TwinError(f"drive: samples are {samples!r}; allowed: a slice that rises")
        return self.replace(
            time=self.time[samples],
            inputs=self.inputs[samples],
            measurements=self.measurements[samples],
            truth={name: values[samples] for name, values in self.truth.items()},
        )

    def between(self, first: float, last: float) -> Self:
        """The drive from one time to another [s], both included.

        Raises:
            TwinError: fewer than two samples are left.
        """
        start, end = np.searchsorted(self.time, [first, last], side="left")
        end += int(end < len(self) and self.time[end] == last)
        if end - start < 2:
            raise TwinError(
                f"drive: has no two samples from {first:g} to {last:g} s; allowed: times from "
                f"{self.time[0]:g} to {self.time[-1]:g} s"
            )
        return self[start:end]

    @classmethod
    def joined(cls, drives: Sequence["Drive"]) -> "Drive":
        """Drives of the same channels, one behind the other; the settings are the first one's.

        Truth that one of them lacks is NaN there.

        Raises:
            TwinError: their channels differ, or one begins before the other ends.
        """
        if not drives:
            raise TwinError("drive: there is nothing to join; allowed: at least one drive")
        first = drives[0]
        for drive in drives[1:]:
            if (drive.input_names, drive.output_names) != (first.input_names, first.output_names):
                raise TwinError(
                    f"drive: channels {(*drive.input_names, *drive.output_names)} cannot be joined "
                    f"to {(*first.input_names, *first.output_names)}; allowed: the same ones"
                )
        truth = dict.fromkeys(name for drive in drives for name in drive.truth)
        return first.replace(
            time=np.concatenate([drive.time for drive in drives]),
            inputs=np.concatenate([drive.inputs for drive in drives]),
            measurements=np.concatenate([drive.measurements for drive in drives]),
            truth={
                name: np.concatenate(
                    [drive.truth.get(name, np.full(len(drive), np.nan)) for drive in drives]
                )
                for name in truth
            },
        )

    def replace(self, **changes: Any) -> Self:
        """A copy with some attributes changed, checked like a new one."""
        return dataclasses.replace(self, **changes)

    def save(self, path: str | Path) -> None:
        """Writes the drive as Parquet, CSV or MDF 4 (by the name's ending), whole or not at all.

        Columns are time, input.<name>, measurement.<name> and truth.<name>; settings and the
        version of the format are JSON in the file's metadata, in CSV its first line.

        Raises:
            TwinError: the file cannot be written, or its ending is unknown.
        """
        path = Path(path)
        metadata = json.dumps({"version": FORMAT_VERSION, "settings": self.settings})
        write = format_of(path).write
        partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
        try:
            write(partial, dict(self._columns()), metadata)
            partial.replace(path)
        except OSError as error:
            raise TwinError(f"{path}: cannot be written: {reason(error)}") from error
        finally:
            partial.unlink(missing_ok=True)

    @classmethod
    def load(
        cls, path: str | Path, map: str | Path | None = None, car: CarSignals | None = None
    ) -> "Drive":
        """Reads what `save` wrote, to the bit, or a log of anybody by its map.

        Gaps in inputs are bridged or cut out, see `twin.logs.input_gaps`.

        Args:
            path: the file.
            map: a TOML file, see `twin.logs.map`; `twin.logs.mapped_log` says what comes of it.
            car: what the car makes of its signals (`Vehicle.signals`), for a log by its map.

        Raises:
            NoDrive: the file is another program's log, and there is no map.
            TwinError: the file is missing or broken.
        """
        path = Path(path)
        if map is not None:
            return cls(**read_by_map(path, map, car))
        columns, metadata = format_of(path).read_columns(path)
        if metadata is None:
            raise NoDrive(
                f"{path}: is {path.suffix[1:].capitalize()}, but no drive: it has no metadata "
                "'twin_drive'; a log of another program needs a map"
            )
        try:
            return cls(**mended(_sorted_out(columns), _settings(metadata)))
        except TwinError as error:
            raise TwinError(f"{path}: {error}") from error

    @classmethod
    def of_log(cls, log: RawLog, log_map: LogMap, car: CarSignals | None = None) -> "Drive":
        """A drive from a log that was read.

        Args:
            log: its channels.
            log_map: what they are.
            car: what the car makes of its signals.

        Raises:
            TwinError: they do not fit.
        """
        return cls(**by_map(log, log_map, car))

    @classmethod
    def from_frame(cls, frame: Any, map: "str | Path | Mapping[str, Any] | None" = None) -> "Drive":
        """A drive from a table of Python, by a map as a file would be.

        Args:
            frame: a frame of pandas (its index may be the time) or polars, a Dataset of xarray, a
                table of Arrow, a structured array of NumPy, or a dict of arrays.
            map: a TOML file, see `twin.logs.map`, or its content as a dict; None: the frame is one
                that `to_frame` made.

        Raises:
            TwinError: the frame or the map is broken, or they do not fit.
        """
        if map is not None:
            log_map = LogMap.of(map) if isinstance(map, Mapping) else LogMap.load(map)
            return cls.of_log(log_of_frame(frame, log_map.wanted.time), log_map)
        columns, metadata = columns_of(frame)
        settings = _settings(metadata) if metadata else {}
        return cls(**mended(_sorted_out(columns), settings))

    def to_frame(self, kind: str = "pandas") -> Any:
        """The drive as a table: columns as in a file (`measurement.ax`), the time as the index.

        Args:
            kind: "pandas", "polars", "xarray", "arrow" or "numpy".

        Raises:
            TwinError: there is no such kind, or its library is not installed.
        """
        metadata = json.dumps({"version": FORMAT_VERSION, "settings": self.settings})
        return frame_of(dict(self._columns()), metadata, kind)

    def _columns(self) -> Iterator[tuple[str, NDArray[np.float64]]]:
        yield "time", self.time
        for name in self.input_names:
            yield f"input.{name}", self.channel(name)
        for name in self.output_names:
            yield f"measurement.{name}", self.channel(name)
        for name, values in self.truth.items():
            yield f"truth.{name}", values


def _frozen(name: str, values: ArrayLike) -> NDArray[np.float64]:
    try:
        array = np.array(values, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise TwinError(f"drive: {name} must be an array of numbers: {error}") from error
    array.setflags(write=False)
    return array


def _check_time(time: NDArray[np.float64]) -> None:
    if time.ndim != 1 or time.size < 2:
        raise TwinError(f"drive: time has shape {time.shape}, must be (N,) with N at least 2")
    if not np.isfinite(time).all():
        raise TwinError("drive: time must be finite")
    steps = np.diff(time)
    if steps.min() <= 0.0:
        first = int(np.argmax(steps <= 0.0))
        raise TwinError(
            f"drive: time goes from {time[first]:g} to {time[first + 1]:g} s at sample "
            f"{first + 1}, must be strictly increasing"
        )


def _check_names(names: tuple[str, ...]) -> None:
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise TwinError(f"drive: channel {repeated[0]!r} occurs twice, names must be unique")


def _check_shape(name: str, array: NDArray[np.float64], shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise TwinError(f"drive: {name} has shape {array.shape}, must be {shape}")


def _check_finite(inputs: NDArray[np.float64], names: tuple[str, ...]) -> None:
    finite = np.isfinite(inputs)
    if finite.all():
        return
    sample, column = np.argwhere(~finite)[0]
    raise TwinError(
        f"drive: input {names[column]} is {inputs[sample, column]} at sample {sample}, "
        "must be finite"
    )


def _as_json_keeps_it(settings: Mapping[str, Any]) -> dict[str, Any]:
    try:
        return json.loads(json.dumps(dict(settings)))
    except (TypeError, ValueError) as error:
        raise TwinError(f"drive: settings must be fit for JSON: {error}") from error


def _settings(metadata: str) -> dict[str, Any]:
    try:
        content = json.loads(metadata)
        version, settings = content["version"], content["settings"]
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise TwinError("metadata 'twin_drive' must be JSON with version and settings") from error
    if version != FORMAT_VERSION:
        raise TwinError(f"is a drive of format {version!r}, must be {FORMAT_VERSION}")
    return settings


def _sorted_out(columns: dict[str, NDArray[np.float64]]) -> dict[str, Any]:
    if "time" not in columns:
        raise TwinError("has no column time")
    time = columns.pop("time")
    groups: dict[str, dict[str, NDArray[np.float64]]] = {
        "input": {},
        "measurement": {},
        "truth": {},
    }
    for column, values in columns.items():
        group, _, name = column.partition(".")
        if group not in groups or not name:
            raise TwinError(f"column {column} is unknown, only time and {', '.join(groups)}.<name>")
        groups[group][name] = values
    return {
        "time": time,
        "inputs": _matrix(groups["input"], time.size),
        "input_names": tuple(groups["input"]),
        "measurements": _matrix(groups["measurement"], time.size),
        "output_names": tuple(groups["measurement"]),
        "truth": groups["truth"],
    }


def _matrix(columns: dict[str, NDArray[np.float64]], samples: int) -> NDArray[np.float64]:
    return np.column_stack(list(columns.values())) if columns else np.empty((samples, 0))
