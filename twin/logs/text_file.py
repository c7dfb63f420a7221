"""Bytes of a text file: encoding, lines, and what a power loss leaves behind."""

import codecs
import mmap
from pathlib import Path
from typing import NamedTuple

from twin.errors import TwinError
from twin.logs.raw_log import check_file_size
from twin.toml_file import reason

HEAD = 2**18  # bytes that the rows before the numbers may fill


class TextFile(NamedTuple):
    """A text file, ready to be read from any line of its head.

    Attributes:
        lines: of the head, without line ends.
        offsets: of these lines in `body` [bytes].
        body: all bytes, of `encoding`; None: they are those of the file.
        encoding: "utf-8" or "latin-1".
        notes: sentences about what was taken away.
    """

    lines: list[str]
    offsets: list[int]
    body: bytes | None
    encoding: str
    notes: tuple[str, ...]


def open_text(path: Path) -> TextFile:
    """Looks at a text file.

    Raises:
        TwinError: the file cannot be read or is none.
    """
    check_file_size(path)
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
            body, encoding, notes = None, encoding_of(head), ()
            if encoding.startswith("utf-16"):
                body = (head + file.read()).decode(encoding, "replace").encode()
                body, notes = without_nulls(body)
                encoding, head = "utf-8", body[:HEAD]
            elif _has_nulls(path):
                file.seek(0)
                body, notes = without_nulls(file.read())
                head = body[:HEAD]
    except (OSError, ValueError) as error:
        raise TwinError(f"{path}: cannot be read: {reason(error)}") from error
    lines, offsets = _lines(head, encoding)
    return TextFile(lines, offsets, body, encoding, notes)


def encoding_of(head: bytes) -> str:
    """The encoding of a file by its first bytes."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    pairs = max(len(head) // 2, 1)
    if head[1::2].count(0) > 0.4 * pairs and head[::2].count(0) < 0.1 * pairs:
        return "utf-16-le"
    if head[::2].count(0) > 0.4 * pairs and head[1::2].count(0) < 0.1 * pairs:
        return "utf-16-be"
    try:
        head.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if len(head) < HEAD or error.start < len(head) - 4:
            return "latin-1"
    return "utf-8"


def _has_nulls(path: Path) -> bool:
    if path.stat().st_size == 0:
        return False
    with (
        path.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content,
    ):
        return content.find(b"\0") >= 0


def without_nulls(body: bytes) -> tuple[bytes, tuple[str, ...]]:
    """Text without null characters at its end and without lines that have some; a sentence.

    Raises:
        ValueError: it is mostly null characters, or no text.
    """
    kept = body.rstrip(b"\0")
    notes = [f"{len(body) - len(kept)} null characters at the end are left out."]
    notes = notes if len(kept) < len(body) else []
    if b"\0" in kept:
        lines = kept.splitlines(keepends=True)
        good = [line for line in lines if b"\0" not in line]
        if len(good) < 0.5 * len(lines):
            raise ValueError("it has null characters; allowed: text")
        notes.append(f"{len(lines) - len(good)} lines with null characters are left out.")
        kept = b"".join(good)
    return kept, tuple(notes)


def _lines(head: bytes, encoding: str) -> tuple[list[str], list[int]]:
    """Lines of the head and where they start; the last one may be cut and is left out."""
    start = len(codecs.BOM_UTF8) if head.startswith(codecs.BOM_UTF8) else 0
    lines, offsets, place = [], [], start
    for line in head[start:].splitlines(keepends=True):
        lines.append(line.decode(encoding, "replace").rstrip("\r\n"))
        offsets.append(place)
        place += len(line)
    if len(head) == HEAD and len(lines) > 1:
        lines.pop()
        offsets.pop()
    return lines, offsets
