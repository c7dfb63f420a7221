"""The TOML file of a new car: every field with its unit, range and a value."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from twin.car.fields import SECTIONS
from twin.car.rules import Figures, derived, settled
from twin.errors import TwinError
from twin.logs.car_signals import TEMPLATE
from twin.toml_fields import Field
from twin.toml_file import reason
from twin.tyre.size import tyre_text


def write_template(name: str, figures: Figures | None = None) -> Path:
    """Writes NAME.toml, every field with its unit, range and value; returns its path.

    Args:
        name: of the car.
        figures: what is known of it; the rest follows by the rules of `twin.car.rules`. A tyre
            of these figures is written beside it as NAME.tir. None: all values are the SUV's.

    Raises:
        TwinError: there is such a file already, or it cannot be written.
    """
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if figures and figures.tyre:
        write_new(path, template(path.stem, figures))
        try:
            write_new(path.with_suffix(".tir"), tyre_text(figures.tyre, path.stem))
        except TwinError:
            path.unlink()
            raise
    else:
        write_new(path, template(path.stem, figures))
    return path


def write_new(path: Path, text: str) -> None:
    """Writes a file that must not be there yet.

    Raises:
        TwinError: there is such a file already, or it cannot be written.
    """
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise TwinError(f"{path}: is there already; allowed: a name that is not taken") from error
    except (OSError, ValueError) as error:
        raise TwinError(f"{path}: cannot be written: {reason(error)}") from error


def template(title: str, figures: Figures | None = None) -> str:
    """The text of a car's file: all defaults, which are the SUV's, or derived from figures.

    Values that nobody gave are repeated in the table `guessed`: one that is changed above it is no
    guess any more, see `twin.car.guesses`.
    """
    rules = {} if figures is None else {k: float(f"{v:.5g}") for k, v in derived(figures).items()}
    tyre = f"{title}.tir" if figures and figures.tyre else None
    lines = [
        f"# {title}: a car for `til ... --vehicle {title}.toml`. SI units; axes of ISO 8855 (x",
        "# forward, y left, z up). A field that is left out has the value it has here.",
    ]
    for section in SECTIONS:
        lines += ["", f"[{section.name}]", *(f"# {line}" for line in section.text if line)]
        for field in section.fields:
            value = rules.get((section.name, field.name), field.default)
            if tyre and isinstance(value, str):
                value = tyre
            lines.append(_line(field._replace(default=value), section.optional))
    if figures is not None:
        lines += ["", "# By rule, not by you: a field above that still has this value is a guess."]
        lines += [
            "[guessed]",
            *(f'"{name}" = {value!r}' for name, value in _guessed(figures, rules)),
        ]
    return "\n".join(lines) + "\n" + TEMPLATE


def _guessed(
    figures: Figures, rules: Mapping[tuple[str, str], float]
) -> Iterator[tuple[str, float]]:
    """The fields that no known figure settles, and their values."""
    known = settled(figures)
    for section in SECTIONS:
        if section.optional:
            continue
        for field in section.fields:
            if (section.name, field.name) not in known:
                value = rules.get((section.name, field.name), field.default)
                yield f"{section.name}.{field.name}", float(value)


def _line(field: Field, optional: bool) -> str:
    if isinstance(field.default, str):
        return f'{field.name} = "{field.default}"  # {field.text}'
    unit = "" if field.unit == "1" else f" {field.unit}"
    text = f"; {field.text}" if field.text else ""
    assignment = f"{'# ' if optional else ''}{field.name} = {field.default!r}"
    return f"{assignment:34}# {field.least:g} to {field.largest:g}{unit}{text}"
