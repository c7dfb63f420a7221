"""How the variables of an FMU are called in this project."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from twin.errors import TwinError

_TABLES = ("inputs", "outputs", "states", "parameters")


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuNames:
    """Our names to those of an FMU's variables, which are in our axes and units.

    Attributes:
        dt: communication step [s].
        inputs: what is set before each step, such as `{"steering_wheel_angle": "angle"}`.
        outputs: what is measured.
        states: what an observer may correct.
        parameters: what an observer may estimate; ours are the changes from what the FMU starts
            with.
        speed: what the speed at the start is set to, if the FMU has it.

    Raises:
        TwinError: a name or the step is not as above, or there are no outputs.
    """

    dt: float
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    states: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, str] = field(default_factory=dict)
    speed: str | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.dt, int | float) or not 0.0 < self.dt < 10.0:
            raise TwinError(f"names of an FMU: dt is {self.dt!r}; allowed: 0 to 10 s")
        for table in _TABLES:
            names = getattr(self, table)
            if not isinstance(names, Mapping):
                raise TwinError(f"names of an FMU: {table} is {names!r}; allowed: a table of names")
            for ours, theirs in names.items():
                if not isinstance(theirs, str):
                    raise TwinError(
                        f"names of an FMU: {table}.{ours} is {theirs!r}; allowed: a variable's name"
                    )
        if not self.outputs:
            raise TwinError("names of an FMU: outputs is empty; allowed: at least one")

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Reads a TOML file with the keys `dt` and `speed` and a table for each kind of variable.

        Raises:
            TwinError: the file is missing, no TOML, or lacks or has too many keys.
        """
        try:
            content: dict[str, Any] = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise TwinError(f"{path}: cannot be read as TOML: {error}") from error
        known = ("dt", "speed", *_TABLES)
        missing = [key for key in ("dt", "inputs", "outputs") if key not in content]
        unknown = [key for key in content if key not in known]
        if missing or unknown:
            raise TwinError(
                f"{path}: lacks {missing}, has unknown {unknown}; allowed keys: {', '.join(known)}"
            )
        try:
            return cls(**content)
        except TwinError as error:
            raise TwinError(f"{path}: {error}") from error
