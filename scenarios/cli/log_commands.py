"""Commands of `til` for logs and other people's cars: inspect, calibrate, estimate."""

from pathlib import Path

import click

from scenarios.cli import catalogue
from scenarios.cli.options import (
    STANDARD_OUTPUT,
    Mistake,
    Names,
    Numbers,
    OutputFile,
    count_option,
    dask_option,
    jobs_option,
    json_option,
)
from scenarios.cli.output import report, save


@click.command()
@click.argument("log", type=click.Path(path_type=Path))
@click.option(
    "--map",
    "map_path",
    type=click.Path(path_type=Path),
    metavar="MAP.toml",
    help="Which channels of the log are ours.",
)
@click.option(
    "--vehicle", metavar="CAR", help="A car's name or file: steering and torques are checked too."
)
@click.option(
    "--dbc",
    "database",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="LOG is a raw CAN log with this database: DBC, ARXML, KCD or SYM.",
)
@click.option(
    "--write-map",
    "new_map",
    type=OutputFile(suffix=".toml"),
    metavar="NEW.toml",
    help="Write the map that is proposed, to be checked by you; no file is overwritten.",
)
def inspect(
    log: Path,
    map_path: Path | None,
    vehicle: str | None,
    database: Path | None,
    new_map: Path | None,
) -> None:
    """Show what is in LOG and check its signs, units and delays.

    Each finding names the line of the map that would mend it. Of a raw CAN log (BLF, ASC, candump
    .log, TRC, CSV, MF4) messages, rates, gaps and, with --dbc, signals are shown, and a map is
    proposed by their names and units. It is never used unless you save it and give it as --map.
    """
    if new_map is not None and new_map.exists():
        raise Mistake(f"--write-map: {new_map} exists; allowed: a new file")
    if new_map is not None and map_path is not None:
        raise Mistake("--write-map: a map is given already; allowed: --map or --write-map")
    told = catalogue.inspection()(log, map_path, vehicle, database)
    click.echo(told.text)
    if told.map:
        click.echo(f"\n# map.toml\n{told.map}")
    if new_map is None:
        return
    if not told.map:
        raise Mistake(f"--write-map: no map is proposed for {log}; allowed: of CAN logs with --dbc")
    new_map.write_text(f"{told.map}\n", encoding="utf-8")


@click.command()
@click.argument(
    "logs",
    metavar="LOG...",
    nargs=-1,
    required=True,
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
)
@click.option(
    "--map",
    "map_path",
    type=click.Path(path_type=Path),
    metavar="MAP.toml",
    help="Which channels of the logs are ours; a drive of ours needs none.",
)
@click.option("--vehicle", required=True, metavar="CAR", help="A car's name, MJCF or TOML file.")
@click.option(
    "--free",
    type=Names(),
    metavar="NAME,...",
    default="",
    help="What is fitted.  [default: tyres, relaxation, cm_x, offsets]",
)
@click.option(
    "--fit",
    "signals",
    type=Names(),
    metavar="NAME,...",
    default="",
    help="Signals that the twin is to show as the log does.  [default: ay,yaw_rate; of a log "
    "without torques the sideslip of its truth, if it has one]",
)
@click.option(
    "--held-out",
    type=click.FloatRange(0.0, 0.9),
    default=0.25,
    show_default=True,
    metavar="SHARE",
    help="Of each log, at its end, that a first fit does not see: it is scored there.",
)
@click.option(
    "--prior",
    "prior_sd",
    type=Numbers(),
    metavar="NAME=SD,...",
    default="",
    help="How far what is free is believed to lie from the car's file, as front_anti_roll=0.5.",
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
    logs: tuple[Path, ...],
    map_path: Path | None,
    vehicle: str,
    free: tuple[str, ...],
    signals: tuple[str, ...],
    held_out: float,
    prior_sd: dict[str, float],
    first: float | None,
    last: float | None,
    evaluations: int,
    jobs: int,
    out: Path | None,
    json_path: Path | None,
) -> None:
    """Fit the twin of a car to LOGs, recorded drives, by bounded least squares.

    FILE holds values, their 95 % confidence intervals and where they come from; it is a car that
    --vehicle takes. A factor of 1 and a delta or offset of 0 are what the car's files say, and are
    believed beforehand as far as the data do not say otherwise. A first fit does not see the last
    quarter of each log and is scored there; the band of the sideslip is as wide as the errors there
    ask for. The fit that is written is to all. Where a log has no torques the twin follows the
    measured vx, and the mass is not observable.

    With a gain among what is freed the observer of the sideslip has constant gains; with none they
    follow from a covariance, whose noises are fitted.

    What can be freed: factors of tyre_friction, cornering_stiffness, slip_stiffness,
    combined_slip, load_of_largest_stiffness, lateral_curvature and relaxation, each also with
    front_ or rear_ before it, of spring, damper, drag, front_anti_roll, rear_anti_roll,
    steering_ratio, drive_torque, brake_torque; deltas of mass, cm_x, cm_y, cm_z, Jxx, Jyy, Jzz,
    Jxy, Jxz, Jyz; steering_offset, sideslip_offset, sideslip_lever and ax_offset to
    yaw_rate_offset; brake_front, locking; the gains yaw_rate_to_yaw_rate, yaw_rate_to_vy, ay_to_vy.
    """
    path = out or Path("out", "calibrate.toml")
    path.parent.mkdir(parents=True, exist_ok=True)
    plan_of, run = catalogue.calibration()
    plan = plan_of(logs, map_path, vehicle, free, signals, (first, last), held_out, prior_sd)
    found = run(plan, logs, path, jobs=jobs, evaluations=evaluations)
    report(found, json_path)


@click.command()
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
    "--report/--no-report",
    "with_report",
    default=True,
    show_default=True,
    help="A page for people beside the timeline.",
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
    with_report: bool,
    state: Path | None,
    json_path: Path | None,
) -> int:
    """Observe recorded drives: LOG is Parquet, CSV or MDF 4, or - for standard input.

    Of each LOG DIR receives NAME.ESTIMATOR.html, the report, which any browser opens; .rrd, the
    timeline; .parquet, the estimates over time; and .json, the result. A second call skips what is
    finished there, unless the log, the map, the car or a version has changed. Truth in a log is
    only scored against. A bad log does not stop the others; the exit status is then 2.

    From standard input come samples, one JSON object a line or CSV with a row of names: time [s],
    inputs and measurements by our names or the map's, at any rate. Estimates go to standard output
    as they come, one JSON object a line.
    """
    from scenarios.experiment.progress import cluster  # not at the top: it imports joblib

    if "-" in logs:
        if len(logs) > 1 or json_path or estimators != ("til",) or dask:
            raise Mistake("estimate: a stream, -, stands alone; allowed: --map, --vehicle, --state")
        return catalogue.estimate_stream().run(vehicle, map_path, state)
    if state:
        raise Mistake("--state: is that of a stream; allowed: LOG is -")
    pages = catalogue.report_of_logs()
    if with_report and not pages.possible():
        click.echo(f"til: {pages.MISSING}", err=True)
        with_report = False
    with cluster(dask):
        result, text, bad = catalogue.estimate().run(
            [Path(log) for log in logs],
            vehicle=vehicle, map_path=map_path, estimators=estimators, jobs=jobs, out=out,
            report=with_report,
        )  # fmt: skip
    if json_path != STANDARD_OUTPUT:
        click.echo(text)
    save(result, json_path)
    for line in bad:
        click.echo(f"til: {line}", err=True)
    return 2 if bad else 0


COMMANDS = (inspect, calibrate, estimate)
