"""The command line, `til`.

What a user can mend is one line on standard error and exit status 2, Ctrl-C one and 130; a
traceback is a bug of ours.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from scenarios import catalogue
from scenarios.catalogue import REPRODUCTIONS, SCENARIOS, Scenario, Settings, Tuning
from scenarios.options import (
    STANDARD_OUTPUT,
    Name,
    Names,
    OutputFile,
    count_option,
    dask_option,
    duration_option,
    jobs_option,
    json_option,
    name_argument,
    snr_option,
)
from scenarios.report import PictureOf, Section, write_report
from scenarios.result import Result, json_text, write_json


def main(args: Sequence[str] | None = None) -> int:
    """Runs a command; returns the exit status."""
    try:
        status = program.main(args, prog_name="til", standalone_mode=False)
    except click.ClickException as error:
        click.echo("til: " + " ".join(_message(error).split()), err=True)
        return error.exit_code
    return status if isinstance(status, int) else 0


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
@count_option("--seed", 0, "First seed.", least=0)
@count_option("--seeds", 1, "How many seeds, counted up from the first.")
@jobs_option
@duration_option
@click.option(
    "--rrd", type=OutputFile(suffix=".rrd"), metavar="FILE", help="Write the Rerun timeline."
)
@click.option(
    "--gains",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Gains of the default estimator, as `til tune` writes them.",
)
@click.option(
    "--png", type=OutputFile(suffix=".png"), metavar="FILE", help="Draw the scenario's picture."
)
@click.option("--view", is_flag=True, help="Show the timeline in a window until it is closed.")
@dask_option
@json_option
def run(
    name: str,
    snr: float | None,
    seed: int,
    seeds: int,
    jobs: int,
    duration: float | None,
    rrd: Path | None,
    gains: Path | None,
    png: Path | None,
    view: bool,
    dask: str | None,
    json_path: Path | None,
) -> None:
    """Drive scenario NAME, once or over several seeds.

    The timeline shows the first seed.
    """
    from scenarios.progress import cluster  # not at the top: it imports joblib

    scenario = catalogue.scenario(name)
    settings = Settings(
        snr=scenario.default_snr if snr is None else snr,
        seeds=tuple(range(seed, seed + seeds)),
        jobs=jobs,
        duration=duration,
        gains=gains,
    )
    if gains and not scenario.takes_gains:
        raise Mistake(f"--gains: {name} takes none; allowed: laps, lane-change")
    with cluster(dask):
        result = scenario.run(settings)
    _report(result, json_path)
    if rrd:
        scenario.timeline(settings, rrd)
    if png:
        scenario.picture(settings, png)
    if view:
        _view(scenario, settings, rrd)


@program.command()
@click.argument("names", metavar="[NAME]...", type=Name("reproduction", REPRODUCTIONS), nargs=-1)
@count_option("--seeds", 20, "How many seeds, counted up from 0.")
@jobs_option
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    default="out",
    show_default=True,
    help="Folder for pictures and report.html; it is made if it is missing.",
)
@dask_option
@json_option
def reproduce(
    names: tuple[str, ...],
    seeds: int,
    jobs: int,
    out: Path,
    dask: str | None,
    json_path: Path | None,
) -> None:
    """Put a paper's tables and figures beside ours; without a NAME, all of them.

    DIR/report.html shows all tables and pictures of the run on one page.

    JSON of one is that result; of several it is {"results": [...]} with one such object each.
    """
    from scenarios.progress import cluster  # not at the top: it imports joblib

    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Mistake(f"--out: {out} cannot be written: {error.strerror}") from error
    report = OutputFile().convert(out / "report.html", None, None)
    sections: list[Section] = []
    with cluster(dask):
        for name in dict.fromkeys(names or REPRODUCTIONS):
            picture = PictureOf(out, name)
            result = catalogue.reproduction(name)(seeds, jobs, out)
            if json_path != STANDARD_OUTPUT:
                click.echo("\n" * bool(sections), nl=False)  # between tables
                _print_table(result)
            sections.append(
                Section(result=result, summary=REPRODUCTIONS[name].summary, picture=picture.read())
            )
    objects = [section.result.to_json() for section in sections]
    _save(objects[0] if len(objects) == 1 else {"results": objects}, json_path)
    write_report(sections, report)


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
@name_argument
@click.option("--estimator", default="til", show_default=True, help="Whose gains.")
@count_option("--evaluations", 30, "How many points to try.", least=2)
@jobs_option
@click.option(
    "--out", type=OutputFile(suffix=".toml"), metavar="FILE", help="[default: out/tune-NAME.toml]"
)
@click.option(
    "--bounds",
    "bounds",
    type=(str, float, float),
    multiple=True,
    metavar="GAIN LOW HIGH",
    help="Look for a gain within other bounds than its own; may be given several times.",
)
@click.option("--cost", default="", help="What is minimised: robust or, where it has one, paper.")
@json_option
def tune(
    name: str,
    estimator: str,
    evaluations: int,
    jobs: int,
    out: Path | None,
    bounds: Sequence[tuple[str, float, float]],
    cost: str,
    json_path: Path | None,
) -> None:
    """Choose the gains of an estimator of scenario NAME, on seeds that no result is reported on.

    Bayesian optimisation, in batches of four; FILE holds the best point tried and the one predicted
    best. A tuning that was interrupted goes on from the journal beside FILE.
    """
    tuning = Tuning(
        estimator=estimator,
        evaluations=evaluations,
        jobs=jobs,
        path=out or Path("out", f"tune-{name}.toml"),
        bounds={gain: (low, high) for gain, low, high in bounds},
        cost=cost,
    )
    tuning.path.parent.mkdir(parents=True, exist_ok=True)
    _report(catalogue.scenario(name).tune(tuning), json_path)


@program.command()
@click.argument("log", type=click.Path(path_type=Path))
@click.option(
    "--map",
    "map_path",
    type=click.Path(path_type=Path),
    metavar="MAP.toml",
    help="Which channels of the log are ours.",
)
def inspect(log: Path, map_path: Path | None) -> None:
    """Show what is in LOG (Parquet, CSV, MDF 4) and check its signs, units and delays."""
    click.echo(catalogue.inspection()(log, map_path))


@program.command("new-car")
@click.argument("name")
def new_car(name: str) -> None:
    """Write NAME.toml, a commented description of a car to fill in."""
    click.echo(f"{catalogue.new_car()(name)} describes a car: change what you know of yours.")


@program.command()
@click.argument("log", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--vehicle", required=True, metavar="CAR", help="A car's name, or an MJCF file.")
@click.option("--free", required=True, type=Names(), metavar="NAME,...", help="What is fitted.")
@click.option(
    "--fit",
    "signals",
    type=Names(),
    metavar="NAME,...",
    default="ay,yaw_rate",
    show_default=True,
    help="Signals that the twin is to show as the log does; sideslip is that of the log's truth.",
)
@click.option("--from", "first", type=float, metavar="S", help="First time used.")
@click.option("--to", "last", type=float, metavar="S", help="Last time used.")
@count_option("--evaluations", 20, "How many steps at most.")
@jobs_option
@click.option(
    "--out", type=OutputFile(suffix=".toml"), metavar="FILE", help="[default: out/calibrate.toml]"
)
@json_option
def calibrate(
    log: Path,
    vehicle: str,
    free: tuple[str, ...],
    signals: tuple[str, ...],
    first: float | None,
    last: float | None,
    evaluations: int,
    jobs: int,
    out: Path | None,
    json_path: Path | None,
) -> None:
    """Fit the twin of a car to LOG, a recorded drive, by bounded least squares.

    FILE holds values, their 95 % confidence intervals and where they come from. A factor of 1 and a
    delta or offset of 0 are what the car's files say. Where the log has no torques the twin
    follows its measured vx, and the mass is not observable.
    """
    path = out or Path("out", "calibrate.toml")
    path.parent.mkdir(parents=True, exist_ok=True)
    calibration = catalogue.calibrate()
    task = calibration.task_of(log, vehicle, free, signals, (first, last))
    _report(calibration.run(task, log, path, jobs=jobs, evaluations=evaluations), json_path)


@program.command()
@click.argument("logs", metavar="LOG...", nargs=-1, required=True)
@click.option("--vehicle", required=True, metavar="CAR", help="A car's name, MJCF or TOML file.")
@click.option(
    "--map",
    "map_path",
    type=click.Path(path_type=Path),
    metavar="MAP.toml",
    help="Which channels of the logs are ours; a drive of ours needs none.",
)
@click.option(
    "--estimator",
    "estimators",
    type=click.Choice(["til", "joint"]),
    multiple=True,
    default=("til",),
    show_default=True,
    help="til: states, sideslip and mass; joint: all load parameters, tyres, springs. Repeatable.",
)
@jobs_option
@dask_option
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    default="out",
    show_default=True,
    help="Folder for timelines, histories and finished results; every job must reach it.",
)
@click.option(
    "--state",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Of a stream: go on where FILE was left, and leave it again at the end.",
)
@json_option
def estimate(
    logs: tuple[str, ...],
    vehicle: str,
    map_path: Path | None,
    estimators: tuple[str, ...],
    jobs: int,
    dask: str | None,
    out: Path,
    state: Path | None,
    json_path: Path | None,
) -> int:
    """Observe recorded drives: LOG is Parquet, CSV or MDF 4, or - for standard input.

    Of each LOG DIR receives NAME.ESTIMATOR.rrd, the timeline; .parquet, the estimates over time;
    and .json, the result. A second call skips what is finished there, unless the log, the map, the
    car or a version has changed. Truth in a log is only scored against. A bad log does not stop the
    others; the exit status is then 2.

    From standard input come samples, one JSON object a line or CSV with a row of names: time [s],
    inputs and measurements by our names or the map's, at any rate. Estimates go to standard output
    as they come, one JSON object a line.
    """
    from scenarios.progress import cluster  # not at the top: it imports joblib

    if "-" in logs:
        if len(logs) > 1 or json_path or estimators != ("til",) or dask:
            raise Mistake("estimate: a stream, -, stands alone; allowed: --map, --vehicle, --state")
        return catalogue.estimate_stream().run(vehicle, map_path, state)
    if state:
        raise Mistake("--state: is that of a stream; allowed: LOG is -")
    with cluster(dask):
        result, text, bad = catalogue.estimate().run(
            [Path(log) for log in logs],
            vehicle=vehicle, map_path=map_path, estimators=estimators, jobs=jobs, out=out,
        )  # fmt: skip
    _report(result, json_path, f"{text}\n\n{result.table()}" if result.rows else text)
    for line in bad:
        click.echo(f"til: {line}", err=True)
    return 2 if bad else 0


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
    for sentence in result.settings.get("report", ()):
        click.echo(sentence)


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


if __name__ == "__main__":
    sys.exit(main())
