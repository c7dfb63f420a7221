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


def print_table(result: Result, text: str | None = None) -> None:
    """Shows the text, or the rows if there is none, under the result's name."""
    click.echo(f"{result.name} ({result.seconds:.1f} s)\n{text or result.table()}")
    for sentence in result.settings.get("report", ()):
        click.echo(sentence)


def save(data: dict[str, Any], json_path: Path | None) -> None:
    """Writes JSON to a file or standard output, if it is asked for."""
    if json_path == STANDARD_OUTPUT:
        click.echo(json_text(data))
    elif json_path:
        write_json(data, json_path)
