"""Commands of `til` that drive and score: list, run, reproduce, limits, tune, bench."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from scenarios.cli import catalogue
from scenarios.cli.catalogue import REPRODUCTIONS, SCENARIOS
from scenarios.cli.options import (
    STANDARD_OUTPUT,
    Mistake,
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
from scenarios.cli.output import print_table, report, save
from scenarios.report.html import PictureOf, Section, write_report


@click.command("list")
def list_() -> None:
    """Name the scenarios and what can be reproduced, a line each."""
    width = max(map(len, (*SCENARIOS, *REPRODUCTIONS)))
    for command, entries in ("run", SCENARIOS), ("reproduce", REPRODUCTIONS):
        click.echo(f"for til {command}:")
        for name, entry in entries.items():
            click.echo(f"  {name:{width}}  {entry.summary}")


@click.command()
@name_argument
@snr_option
@count_option("--seed", 0, "First seed.", least=0)
@count_option("--seeds", 1, "How many seeds, counted up from the first.")
@jobs_option
@duration_option
@click.option(
    "--car",
    metavar="CAR",
    help="Drive this car, a name or a file, in a scenario that any car can drive.",
)
@click.option(
    "--estimator",
    "estimators",
    multiple=True,
    metavar="NAME",
    help="Run this estimator instead of the scenario's own; may be given several times.",
)
@click.option(
    "--rrd", type=OutputFile(suffix=".rrd"), metavar="FILE", help="Write the Rerun timeline."
)
@click.option(
    "--gains",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Gains of the first estimator, as `til tune` writes them.",
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
    car: str | None,
    estimators: tuple[str, ...],
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
    experiment = catalogue.scenario(name)
    experiment = experiment if car is None else experiment.of(car)
    if png and not experiment.draws:
        raise Mistake(f"--png: {name} has no picture; run it without --png")
    settings: dict[str, Any] = {"snr": snr, "duration": duration, "estimators": estimators}
    if gains:
        settings["gains"] = catalogue.find("gains")(gains, experiment, estimators)
    with catalogue.find("cluster")(dask):
        result = catalogue.find("run")(
            experiment, seeds=range(seed, seed + seeds), jobs=jobs, **settings
        )
    report(result, json_path)
    if rrd:
        catalogue.find("timeline")(experiment, rrd, seed=seed, **settings)
    if png:
        catalogue.find("picture")(experiment, png, seed=seed, **settings)
    if view and rrd:
        catalogue.find("view")(rrd)
    elif view:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "timeline.rrd")
            catalogue.find("timeline")(experiment, path, seed=seed, **settings)
            catalogue.find("view")(path)


@click.command()
@click.argument("names", metavar="[NAME]...", type=Name("reproduction", REPRODUCTIONS), nargs=-1)
@count_option("--seeds", 20, "How many seeds, counted up from 0.")
@jobs_option
@duration_option
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
    duration: float | None,
    out: Path,
    dask: str | None,
    json_path: Path | None,
) -> None:
    """Put a paper's tables and figures beside ours; without a NAME, all of them.

    DIR/report.html shows all tables and pictures of the run on one page.

    JSON of one is that result; of several it is {"results": [...]} with one such object each.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Mistake(f"--out: {out} cannot be written: {error.strerror}") from error
    page = OutputFile().convert(out / "report.html", None, None)
    making = catalogue.find("making")(
        seeds=tuple(range(seeds)), jobs=jobs, out=out, duration=duration
    )
    sections: list[Section] = []
    with catalogue.find("cluster")(dask):
        for name in dict.fromkeys(names or REPRODUCTIONS):
            picture = PictureOf(out, name)
            result = catalogue.reproduction(name)(making)
            if json_path != STANDARD_OUTPUT:
                click.echo("\n" * bool(sections), nl=False)  # between tables
                print_table(result)
            sections.append(
                Section(result=result, summary=REPRODUCTIONS[name].summary, picture=picture.read())
            )
    objects = [section.result.to_json() for section in sections]
    save(objects[0] if len(objects) == 1 else {"results": objects}, json_path)
    write_report(sections, page)


@click.command()
@name_argument
@snr_option
@duration_option
@json_option
def limits(name: str, snr: float | None, duration: float | None, json_path: Path | None) -> None:
    """Bound how well the drive of scenario NAME lets the load be estimated at all.

    Shows the least standard deviation that an unbiased estimator can have (Cramer-Rao), of each
    parameter singly and of all jointly, and how the joint errors are correlated.
    """
    result, text = catalogue.find("limits")(catalogue.scenario(name), snr, duration)
    report(result, json_path, text)


@click.command()
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
@click.option(
    "--on",
    type=Names(),
    default="",
    metavar="VEHICLE:DRIVE,...",
    help="Real vehicles and drives that are tuned on, as in mismatched:laps.",
)
@click.option(
    "--hold-out",
    type=Names(),
    default="",
    metavar="VEHICLE:DRIVE,...",
    help="Those that the gains found are reported on, and that the search does not see.",
)
@click.option(
    "--method",
    type=click.Choice(("bayes", "evolution", "random")),
    default="bayes",
    show_default=True,
    help="Bayesian optimisation, differential evolution or random points.",
)
@json_option
def tune(
    name: str,
    estimator: str,
    evaluations: int,
    jobs: int,
    out: Path | None,
    bounds: Sequence[tuple[str, float, float]],
    cost: str,
    on: tuple[str, ...],
    hold_out: tuple[str, ...],
    method: str,
    json_path: Path | None,
) -> None:
    """Choose the gains of an estimator of scenario NAME, on seeds that no result is reported on.

    A search in batches of four; FILE holds the best point tried and the one predicted
    best. A tuning that was interrupted goes on from the journal beside FILE.
    """
    path = out or Path("out", f"tune-{name}.toml")
    path.parent.mkdir(parents=True, exist_ok=True)
    result = catalogue.find("tune")(
        catalogue.scenario(name),
        estimator,
        path,
        evaluations=evaluations,
        jobs=jobs,
        bounds={gain: (low, high) for gain, low, high in bounds},
        cost=cost,
        on=on,
        held_out=hold_out,
        method=method,
    )
    report(result, json_path)


@click.command()
@json_option
def bench(json_path: Path | None) -> None:
    """Measure the speed, as ratios taken side by side."""
    report(catalogue.find("bench")(), json_path)


COMMANDS = (list_, run, reproduce, limits, tune, bench)
