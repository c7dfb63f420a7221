"""All tables and pictures of a reproduction on one page that a browser opens offline."""

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from scenarios.experiment.result import Result, cell, replacing

TEMPLATE = Path(__file__).with_name("report.html")


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
    page = Template(TEMPLATE.read_text(encoding="utf-8")).substitute(
        contents="\n".join(map(_link, sections)),
        sections="\n".join(map(_section, sections)),
    )
    with replacing(path) as partial:
        partial.write_text(page, encoding="utf-8")


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
            *([_image(section.picture, name)] if section.picture else []),
            f'<p class="made">{result.seconds:.1f} s; settings: {_items(result.settings)}; '
            f"versions: {_items(result.versions)}</p>",
            "</section>",
        ]
    )


def _table(result: Result) -> str:
    """The rows of the result, numbers to the right."""
    columns = result.columns()
    numeric = [not all(isinstance(value, str) for value in values) for values in columns.values()]

    def line(tag: str, cells: Sequence[str]) -> str:
        marked = (
            f"<{tag}{' class=number' * is_number}>{escape(cell)}</{tag}>"
            for cell, is_number in zip(cells, numeric, strict=True)
        )
        return f"<tr>{''.join(marked)}</tr>"

    shown = zip(*(map(cell, values) for values in columns.values()), strict=True)
    rows = "\n".join(line("td", cells) for cells in shown)
    return (
        f'<div class="wide"><table>\n<thead>{line("th", list(columns))}</thead>\n'
        f"<tbody>\n{rows}\n</tbody>\n</table></div>"
    )


def _image(png: bytes, name: str) -> str:
    return f'<img alt="{name}" src="data:image/png;base64,{base64.b64encode(png).decode()}">'


def _items(values: Mapping[str, Any]) -> str:
    texts = (
        f"{key} {value if isinstance(value, str) else json.dumps(value, default=str)}"
        for key, value in values.items()
    )
    return escape(", ".join(texts)) or "none"
