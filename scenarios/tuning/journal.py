"""The journal of a tuning: a header and a line of costs per batch, checked before it is believed.

A search feeds the logarithms of the costs to its surrogate and goes on where the journal ends, so a
journal with a wrong number would silently change the gains that are chosen.
"""

import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twin import TwinError

LARGEST = 16_000_000  # bytes; a batch takes some 100
LONGEST_LINE = 100_000  # bytes; a header takes some 100 per gain


def append(journal: Path, header: Mapping[str, Any], costs: Sequence[float]) -> None:
    """Adds a batch to the journal, safe on the disk; JSON has no infinity: null.

    Raises:
        TwinError: the file cannot be written.
    """
    try:
        lines: list[Mapping[str, Any]] = [] if journal.exists() else [header]
        lines.append({"costs": [cost if math.isfinite(cost) else None for cost in costs]})
        with journal.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(line) + "\n" for line in lines)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise TwinError(f"{journal}: cannot be written: {error.strerror}") from error


def read(journal: Path, header: Mapping[str, Any], batch: int, owner: str) -> list[list[float]]:
    """Costs of the batches in a journal; a last line that was cut off is removed.

    Args:
        journal: the file; none is an empty one.
        header: what its first line has to be.
        batch: costs per line.
        owner: name of the tuning, for the message.

    Raises:
        TwinError: the file cannot be read, is damaged, or belongs to another tuning.
    """
    content = _content(journal)
    whole = content[: content.rfind(b"\n") + 1]
    if not whole and not json.dumps(header).encode().startswith(content):
        raise _broken(journal, "line 1 is no header")  # somebody else's file is not removed
    lines = [_parsed(journal, k, line) for k, line in enumerate(whole.splitlines(), 1)]
    if lines and lines[0] != header:
        known = isinstance(lines[0], dict) and lines[0].keys() >= header.keys()
        if not known:
            raise _broken(journal, "line 1 is no header")
        raise TwinError(
            f"{journal}: belongs to another tuning than {owner} within today's bounds; "
            "remove it to start anew"
        )
    costs = [_costs(journal, k, line, batch) for k, line in enumerate(lines[1:], 2)]
    _keep(journal, content, whole)
    return costs


def _content(journal: Path) -> bytes:
    if not journal.exists():
        return b""
    if not journal.is_file():
        raise TwinError(f"{journal}: is no file; allowed: a journal of a tuning, or none")
    try:
        with journal.open("rb") as file:
            content = file.read(LARGEST + 1)
    except OSError as error:
        raise TwinError(f"{journal}: cannot be read: {error.strerror}") from error
    if len(content) > LARGEST:
        raise _broken(journal, f"more than {LARGEST // 1_000_000} MB")
    return content


def _keep(journal: Path, content: bytes, whole: bytes) -> None:
    """Removes a cut-off line from the file, and a file in which no line is whole."""
    try:
        if not whole:
            journal.unlink(missing_ok=True)
        elif whole != content:
            os.truncate(journal, len(whole))
    except OSError as error:
        raise TwinError(f"{journal}: cannot be written: {error.strerror}") from error


def _parsed(journal: Path, number: int, line: bytes) -> Any:
    if len(line) > LONGEST_LINE:
        raise _broken(journal, f"line {number} has more than {LONGEST_LINE} bytes")
    try:
        return json.loads(line.decode())
    except (ValueError, RecursionError, MemoryError):  # foreign bytes, no JSON, nested too deep
        raise _broken(journal, f"line {number} is no JSON") from None


def _costs(journal: Path, number: int, line: object, batch: int) -> list[float]:
    """A batch's costs, each a positive number or, for gains that blow the twin up, null."""
    costs = line.get("costs") if isinstance(line, dict) else None
    if not isinstance(costs, list) or len(costs) != batch:
        raise _broken(journal, f"line {number} has not {batch} costs")
    return [_cost(journal, number, cost) for cost in costs]


def _cost(journal: Path, number: int, cost: object) -> float:
    if cost is None:
        return math.inf
    if isinstance(cost, bool) or not isinstance(cost, int | float):
        raise _broken(journal, f"line {number} has a cost that is no number")
    try:
        value = float(cost)
    except OverflowError:  # an integer of 400 digits
        value = math.inf
    if not 0.0 < value < math.inf:
        raise _broken(journal, f"line {number} has a cost that is not above 0 and finite")
    return value


def _broken(journal: Path, why: str) -> TwinError:
    return TwinError(f"{journal}: is no journal of a tuning, or damaged: {why}; remove it")
