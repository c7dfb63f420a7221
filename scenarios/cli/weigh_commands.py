"""`til weigh`: the mass of a car from logs of ordinary driving."""

from pathlib import Path

import click

from scenarios.cli import catalogue
from scenarios.cli.options import STANDARD_OUTPUT, Mistake, OutputFile, jobs_option, json_option
from scenarios.cli.output import save

_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.command()
@click.argument("logs", metavar="LOG...", nargs=-1, type=click.Path(path_type=Path))
@click.option("--vehicle", required=True, metavar="CAR", help="A car's name, MJCF or TOML file.")
@click.option(
    "--map",
    "map_path",
    type=_FILE,
    metavar="MAP.toml",
    help="Which channels of the logs are ours; a drive of ours needs none.",
)
@click.option(
    "--reference",
    "references",
    multiple=True,
    metavar="LOG[=KG]",
    help="A trip of known load, by default none beyond the driver. Repeatable.",
)
@click.option(
    "--calibration",
    type=_FILE,
    metavar="FILE",
    help="Take this one instead of the car's own.",
)
@click.option(
    "--calibrate",
    "learnt",
    type=OutputFile(suffix=".toml"),
    metavar="FILE",
    help="Learn the car anew from the references, at least 4, and write FILE.",
)
@click.option(
    "--notes",
    type=_FILE,
    metavar="NOTES.csv",
    help="Lines LOG,NOTE for the picture; LOG without its ending.",
)
@click.option("--png", type=OutputFile(suffix=".png"), metavar="FILE", help="Draw all trips.")
@jobs_option
@json_option
def weigh(
    logs: tuple[Path, ...],
    vehicle: str,
    map_path: Path | None,
    references: tuple[str, ...],
    calibration: Path | None,
    learnt: Path | None,
    notes: Path | None,
    png: Path | None,
    jobs: int,
    json_path: Path | None,
) -> int:
    """Tell the total mass and the load of each LOG, with a 95 % interval in kg.

    A log needs motor or wheel torques, one speed and the longitudinal acceleration; the position of
    the accelerator helps. Brakes, slope and load of the road need not be known. The interval comes
    from the scatter of the reference trips behind the car's calibration; --reference trips of the
    same season, tyres or driver move its scale. A log that cannot be read does not stop the others;
    the exit status is then 2.
    """
    if calibration and learnt:
        raise Mistake("weigh: --calibration and --calibrate exclude each other; allowed: one")
    if not logs and not learnt:
        raise Mistake("weigh: there is no LOG; allowed: at least one, or --calibrate FILE")
    weighing, read = catalogue.weigh()
    task = weighing.Task(
        logs=logs, vehicle=vehicle, map_path=map_path, references=[read(r) for r in references],
        calibration=calibration, learnt=learnt, notes=_notes(notes), picture=png, jobs=jobs,
    )  # fmt: skip
    outcome = weighing.run(task)
    if json_path != STANDARD_OUTPUT:
        click.echo(weighing.as_text(outcome))
    if json_path:
        save(weighing.as_json(task, outcome), json_path)
    for line in outcome.errors:
        click.echo(f"til: {line}", err=True)
    return 2 if outcome.errors else 0


def _notes(path: Path | None) -> dict[str, str]:
    """Notes by the name of the log."""
    if path is None:
        return {}
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise Mistake(f"{path}: cannot be read: {error}") from None
    pairs = [line.partition(",") for line in lines if line.strip()]
    return {name.strip(): note.strip() for name, _, note in pairs}


COMMANDS = (weigh,)
