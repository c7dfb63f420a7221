"""The text of a tyre property file as sections of KEY = value, and what of it was read."""

import math
from pathlib import Path
from typing import NoReturn

from twin.errors import TwinError
from twin.tyre.tir_keys import ANY, CURVE, HARMLESS, LIMITS, QUIET_SECTIONS, SECTIONS

LARGEST_FILE = 1_000_000  # bytes; real files have some 20 kB
_MOST_NAMED = 12  # keys in a message


class TirFile:
    """The entries of the known sections, and which of them the reader has asked for.

    Attributes:
        path: the file.
        values: by (section, key), both in upper case; an empty value counts as missing.
        curve: rows (penetration [m], load [N]) of [DEFLECTION_LOAD_CURVE].
        unknown: names of sections that no tyre property file has.
        missing: what was asked for in vain, by section; None for the whole section.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = path
        self.values: dict[tuple[str, str], str] = {}
        self.curve: list[tuple[float, float]] = []
        self.unknown: list[str] = []
        self.missing: dict[str, list[str] | None] = {}
        self._used: set[tuple[str, str]] = set()
        self._read(_text(path))

    def has(self, section: str, key: str) -> bool:
        """Whether the file has a value there that is not empty."""
        return bool(self.values.get((section, key)))

    def word(self, section: str, key: str, default: str | None = None) -> str:
        """The value as text; where it is missing and has no default, an empty text."""
        self._used.add((section, key))
        if (section, key) in self.values and (self.has(section, key) or default is None):
            return self.values[section, key]
        if default is None:
            self._miss(section, key)
        return default or ""

    def number(
        self,
        section: str,
        key: str,
        default: float | None = None,
        limits: tuple[float, float] | None = None,
    ) -> float:
        """The value as a number within limits; where it is missing, the default or NaN."""
        word = self.word(section, key, None if default is None else "")
        if not word and (section, key) not in self.values:
            return math.nan if default is None else default
        if not word and default is not None:
            return default
        least, largest = limits or LIMITS.get(key, ANY)
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not least <= value <= largest:
            allowed = f"a number from {least:g} to {largest:g}"
            if key == "PKY1":
                allowed += " (ISO-W sign: a positive slip angle gives a negative lateral force)"
            self.refuse(f"[{section}] {key} = {word[:40]!r}, allowed is {allowed}")
        return value

    def check_missing(self) -> None:
        """Raises the TwinError that names everything that is missing at once."""
        if not self.missing:
            return
        parts = [
            f"[{section}]" if keys is None else f"[{section}] {', '.join(keys)}"
            for section, keys in self.missing.items()
        ]
        several = len(parts) > 1 or "," in parts[0]
        self.refuse(f"{'; '.join(parts)} {'are' if several else 'is'} missing")

    def unused(self) -> str:
        """What the file holds and the tyre model does not use, in words; empty if nothing."""
        keys = [
            f"[{section}] {key[:40]}"
            for (section, key), value in self.values.items()
            if (section, key) not in self._used and key not in HARMLESS.get(section, ())
            if not _is_neutral(section, value)
        ]
        sections = [f"[{name[:40]}]" for name in self.unknown]
        named = [*sections, *keys]
        more = f" and {len(named) - _MOST_NAMED} more" if len(named) > _MOST_NAMED else ""
        return ", ".join(named[:_MOST_NAMED]) + more

    def refuse(self, what: str) -> NoReturn:
        """Raises a TwinError about the file."""
        raise TwinError(f"{str(self.path)!r}: {what}")

    def _miss(self, section: str, key: str) -> None:
        known = any(place[0] == section for place in self.values)
        keys = self.missing.setdefault(section, [] if known else None)
        if keys is not None:
            keys.append(key)

    def _read(self, text: str) -> None:
        section = ""
        lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")  # not at 0x85
        for number, line in enumerate(lines, start=1):
            line = _without_comment(line).strip()
            if line.startswith("["):
                section = line.strip("[] \t").upper()
                if section not in SECTIONS and section not in QUIET_SECTIONS:
                    self.unknown.append(section)
            elif line and section == CURVE:
                self._read_row(line)
            elif line and section in SECTIONS:
                self._read_entry(section, line, number)

    def _read_row(self, line: str) -> None:
        """Reads a row of the curve; the row of its names, {pen fz}, is passed over."""
        try:
            penetration, load = (float(word) for word in line.split())
        except ValueError:
            if not line.startswith("{"):
                self.refuse(f"[{CURVE}] has a row {line[:40]!r}, allowed are two numbers")
            return
        last = self.curve[-1] if self.curve else (-math.inf, -math.inf)
        if not (last[0] < penetration < 10.0 and last[1] <= load < 1e7):
            self.refuse(f"[{CURVE}] has a row {line[:40]!r}, allowed are rising numbers")
        self.curve.append((penetration, load))

    def _read_entry(self, section: str, line: str, number: int) -> None:
        key, equals, value = line.partition("=")
        place = (section, key.strip().upper())
        if not equals:
            self.refuse(f"line {number}: {line[:40]!r} in [{section}] is not KEY = value")
        if place in self.values:
            self.refuse(f"line {number}: [{section}] {place[1][:40]!r} is given twice")
        self.values[place] = value.strip().strip("'\"").strip()


def _is_neutral(section: str, value: str) -> bool:
    """Whether a known key of this value would change nothing: 0, or a scaling factor of 1."""
    try:
        return float(value) == (1.0 if section == "SCALING_COEFFICIENTS" else 0.0)
    except ValueError:
        return not value


def _text(path: str | Path) -> str:
    """Returns the text of the file; every byte is a character of latin-1, so this never fails."""
    try:
        with Path(path).open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = getattr(error, "strerror", None) or error
        raise TwinError(f"{str(path)!r}: cannot read the tyre file: {reason}") from error
    if len(content) > LARGEST_FILE:
        raise TwinError(
            f"{str(path)!r}: larger than {LARGEST_FILE} bytes, which no tyre property file is"
        )
    return content.decode("latin-1")


def _without_comment(line: str) -> str:
    """Returns the line up to the first $ or ! that stands outside quotes."""
    quote = ""
    for position, character in enumerate(line):
        if quote:
            quote = "" if character == quote else quote
        elif character in "'\"":
            quote = character
        elif character in "$!":
            return line[:position]
    return line
