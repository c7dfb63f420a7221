"""How a command gives its result: a table or JSON on standard output, JSON in a file."""

from pathlib import Path
from typing import Any

import click

from scenarios.cli.options import STANDARD_OUTPUT
from scenarios.experiment.result import Result, json_text, write_json


def report(result: Result, json_path: Path | None, text: str | None = None) -> None:
    """Shows the text, or the rows if there is none, and saves the rows."""
    if json_path != STANDARD_OUTPUT:
        print_table(result, text)
    save(result.to_json(), json_path)


def show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Shows a warning about a user's file as one line, as errors are shown.

    Args:
        message: what it says.
        category: its kind; one that is not about a user's file is named.
    """
    kind = "" if category.__name__ == "TwinWarning" else f"{category.__name__}: "
    click.echo("til: note: " + kind + " ".join(str(message).split()), err=True)


def print_table(result: Result, text: str | None = None) -> None:
    """Shows the text, or the rows if there is none, under the result's name."""
    click.echo(f"{result.name} ({result.seconds:.1f} s)\n{text or result.table()}")
    for sentence in result.settings.get("notes", ()):
        click.echo(sentence)


def save(data: dict[str, Any], json_path: Path | None) -> None:
    """Writes JSON to a file or standard output, if it is asked for."""
    if json_path == STANDARD_OUTPUT:
        click.echo(json_text(data))
    elif json_path:
        write_json(data, json_path)
