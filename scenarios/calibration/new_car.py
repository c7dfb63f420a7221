"""Writes the file of a new car or tyre from the few figures that people know."""

from pathlib import Path

from twin import TwinError
from twin.car.rules import Figures
from twin.car.template import write_new, write_template
from twin.tyre.size import parse_size, tyre_text


def new_car(name: str, given: dict[str, float], tyre: str | None, load_index: int | None) -> Path:
    """Writes NAME.toml, and NAME.tir if the tyre is known.

    Args:
        name: of the car.
        given: fields of `twin.car.rules.Figures` by name.
        tyre: size of both axles' tyres.
        load_index: of the tyre, where the size has none.

    Returns:
        The path of the car's file.

    Raises:
        TwinError: a figure is that of no car, or a file is there already.
    """
    if not given and tyre is None:
        return write_template(name)
    size = parse_size(tyre, load_index) if tyre else None
    return write_template(name, Figures(**given, tyre=size, known=frozenset(given)))


def new_tyre(size: str, load_index: int | None, path: Path | None) -> Path:
    """Writes the .tir file of a tyre of that size; returns its path.

    Args:
        size: as 205/55R16.
        load_index: where the size has none.
        path: of the file; None: named after the size.

    Raises:
        TwinError: it is no size of a tyre, or the file is there already.
    """
    parsed = parse_size(size, load_index)
    short = "".join(size.split()).replace("/", "_").lower()
    path = path or Path(f"{short}.tir")
    if path.suffix != ".tir":
        raise TwinError(f"{path}: is the name of no tyre file; allowed: one that ends in .tir")
    write_new(path, tyre_text(parsed, size))
    return path
