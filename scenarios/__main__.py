"""The command line, `til`.

What a user can mend is one line on standard error and exit status 2, Ctrl-C one and 130; a
traceback is a bug of ours.
"""

import math
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import click

from scenarios import catalogue
from scenarios.catalogue import REPRODUCTIONS, SCENARIOS, Entry, Scenario, Settings
from scenarios.result import Result, json_text, write_json

STANDARD_OUTPUT = Path("-")


def main(args: Sequence[str] | None = None) -> int:
    """Runs a command; returns the exit status."""
    try:
        program.main(args, prog_name="til", standalone_mode=False)
    except click.ClickException as error:
        click.echo("til: " + " ".join(_message(error).split()), err=True)
        return error.exit_code
    return 0


def _message(error: click.ClickException) -> str:
    """What is wrong and where to read what is allowed."""
    context = error.ctx if isinstance(error, click.UsageError) else None
    hint = f" (see {context.command_path} --help)" if context else ""
    return error.format_message() + hint


class Mistake(click.ClickException):
    """Something the user can mend."""

    exit_code = 2


class Interrupted(click.ClickException):
    """Ctrl-C."""

    exit_code = 130  # 128 + SIGINT


class Program(click.Group):
    """The commands, with the errors a user is to see told apart from bugs."""

    def invoke(self, ctx: click.Context) -> Any:
        """Runs the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise Interrupted("interrupted") from None
        except (click.ClickException, click.exceptions.Exit):
            raise
        except Exception as error:
            from twin.errors import TwinError  # not at the top: twin imports MuJoCo and numba

            if isinstance(error, TwinError):
                raise Mistake(str(error)) from error
            raise


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


def _count_option(name: str, default: int, text: str, *, least: int = 1) -> Any:
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
jobs_option = _count_option("--jobs", 1, "Processes side by side.")
json_option = click.option(
    "--json",
    "json_path",
    type=OutputFile(allow_dash=True),
    metavar="FILE",
    help="Write the result as JSON; - writes it to standard output instead of the table.",
)


@click.group(cls=Program, no_args_is_help=False)
def program() -> None:
    """Drives a car and its digital twin, and estimates what nobody measures."""


@program.command("list")
def list_() -> None:
    """Name the scenarios and what can be reproduced, a line each."""
    width = max(map(len, (*SCENARIOS, *REPRODUCTIONS)))
    for command, entries in ("run", SCENARIOS), ("reproduce", REPRODUCTIONS):
        click.echo(f"for til {command}:")
        for name, entry in entries.items():
            click.echo(f"  {name:{width}}  {entry.summary}")


@program.command()
@name_argument
@snr_option
@_count_option("--seed", 0, "First seed.", least=0)
@_count_option("--seeds", 1, "How many seeds, counted up from the first.")
@jobs_option
@duration_option
@click.option(
    "--rrd", type=OutputFile(suffix=".rrd"), metavar="FILE", help="Write the Rerun timeline."
)
@click.option("--view", is_flag=True, help="Show the timeline in a window until it is closed.")
@json_option
def run(
    name: str,
    snr: float | None,
    seed: int,
    seeds: int,
    jobs: int,
    duration: float | None,
    rrd: Path | None,
    view: bool,
    json_path: Path | None,
) -> None:
    """Drive scenario NAME, once or over several seeds.

    The timeline shows the first seed.
    """
    scenario = catalogue.scenario(name)
    settings = Settings(
        snr=scenario.default_snr if snr is None else snr,
        seeds=tuple(range(seed, seed + seeds)),
        jobs=jobs,
        duration=duration,
    )
    _report(scenario.run(settings), json_path)
    if rrd:
        scenario.timeline(settings, rrd)
    if view:
        _view(scenario, settings, rrd)


@program.command()
@click.argument("names", metavar="[NAME]...", type=Name("reproduction", REPRODUCTIONS), nargs=-1)
@_count_option("--seeds", 20, "How many seeds, counted up from 0.")
@jobs_option
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    default="out",
    show_default=True,
    help="Folder for pictures; it is made if it is missing.",
)
@json_option
def reproduce(
    names: tuple[str, ...], seeds: int, jobs: int, out: Path, json_path: Path | None
) -> None:
    """Put a paper's tables and figures beside ours; without a NAME, all of them.

    JSON of one is that result; of several it is {"results": [...]} with one such object each.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        _try_to_write(out)
    except OSError as error:
        raise Mistake(f"--out: {out} cannot be written: {error.strerror}") from error
    results: list[Result] = []
    for name in dict.fromkeys(names or REPRODUCTIONS):
        result = catalogue.reproduction(name)(seeds, jobs, out)
        if json_path != STANDARD_OUTPUT:
            click.echo("\n" * bool(results), nl=False)  # between tables
            _print_table(result)
        results.append(result)
    objects = [result.to_json() for result in results]
    _save(objects[0] if len(objects) == 1 else {"results": objects}, json_path)


@program.command()
@name_argument
@snr_option
@duration_option
@json_option
def limits(name: str, snr: float | None, duration: float | None, json_path: Path | None) -> None:
    """Bound what the drive of scenario NAME can tell of the load at all.

    Shows the least standard deviation that an unbiased estimator can have (Cramer-Rao), of each
    parameter singly and of all jointly, and how the joint errors are correlated.
    """
    scenario = catalogue.scenario(name)
    settings = Settings(
        snr=scenario.default_snr if snr is None else snr, seeds=(0,), jobs=1, duration=duration
    )
    result, text = catalogue.limits()(name, scenario, settings)
    _report(result, json_path, text)


@program.command()
@json_option
def bench(json_path: Path | None) -> None:
    """Measure the speed, as ratios taken side by side."""
    _report(catalogue.bench()(), json_path)


def _report(result: Result, json_path: Path | None, text: str | None = None) -> None:
    """Shows the text, or the rows if there is none, and saves the rows."""
    if json_path != STANDARD_OUTPUT:
        _print_table(result, text)
    _save(result.to_json(), json_path)


def _print_table(result: Result, text: str | None = None) -> None:
    click.echo(f"{result.name} ({result.seconds:.1f} s)\n{text or result.table()}")


def _save(data: dict[str, Any], json_path: Path | None) -> None:
    if json_path == STANDARD_OUTPUT:
        click.echo(json_text(data))
    elif json_path:
        write_json(data, json_path)


def _view(scenario: Scenario, settings: Settings, rrd: Path | None) -> None:
    """Shows the timeline, one written for the purpose if none was asked for."""
    from scenarios.timeline import view  # not at the top: it imports Rerun

    if rrd:
        view(rrd)
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "timeline.rrd")
        scenario.timeline(settings, path)
        view(path)


def _try_to_write(folder: Path) -> None:
    with tempfile.TemporaryFile(dir=folder):
        pass


if __name__ == "__main__":
    sys.exit(main())
