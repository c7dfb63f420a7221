"""The file formats of logs and drives, by the ending of the file's name."""

from importlib import import_module
from pathlib import Path
from types import ModuleType

from twin.errors import TwinError

FORMATS = {
    ".parquet": "twin.logs.parquet",
    ".csv": "twin.logs.csv",
    **dict.fromkeys((".txt", ".tsv", ".log", ".dat"), "twin.logs.csv"),
    ".mf4": "twin.logs.mdf",
    ".mcap": "twin.logs.mcap",
    ".mat": "twin.logs.mat",
    ".vbo": "twin.logs.vbo",
    **dict.fromkeys((".xrk", ".xrz"), "twin.logs.aim"),
}


def format_of(path: str | Path) -> ModuleType:
    """The module that reads and writes files like this one.

    Raises:
        TwinError: the name ends in nothing we know.
    """
    ending = Path(path).suffix.lower()
    if ending not in FORMATS:
        raise TwinError(f"{path}: name ends in {ending!r}; allowed: {', '.join(FORMATS)}")
    return import_module(FORMATS[ending])
