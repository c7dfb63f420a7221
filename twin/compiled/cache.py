"""Keys the cache of compiled code by the source of everything that a function can call.

numba compares a cached function with its own file only; an edited file that it calls would keep
running as before. Here the key is a hash of the file and of all files of the project that it
imports, directly or not.
"""

import glob
import hashlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core import caching

config: Any = numba.config  # pyright: ignore[reportPrivateImportUsage]
ROOT = Path(__file__).parents[2]
_IMPORT = re.compile(r"^from ([\w.]+) import (?:\(([^)]*)\)|(.+))$|^import ([\w., ]+)$", re.M)


class SourceTreeLocator(caching.InTreeCacheLocator):  # pyright: ignore[reportAttributeAccessIssue]
    """Caches beside the source file, as numba does, for files of this project only."""

    _py_file: str

    def get_source_stamp(self) -> bytes:
        """A hash of all sources that decide the machine code."""
        return stamp(Path(self._py_file), ROOT)

    def get_disambiguator(self) -> str:
        """A part of the files' names: numba unpickles an index before it compares its stamp.

        That of an older source may name classes that are no more.
        """
        return f"{super().get_disambiguator()}-{self.get_source_stamp().hex()[:16]}"

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        """Leaves files of other projects to numba's own locators."""
        inside = Path(py_file).is_relative_to(ROOT) and (ROOT / py_file).suffix == ".py"
        found = super().from_function(py_func, py_file) if inside else None
        if found is not None:
            found.prune(f"{Path(py_file).stem}.{py_func.__qualname__}-")
        return found

    def prune(self, start: str) -> None:
        """Removes what is cached of older sources of a function."""
        start = re.sub("[<>]", "", start)
        current = f"{start}{self.get_disambiguator()}."
        for file in Path(self.get_cache_path()).glob(f"{glob.escape(start)}*.nb[ic]"):
            if not file.name.startswith(current):
                file.unlink(missing_ok=True)


def install() -> None:
    """Puts the locator before numba's own, unless the user has chosen others."""
    if not config.CACHE_LOCATOR_CLASSES and not config.CACHE_DIR:
        own = f"{SourceTreeLocator.__module__}.{SourceTreeLocator.__name__}"
        usual = (locator.__name__ for locator in caching.CacheImpl._locator_classes)
        config.CACHE_LOCATOR_CLASSES = ",".join([own, *usual])


def stamp(file: Path, root: Path) -> bytes:
    """A hash of a source file and of all that it imports from below a root folder."""
    todo, seen = [file], {file}
    while todo:
        found = set(_imported(todo.pop(), root)) - seen
        seen |= found
        todo += found
    digest = hashlib.sha256()
    for path in sorted(seen):
        digest.update(_source(path, path.stat().st_mtime_ns).encode())
    return digest.digest()


@cache
def _source(path: Path, _modified: int) -> str:
    return path.read_text(encoding="utf-8")


def _imported(file: Path, root: Path) -> Iterator[Path]:
    """Files below the root that a file imports at its top level."""
    for module, names in _imports(_source(file, file.stat().st_mtime_ns)):
        for name in names or [""]:
            yield from _files(module, name, root)


def _imports(source: str) -> Iterator[tuple[str, list[str]]]:
    """Modules that are imported, each with the names taken from it."""
    for module, listed, line, plain in _IMPORT.findall(source):
        names = re.sub(r"#.*", "", listed or line)
        if module:
            yield module, [name.split()[0] for name in names.split(",") if name.strip()]
        for name in plain.split(","):
            if name.strip():
                yield name.split()[0], []


def _files(module: str, name: str, root: Path) -> Iterator[Path]:
    """The file of a module, or what its package takes the name from."""
    folder = root.joinpath(*module.split("."))
    if (file := folder.with_suffix(".py")).is_file():
        yield file
    elif (package := folder / "__init__.py").is_file():
        if name and ((folder / f"{name}.py").is_file() or (folder / name).is_dir()):
            yield from _files(f"{module}.{name}", "", root)
            return
        source = _source(package, package.stat().st_mtime_ns)
        lazily = re.findall(rf'"{name}": "([\w.]+)"', source) if name else []
        for origin in (*(m for m, names in _imports(source) if name in names), *lazily):
            yield from _files(origin, name, root)
