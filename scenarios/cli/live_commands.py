"""Commands of `til` for CAN buses: replay, live."""

from pathlib import Path
from typing import Any

import click

from scenarios.cli import catalogue
from scenarios.cli.options import OutputFile

_interface = click.option(
    "--interface", required=True, metavar="NAME", help="Of python-can: socketcan, virtual, ..."
)
_channel = click.option("--channel", required=True, metavar="NAME", help="As vcan0.")
_options = click.option(
    "--bus-option",
    "bus_options",
    multiple=True,
    metavar="NAME=VALUE",
    help="Further argument of python-can's bus, as bitrate=500000. Repeatable.",
)
_database = click.option(
    "--dbc",
    "database",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Database of the bus.  [default: the one that the map names]",
)


def _positive(name: str, default: float | None, unit: str, text: str) -> Any:
    return click.option(
        name,
        type=click.FloatRange(0.0, 1e5, min_open=True),
        default=default,
        show_default=default is not None,
        metavar=unit,
        help=text,
    )


_speed = _positive("--speed", 1.0, "X", "How much faster than the clock the bus's time runs.")


@click.command()
@click.argument("log", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@_interface
@_channel
@_options
@_database
@click.option(
    "--map",
    "map_path",
    type=click.Path(path_type=Path),
    metavar="BUS.toml",
    help="Which signals of the bus are ours; a raw CAN log needs none.",
)
@click.option(
    "--log-map",
    type=click.Path(path_type=Path),
    metavar="MAP.toml",
    help="Which channels of LOG are ours; a drive of ours needs none.",
)
@click.option("--vehicle", metavar="CAR", help="Says what signals of cars in LOG mean.")
@_positive("--rate", None, "HZ", "Of every message.  [default: as the database says, or 100]")
@_speed
@click.option(
    "--jitter",
    type=click.FloatRange(0.0, 1.0),
    default=0.0,
    metavar="S",
    help="Send each frame up to so much earlier or later.",
)
@click.option(
    "--loss",
    type=click.FloatRange(0.0, 1.0),
    default=0.0,
    metavar="SHARE",
    help="Lose this share of the frames, as 0.01.",
)
@click.option("--seed", type=int, default=0, metavar="N", help="Of jitter and loss.")
def replay(
    log: Path,
    interface: str,
    channel: str,
    bus_options: tuple[str, ...],
    map_path: Path | None,
    **settings: Any,
) -> None:
    """Play LOG onto a CAN bus, in real time or faster.

    LOG is a raw CAN log (BLF, ASC, candump, TRC, CSV, MF4), or any drive with the map of the bus,
    by which it becomes frames.
    """
    bus, module = catalogue.live("bus"), catalogue.live("replay")
    module.run(
        module.Replay(
            log=log, interface=interface, channel=channel, map=map_path,
            options=bus.options_of(bus_options), **settings,
        ),
        catalogue.live("run").to_stderr,
    )  # fmt: skip


@click.command()
@_interface
@_channel
@_options
@_database
@click.option(
    "--map",
    "map_path",
    required=True,
    type=click.Path(path_type=Path),
    metavar="BUS.toml",
    help="Which signals of the bus are ours; can/suv.toml is that of our example bus.",
)
@click.option("--vehicle", required=True, metavar="CAR", help="A car's name, MJCF or TOML file.")
@_positive("--rate", 100.0, "HZ", "Estimates a second.")
@_positive("--lateness", 0.05, "S", "How long a sample waits for signals that are late.")
@_speed
@click.option("--send", is_flag=True, help="Send estimates on the bus, by can/estimates.dbc.")
@click.option(
    "--state",
    type=OutputFile(),
    metavar="FILE",
    help="Go on where FILE was left; it is written every 10 s and at the end.",
)
@click.option(
    "--out", type=OutputFile(), metavar="FILE", help="Lines of JSON.  [default: standard output]"
)
@_positive("--duration", None, "S", "End after so long.")
@_positive("--idle", None, "S", "End when the bus has been silent for so long.")
@click.option("--view", is_flag=True, help="Show estimates in the Rerun viewer.")
def live(bus_options: tuple[str, ...], map_path: Path, out: Path | None, **settings: Any) -> None:
    """Observe a car on its CAN bus until Ctrl-C.

    Each estimate is a line of JSON, and with --send a set of CAN messages. Health follows once a
    second, as JSON and on standard error.
    """
    module = catalogue.live("run")
    task = module.Live(
        map=map_path, options=catalogue.live("bus").options_of(bus_options), **settings
    )
    if out is None:
        module.run(task, module.to_stdout, module.to_stderr)
        return
    with out.open("w", encoding="utf-8", buffering=1) as file:
        module.run(task, lambda text: file.write(text + "\n"), module.to_stderr)


COMMANDS = (replay, live)
