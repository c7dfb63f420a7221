"""One HTML page that a browser opens offline: its frame, tables, pictures and lists."""

import base64
import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from scenarios.experiment.result import replacing

TEMPLATE = Path(__file__).with_name("report.html")


def write_page(path: Path, title: str, body: Iterable[str]) -> None:
    """Writes a page, whole or not at all.

    Args:
        path: of the page.
        title: of the browser's window, and the heading.
        body: pieces of HTML.
    """
    template = Template(TEMPLATE.read_text(encoding="utf-8"))
    page = template.substitute(title=escape(title), body="\n".join(body))
    with replacing(path) as partial:
        partial.write_text(page, encoding="utf-8")


def table(header: Sequence[str], rows: Iterable[Sequence[str]], numeric: Sequence[bool]) -> str:
    """A table, numbers to the right, which scrolls where the screen is narrower.

    Args:
        header: of n columns.
        rows: of n cells.
        numeric: (n,) whether a column holds numbers.
    """

    def line(tag: str, cells: Sequence[str]) -> str:
        marked = (
            f"<{tag}{' class=number' * is_number}>{escape(cell)}</{tag}>"
            for cell, is_number in zip(cells, numeric, strict=True)
        )
        return f"<tr>{''.join(marked)}</tr>"

    lines = "\n".join(line("td", cells) for cells in rows)
    return (
        f'<div class="wide"><table>\n<thead>{line("th", header)}</thead>\n'
        f"<tbody>\n{lines}\n</tbody>\n</table></div>"
    )


def image(content: bytes, words: str, kind: str = "png") -> str:
    """A picture within the page.

    Args:
        content: of the picture's file.
        words: for those who do not see it.
        kind: png or svg+xml.
    """
    data = base64.b64encode(content).decode()
    return f'<img alt="{escape(words)}" src="data:image/{kind};base64,{data}">'


def listed(sentences: Iterable[str]) -> str:
    """A list of sentences."""
    return "<ul>\n" + "\n".join(f"<li>{escape(one)}</li>" for one in sentences) + "\n</ul>"


def items(values: Mapping[str, Any]) -> str:
    """Names and values in one line of text."""
    texts = (
        f"{key} {value if isinstance(value, str) else json.dumps(value, default=str)}"
        for key, value in values.items()
    )
    return escape(", ".join(texts)) or "none"
