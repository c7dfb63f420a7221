"""Logs as trips, read side by side; one that cannot be read does not stop the others."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from estimators.weigh.calibration import Reference
from estimators.weigh.samples import samples_of
from estimators.weigh.trip import Trip
from scenarios.experiment.progress import parallel
from twin import Drive, TwinError


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """A log to read.

    Attributes:
        path: of the file.
        load: beyond the car with its driver, as it is known of a reference trip [kg].
    """

    path: Path
    load: float = 0.0

    @classmethod
    def parse(cls, text: str) -> "Log":
        """FILE, or FILE=KG.

        Raises:
            TwinError: what stands behind the sign is no number.
        """
        name, sign, load = text.rpartition("=")
        if not sign or Path(text).exists():
            return cls(path=Path(text))
        try:
            return cls(path=Path(name), load=float(load))
        except ValueError:
            raise TwinError(f"{text}: load is {load!r}; allowed: FILE or FILE=KG") from None


def read_trip(path: Path, map_path: Path | None, radius: float) -> Trip:
    """A log as a trip.

    Args:
        path: of the log.
        map_path: see `twin.logs.map`; None: a drive of ours.
        radius: of the driven wheels [m].

    Raises:
        TwinError: the log or the map is missing or broken, or lacks a channel.
    """
    return Trip.of_drive(Drive.load(path, map=map_path), radius, path.stem)


def read_trips(
    paths: Sequence[Path], map_path: Path | None, radius: float, jobs: int
) -> list[Trip | TwinError]:
    """Trips, or the error of each that cannot be read."""
    read = partial(_read_or_error, map_path=map_path, radius=radius)
    return parallel(read, list(paths), jobs, "logs")


def references_of(logs: Sequence[Log], map_path: Path | None, radius: float) -> list[Reference]:
    """Reference trips of known load.

    Raises:
        TwinError: one of them cannot be read.
    """
    references = []
    for log in logs:
        trip = read_trip(log.path, map_path, radius)
        references.append(Reference(name=trip.name, samples=samples_of(trip), load=log.load))
    return references


def _read_or_error(path: Path, map_path: Path | None, radius: float) -> Trip | TwinError:
    try:
        return read_trip(path, map_path, radius)
    except TwinError as error:
        return error
