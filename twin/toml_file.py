"""TOML files of people: read within bounds, and every field checked in words."""

import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from twin.errors import TwinError

LARGEST_FILE = 100_000  # bytes; a map or a car has some 5 kB
_SHOWN = 40  # characters of a value in a message


def read_toml(path: str | Path) -> "Table":
    """The content of a TOML file.

    Raises:
        TwinError: the file cannot be read, is too large, or is no TOML.
    """
    try:
        if Path(path).exists() and not Path(path).is_file():
            raise TwinError(f"{path}: is a folder, pipe or device; allowed: a file")
        with Path(path).open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise TwinError(f"{path}: cannot be read: {reason(error)}") from error
    if len(content) > LARGEST_FILE:
        raise TwinError(f"{path}: has more than {LARGEST_FILE} bytes, the largest allowed")
    try:
        return Table(path, "", tomllib.loads(content.decode()))
    except (ValueError, RecursionError) as error:
        raise TwinError(f"{path}: is no TOML: {reason(error)}") from error


class Table:
    """A table of a TOML file that knows where it stands, to say so in messages.

    Attributes:
        path: the file.
        place: dotted name of the table; empty for the whole file.
        values: its content.
    """

    def __init__(self, path: str | Path, place: str, values: Mapping[str, Any]) -> None:
        self.path, self.place, self.values = path, place, values

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def check_keys(self, allowed: Iterable[str]) -> None:
        """Raises TwinError for the first key that is not allowed."""
        allowed = tuple(allowed)
        for key in self.values:
            if key not in allowed:
                raise TwinError(
                    f"{self.path}: {self._name(key)} is unknown; allowed: {', '.join(allowed)}"
                )

    def table(self, key: str) -> "Table":
        """The table of that name, empty if it is not there."""
        values = self.values.get(key, {})
        if not isinstance(values, dict):
            self.refuse(key, "a table")
        return Table(self.path, self._name(key), values)

    def tables(self) -> Iterable[tuple[str, "Table"]]:
        """All keys and the tables that they must be."""
        return ((key, self.table(key)) for key in self.values)

    def number(
        self, key: str, default: float, least: float = -math.inf, largest: float = math.inf
    ) -> float:
        """A finite number within bounds."""
        value = self.values.get(key, default)
        good = isinstance(value, int | float) and not isinstance(value, bool)
        # compared as they are: an integer of TOML may be too large for a float
        if not (good and least <= value <= largest and abs(value) < 1e300):
            bounds = f" from {least:g} to {largest:g}" if least > -math.inf else ""
            self.refuse(key, f"a number{bounds}")
        return float(value)

    def text(self, key: str, default: str | None = None) -> str | None:
        """A text that is not empty."""
        value = self.values.get(key, default)
        if value is not None and not (isinstance(value, str) and value):
            self.refuse(key, "a text")
        return value

    def choice(self, key: str, default: str, allowed: Iterable[str]) -> str:
        """One of several texts."""
        value = self.values.get(key, default)
        if value not in (allowed := tuple(allowed)):
            self.refuse(key, ", ".join(allowed))
        return value

    def flag(self, key: str) -> bool:
        """True or false; false if it is not there."""
        value = self.values.get(key, False)
        if not isinstance(value, bool):
            self.refuse(key, "true or false")
        return value

    def refuse(self, key: str, allowed: str) -> NoReturn:
        """Raises the TwinError about a key's value."""
        if key not in self.values:
            raise TwinError(f"{self.path}: {self._name(key)} is missing; allowed: {allowed}")
        raise TwinError(
            f"{self.path}: {self._name(key)} is {shown(self.values[key])}; allowed: {allowed}"
        )

    def _name(self, key: str) -> str:
        key = key if key.isidentifier() and len(key) < _SHOWN else shown(key)
        return f"{self.place}.{key}" if self.place else key


def shown(value: object) -> str:
    """A value in a message, in one line and not too long."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits; deep nesting
        text = f"a {type(value).__name__} too long to show"
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


def reason(error: Exception) -> str:
    """The first line of what an exception says, or its kind."""
    text = getattr(error, "strerror", None) or str(error)
    return text.splitlines()[0] if text else type(error).__name__
