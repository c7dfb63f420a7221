"""`til plan`: the manoeuvre that makes a parameter known soonest."""

import re
from pathlib import Path

import click

from scenarios.cli import catalogue
from scenarios.cli.options import count_option, jobs_option, json_option
from scenarios.cli.output import report

_METRES, _DEGREES = "M/S2", "DEG/S"


@click.command("plan")
@click.option("--vehicle", required=True, metavar="CAR", help="A car's name, MJCF or TOML file.")
@click.option(
    "--want",
    required=True,
    metavar="NAME=SD,...",
    help="Standard deviations to reach, as in mass=20kg,Jzz=5%,cm_z=10mm.",
)
@click.option(
    "--area", metavar="LxW", help="Stay in an area of so many m; each pass starts and stops in it."
)
@click.option(
    "--road",
    type=click.Choice(("straight", "circuit")),
    default="straight",
    show_default=True,
    help="Without an area: a straight of 10 m without end, or the project's circuit, 8 m wide.",
)
@click.option("--width", type=float, metavar="M", help="Of the road, if it is another.")
@click.option(
    "--speed", default="10..25", show_default=True, metavar="LO..HI", help="Allowed [m/s]."
)
@click.option("--max-ay", type=float, default=5.0, show_default=True, metavar=_METRES)
@click.option("--max-braking", type=float, default=6.0, show_default=True, metavar=_METRES)
@click.option(
    "--max-jerk", type=float, default=100.0, show_default=True, metavar="M/S3",
    help="Of the horizontal acceleration.",
)  # fmt: skip
@click.option(
    "--max-steering-rate", type=float, default=570.0, show_default=True, metavar=_DEGREES,
    help="Of the hand wheel.",
)  # fmt: skip
@click.option(
    "--max-time", type=float, default=60.0, show_default=True, metavar="S", help="Of driving."
)
@click.option(
    "--estimator",
    type=click.Choice(("joint",)),
    default="joint",
    show_default=True,
    help="That will observe the drive.",
)
@click.option(
    "--model-error/--no-model-error",
    default=False,
    show_default=True,
    help="Plan for a car that differs from its files as cars of a type do, not for sensor noise.",
)
@count_option("--evaluations", 60, "How many designs to try.", least=4)
@count_option("--cars", 6, "Cars drawn from the prior that the plan has to serve.", least=0)
@count_option("--seed", 0, "Of the drawn cars.", least=0)
@jobs_option
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="For picture, table and instructions.  [default: out/plan-CAR]",
)
@json_option
def plan(
    vehicle: str,
    want: str,
    area: str | None,
    road: str,
    width: float | None,
    speed: str,
    max_ay: float,
    max_braking: float,
    max_jerk: float,
    max_steering_rate: float,
    max_time: float,
    estimator: str,
    model_error: bool,
    evaluations: int,
    cars: int,
    seed: int,
    jobs: int,
    out: Path | None,
    json_path: Path | None,
) -> None:
    """Design the manoeuvre that makes parameters of CAR known soonest.

    Steering is a sum of three sines, the speed rises and falls; both are chosen by the information
    that the joint observer gets of the drive, simulated with the car. FOLDER receives plan.png with
    path, steering, speed and what is known over time beside standard manoeuvres, plan.csv for a
    robot and plan.txt for a driver. A search that was interrupted goes on.

    What can be wanted: mass (of kg or %), cm_x, cm_y, cm_z (mm, cm, m), Jxx, Jyy, Jzz, Jxy, Jxz,
    Jyz (kgm2; the first three %), tyre_friction, cornering_stiffness, drag, spring, damper,
    relaxation, drive_torque, brake_torque (%).
    """
    del estimator  # one so far
    planning = catalogue.planning()
    limits = planning.limits_of(
        area=area, road=road, width=width, speed=speed, lateral=max_ay, braking=max_braking,
        jerk=max_jerk, steering_rate=max_steering_rate, seconds=max_time,
    )  # fmt: skip
    name = re.sub(r"[^\w.-]+", "-", Path(vehicle).stem)
    result, text = planning.make_plan(
        vehicle,
        want,
        limits,
        differs=model_error,
        evaluations=evaluations,
        cars=cars,
        jobs=jobs,
        seed=seed,
        out=out or Path("out", f"plan-{name}"),
    )
    report(result, json_path, text)


COMMANDS = (plan,)
