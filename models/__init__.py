"""Data of the project: cars as MJCF or TOML files and tyres as .tir files, found by name."""

from pathlib import Path

FOLDER = Path(__file__).parent


def path(name: str) -> Path:
    """Returns the file of a car ("suv", "bmw_i3") or tyre ("tyres/suv.tir") of the project.

    The name of a file that lies elsewhere is returned as it is, so that a user's own model takes
    the same path as ours.

    Args:
        name: a name within this folder, the ending .xml or .toml may be left out, or any path.
    """
    for candidate in (FOLDER / name, FOLDER / f"{name}.xml", FOLDER / f"{name}.toml"):
        if candidate.is_file():
            return candidate
    return Path(name)
