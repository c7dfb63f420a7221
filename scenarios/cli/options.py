"""Arguments and options that several commands of `til` share, checked at the door."""

import math
import tempfile
from pathlib import Path
from typing import Any, cast

import click

from scenarios.cli.catalogue import SCENARIOS, Entry

STANDARD_OUTPUT = Path("-")


class Mistake(click.ClickException):
    """Something the user can mend."""

    exit_code = 2


class Name(click.ParamType):
    """A name in a part of the catalogue."""

    name = "name"

    def __init__(self, kind: str, entries: dict[str, Entry]):
        self.kind = kind
        self.entries = entries

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The name itself, if it is known."""
        if value not in self.entries:
            self.fail(f"no {self.kind} {value!r}, only {', '.join(self.entries)}", param, ctx)
        return value


class Names(click.ParamType):
    """Names with commas between them."""

    name = "names"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, ...]:
        """The names."""
        return tuple(name.strip() for name in value.split(",") if name.strip())


class Numbers(click.ParamType):
    """Names with a number each, as a=1,b=2.5."""

    name = "numbers"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> dict[str, float]:
        """The numbers by name."""
        found = {}
        for part in Names().convert(value, param, ctx):
            name, _, number = part.partition("=")
            try:
                found[name.strip()] = float(number)
            except ValueError:
                self.fail(f"{part!r} is no NAME=NUMBER", param, ctx)
        return found


class OutputFile(click.Path):
    """A file that can be written, which is tried before the long run."""

    def __init__(self, *, suffix: str = "", allow_dash: bool = False):
        super().__init__(dir_okay=False, writable=True, allow_dash=allow_dash, path_type=Path)
        self.suffix = suffix

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path of the file."""
        path = cast(Path, super().convert(value, param, ctx))
        if not path.name.endswith(self.suffix):
            self.fail(f"{path} must end in {self.suffix}", param, ctx)
        to_stream = self.allow_dash and path == STANDARD_OUTPUT
        if not to_stream and (path.is_file() or not path.exists()):
            try:
                _try_to_write(path.parent)
            except OSError as error:
                self.fail(f"{path} cannot be written: {error.strerror}", param, ctx)
        return path


def _check_snr(_: click.Context, __: click.Parameter, value: float | None) -> float | None:
    if value is not None and (math.isnan(value) or value == -math.inf):
        raise click.BadParameter(f"{value} is neither a number of dB nor inf")
    return value


def _check_duration(_: click.Context, __: click.Parameter, value: float | None) -> float | None:
    if value is not None and not 0.0 < value < math.inf:
        raise click.BadParameter(f"{value:g} s is not positive and finite")
    return value


def count_option(name: str, default: int, text: str, *, least: int = 1) -> Any:
    """An option that counts something."""
    return click.option(
        name,
        type=click.IntRange(least),
        default=default,
        show_default=True,
        metavar="N",
        help=text,
    )


name_argument = click.argument("name", type=Name("scenario", SCENARIOS))
snr_option = click.option(
    "--snr",
    type=float,
    callback=_check_snr,
    metavar="DB",
    help="Signal-to-noise ratio of the sensors; inf: no noise.  [default: the scenario's]",
)
duration_option = click.option(
    "--duration",
    type=float,
    callback=_check_duration,
    metavar="S",
    help="Drive only the first so many seconds.",
)
jobs_option = count_option("--jobs", 1, "Processes side by side.")
dask_option = click.option(
    "--dask",
    metavar="ADDRESS",
    help="Work on the Dask cluster of this scheduler, as tcp://host:8786; --jobs is its own.",
)
json_option = click.option(
    "--json",
    "json_path",
    type=OutputFile(allow_dash=True),
    metavar="FILE",
    help="Write the result as JSON; - writes it to standard output instead of the table.",
)


def _try_to_write(folder: Path) -> None:
    with tempfile.TemporaryFile(dir=folder):
        pass
