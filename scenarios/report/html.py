"""All tables and pictures of a reproduction on one page that a browser opens offline."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from scenarios.experiment.result import Result, cell
from scenarios.report.page import image, items, table, write_page

TITLE = "Tables and figures of the papers, beside ours"


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """One result on the page.

    Attributes:
        result: with the rows of the table.
        summary: one line for people.
        picture: a PNG file, if there is one.
    """

    result: Result
    summary: str
    picture: bytes | None


class PictureOf:
    """Tells whether a result draws its picture, which by convention is `folder/<name>.png`.

    One that an earlier run left there does not count.
    """

    def __init__(self, folder: Path, name: str):
        self._path = folder / f"{name}.png"
        self._before = self._stamp()

    def read(self) -> bytes | None:
        """The picture, if it was written since."""
        now = self._stamp()
        return None if now in (None, self._before) else self._path.read_bytes()

    def _stamp(self) -> tuple[int, int] | None:
        """Which file it is and when it was written."""
        if not self._path.is_file():
            return None
        status = self._path.stat()
        return status.st_ino, status.st_mtime_ns


def write_report(sections: Sequence[Section], path: Path) -> None:
    """Writes the page, whole or not at all."""
    contents = "\n".join(map(_link, sections))
    write_page(path, TITLE, [f"<ul>\n{contents}\n</ul>", *map(_section, sections)])


def _link(section: Section) -> str:
    name = escape(section.result.name)
    return f'<li><a href="#{name}">{name}</a>: {escape(section.summary)}</li>'


def _section(section: Section) -> str:
    result = section.result
    name = escape(result.name)
    return "\n".join(
        [
            f'<section id="{name}">',
            f"<h2>{name}</h2>",
            f"<p>{escape(section.summary)}</p>",
            _table(result),
            *([image(section.picture, name)] if section.picture else []),
            f'<p class="made">{result.seconds:.1f} s; settings: {items(result.settings)}; '
            f"versions: {items(result.versions)}</p>",
            "</section>",
        ]
    )


def _table(result: Result) -> str:
    columns = result.columns()
    numeric = [not all(isinstance(value, str) for value in values) for values in columns.values()]
    rows = zip(*(map(cell, values) for values in columns.values()), strict=True)
    return table(list(columns), rows, numeric)
