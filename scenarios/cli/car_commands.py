"""Commands of `til` for one's own car and tyres: new-car, check-car, new-tyre, fit-tyre."""

from pathlib import Path

import click

from scenarios.cli import catalogue

_load_index = click.option(
    "--load-index", type=int, metavar="N", help="The number behind the size on the tyre's side."
)


# Share of the drive torque on the front axle, by what is driven
_DRIVEN = {"front": 1.0, "rear": 0.0, "all": 0.4}


def _figure(name: str, unit: str, text: str):
    return click.option(f"--{name}", type=float, metavar=unit, help=text)


@click.command("new-car")
@click.argument("name")
@_figure("mass", "KG", "Of the whole car with its driver.")
@_figure("wheelbase", "M", "Distance of the axles.")
@_figure("track", "M", "Distance of left and right wheels, mean of both axles.")
@_figure("front-share", "X", "Of the weight, on the front axle, as 0.6.")
@click.option("--driven", type=click.Choice(sorted(_DRIVEN)), help="Axle; all: 40 % in front.")
@click.option("--tyre", metavar="SIZE", help="As '205/55R16 91V'; writes NAME.tir, too.")
@_load_index
def new_car(
    name: str,
    mass: float | None,
    wheelbase: float | None,
    track: float | None,
    front_share: float | None,
    driven: str | None,
    tyre: str | None,
    load_index: int | None,
) -> None:
    """Write NAME.toml, a commented description of a car to fill in.

    Without options every field has the value of the project's SUV. With them the other fields
    follow by rules (inertias from mass and size, springs from ride frequencies, radii from the
    tyre), and stay known as guesses until they are changed.
    """
    figures = {
        "mass": mass,
        "wheelbase": wheelbase,
        "track": track,
        "front_share": front_share,
        "drive_front": _DRIVEN.get(driven or ""),
    }
    given = {key: value for key, value in figures.items() if value is not None}
    path = catalogue.new_car().new_car(name, given, tyre, load_index)
    click.echo(f"{path} describes a car: change what you know of yours.")


@click.command("check-car")
@click.argument("car")
@click.option(
    "--png",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.png",
    help="Draw it there.  [default: CAR.check.png in this folder]",
)
@click.option("--no-png", is_flag=True, help="Draw nothing.")
def check_car(car: str, png: Path | None, no_png: bool) -> None:
    """Measure, drive and draw a CAR: a name of models/, or a TOML or MJCF file.

    Prints a line per check: the car's figure, the usual range with its source, and LOOK where the
    figure lies outside. Checked are weights and heights at rest; ride, pitch and roll on the
    springs; steady cornering and a step of the steering at 80 km/h; braking and acceleration. Takes
    some seconds. An unusual car is no error: the exit status is 0 unless it cannot stand or drive.
    """
    check, picture = catalogue.car_check()
    checked = check.check_car(car)
    click.echo(f"{checked.vehicle.source.name}\n{check.as_text(checked)}")
    if not no_png:
        path = png or Path(f"{checked.vehicle.source.stem}.check.png")
        picture.draw(checked, path)
        click.echo(f"{path} shows it.")


@click.command("new-tyre")
@click.argument("size")
@_load_index
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.tir",
    help="[default: named after the size]",
)
def new_tyre(size: str, load_index: int | None, out: Path | None) -> None:
    """Write a plausible tyre file (.tir) for a SIZE, as 205/55R16.

    Radius, loads and vertical stiffness follow from the size; slip coefficients are those of the
    project's SUV tyre. The file says which rule each number comes from.
    """
    path = catalogue.new_car().new_tyre(size, load_index, out)
    click.echo(f"{path} describes a tyre; a car's file names it as tyre.front.file.")


@click.command("fit-tyre")
@click.argument("data", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--out",
    required=True,
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.tir",
    help="The tyre file; a picture of fit over data goes beside it.",
)
@click.option("--size", metavar="SIZE", help="As '205/55R16 91V': for what DATA does not tell.")
@_load_index
def fit_tyre(data: tuple[Path, ...], out: Path, size: str | None, load_index: int | None) -> None:
    """Fit a tyre file (.tir, MF 5.2) to DATA, measurements on a tyre test bench.

    DATA is MATLAB's .mat or a table of text in columns SA, SL or SR, IA, FX, FY, FZ, MZ, P, with
    units. Without longitudinal slip in it the coefficients of F_x are those of the start.
    """
    module = catalogue.tyre_fit()
    fit, picture = module.fit_to_file(data, out, size, load_index)
    for line in (*fit.notes, *module.sentences(fit)):
        click.echo(line)
    click.echo(f"{out} describes the tyre; {picture} shows the fit over the data.")


COMMANDS = (new_car, check_car, new_tyre, fit_tyre)
