"""Reads MJCF files of strangers: bounded, without entities and without other files."""

from collections.abc import Mapping
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

import mujoco

import models
from twin.errors import TwinError
from twin.toml_file import reason, shown

LARGEST_FILE = 1_000_000  # bytes; the cars of the project have 10 kB
DEEPEST = 100  # elements within each other
# What takes content from elsewhere, or multiplies what is there
_REFUSED = {
    *("include", "plugin", "extension", "attach", "model", "replicate", "composite", "flexcomp"),
    *("flex", "size", "hfield", "skin"),
}
_LARGEST_IMAGE = 4096  # pixels of a generated texture along each side
_MOST_PIXELS = 20_000_000  # of all textures together
_MOST_ELEMENTS = 2000  # a car of the project has 150; MuJoCo's time grows with their square
_MOST_NUMBERS = 60_000  # of all meshes together, three a vertex
# Attributes by which an element takes memory that its text does not show, and the most allowed
_COUNTS = {"dim": 1000, "nsample": 1000, "num": 1000, "resolution": 4096}


def read_mjcf(path: Path) -> mujoco.MjSpec:
    """The model of an MJCF file that stands for itself: all it needs is in it.

    Raises:
        TwinError: the file cannot be read, is too large, names another file, or is no MJCF.
    """
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        raise TwinError(f"{path}: cannot be read: {reason(error)}") from error
    if len(content) > LARGEST_FILE:
        raise TwinError(f"{path}: has more than {LARGEST_FILE} bytes, the largest allowed")
    _check(path, content)
    try:
        return mujoco.MjSpec.from_string(content.decode())
    except UnicodeDecodeError as error:
        raise TwinError(f"{path}: is not in UTF-8, the only encoding allowed") from error
    except (ValueError, mujoco.FatalError) as error:
        raise TwinError(f"{path}: {' '.join(str(error).split())}") from None


def tyre_path(path: Path, name: str) -> Path:
    """The file that a tyre's name in a car's file means: one beside it, or one of the project.

    Raises:
        TwinError: the name leads out of the car's folder.
    """
    given = Path(name)
    if given.is_absolute() or ".." in given.parts or "\0" in name or "\\" in name:
        raise TwinError(
            f"{path}: tyre is {shown(name)}; allowed: a file in the car's folder or below it"
        )
    beside = path.parent / given
    return beside if beside.is_file() else models.path(name)


def _check(path: Path, content: bytes) -> None:
    """Walks through the elements; MuJoCo sees only what passes."""
    depth, elements, pixels, numbers = 0, 0, 0, 0

    def refuse(what: str) -> NoReturn:
        raise TwinError(f"{path}: line {parser.CurrentLineNumber}: {what}")

    def start(name: str, attributes: Mapping[str, str]) -> None:
        nonlocal depth, elements, pixels, numbers
        depth, elements = depth + 1, elements + 1
        if elements > _MOST_ELEMENTS:
            refuse(f"has more than {_MOST_ELEMENTS} elements, the most allowed")
        if depth > DEEPEST:
            refuse(f"elements are nested deeper than {DEEPEST}, the most allowed")
        if name in _REFUSED:
            refuse(f"element {name!r} is not allowed: a car's file stands for itself")
        for key, value in attributes.items():
            if key.startswith("file") or (name == "compiler" and key.endswith("dir")):
                refuse(f"{name} {key} = {shown(value)} is not allowed: it leads to another file")
            if name == "texture" and key in ("width", "height"):
                _check_count(refuse, f"texture {key}", value, _LARGEST_IMAGE)
            if name in ("numeric", "user") and key == "size":
                _check_count(refuse, f"{name} size", value, 1000)
            if key in _COUNTS:
                for word in value.split():
                    _check_count(refuse, f"{name} {key}", word, _COUNTS[key])
            if name == "compiler" and key == "usethread":
                refuse("compiler usethread is not allowed")
            if name == "mesh" and key == "builtin":
                refuse(f"mesh builtin = {shown(value)} is not allowed: give its vertices")
            numbers += value.count(" ") + value.count("\n") + 1 if name == "mesh" else 0
        if name == "texture":
            pixels += _pixels(attributes)
        if pixels > _MOST_PIXELS:
            refuse(f"textures have more than {_MOST_PIXELS} pixels together, the most allowed")
        if numbers > _MOST_NUMBERS:
            refuse(f"meshes have more than {_MOST_NUMBERS} numbers together, the most allowed")

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    def doctype(*_: object) -> None:
        refuse("DOCTYPE and entities are not allowed")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(content, True)
    except (expat.ExpatError, ValueError, LookupError) as error:  # the latter: unknown encodings
        raise TwinError(f"{path}: is no XML: {reason(error)}") from error


def _pixels(attributes: Mapping[str, str]) -> int:
    """How many pixels a texture has at most; its width and height are checked numbers."""
    width, height = (int(attributes.get(key, "0")) for key in ("width", "height"))
    is_flat = attributes.get("type", "cube").strip() == "2d"  # others have six sides
    channels = attributes.get("nchannel", "3").strip()
    factor = 1 if channels in ("1", "2", "3", "4") else _MOST_PIXELS
    return factor * max(width, 1) * (max(height, 1) if is_flat else max(height, 6 * width))


def _check_count(refuse, what: str, value: str, largest: int) -> None:
    if not (value.strip().isdecimal() and int(value.strip()[:10]) <= largest):
        refuse(f"{what} is {shown(value)}; allowed: 0 to {largest}")
