"""A field of a TOML file: one entry for the template, the check and the manual."""

from collections.abc import Iterable
from typing import NamedTuple

from twin.toml_file import Table


class Field(NamedTuple):
    """One field: its unit, default, range and meaning.

    A number whose default is NaN has none: the file must have it.
    """

    name: str
    unit: str
    default: float | str
    least: float
    largest: float
    text: str


def read_numbers(table: Table, fields: Iterable[Field]) -> dict[str, float]:
    """The numbers of a table by field, defaults where they are left out.

    Args:
        table: of the file.
        fields: all that it may have, numbers only.

    Raises:
        TwinError: a field is no number, out of range, or missing and without a default.
    """
    return {
        field.name: table.number(field.name, float(field.default), field.least, field.largest)
        for field in fields
    }
