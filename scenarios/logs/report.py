"""The report on a log, `til estimate`'s page for people: one HTML file that opens offline."""

import importlib.util
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.experiment.result import versions
from scenarios.logs.answer import Answer, Quantity
from scenarios.logs.answer_text import headlines, interval, number, signed
from scenarios.logs.checks import checks
from scenarios.logs.estimators import Found
from scenarios.logs.findings import findings
from scenarios.logs.report_pictures import pictures
from scenarios.report.page import image, items, listed, table, write_page
from twin import Drive, Vehicle

MISSING = "no report: its pictures need matplotlib: pip install -e '.[plots]' in the project"


def possible() -> bool:
    """Whether there is what draws the pictures."""
    return importlib.util.find_spec("matplotlib") is not None


def write_log_report(
    path: Path,
    *,
    found: Found,
    answer: Answer,
    vehicle: Vehicle,
    done: Sequence[str],
    settings: Mapping[str, Any],
) -> None:
    """Writes the page, whole or not at all; needs matplotlib.

    Args:
        path: of the page.
        found: what an estimator made of the log.
        answer: what is known after it.
        vehicle: of the twin.
        done: sentences: what was done with the log.
        settings: of the estimate, log and car among them.
    """
    sections = (
        _head(found, answer),
        _quantities(answer),
        _pictures(found, vehicle),
        _trust(answer, found.drive),
        _checks(found, vehicle),
        _made(done, settings),
    )
    body = [line for section in sections for line in section]
    write_page(path, f"{settings['log']}: {settings['estimator']} estimate", body)


def _head(found: Found, answer: Answer) -> Iterator[str]:
    """The answer, whether to trust it, and what is not known."""
    yield from (f'<p class="answer">{escape(line)}</p>' for line in headlines(answer))
    trusted = found.estimate.trustworthy
    if found.faults:
        yield f'<div class="bad">Not trustworthy:{listed(found.faults)}</div>'
    elif trusted is not None and not trusted[-1]:
        yield '<div class="bad">At the end the estimates are not trustworthy, see below.</div>'
    elif trusted is not None:
        yield '<div class="good">At the end the estimates are trustworthy.</div>'
    if answer.unknown:
        yield f'<div class="note">Not known after this drive:{listed(answer.unknown)}</div>'


def _quantities(answer: Answer) -> Iterator[str]:
    if not answer.quantities:
        return
    yield "<section><h2>Estimates at the end</h2>"
    header = ("", "value", "change", "95 % of the change", "to be relied on")
    rows = [_row(one) for one in answer.quantities]
    yield table(header, rows, (False, True, True, True, False))
    yield "<p>A change is that from what the car's file says; that of the mass is the load.</p>"
    notes = sorted({one.reason for one in answer.quantities if not one.valid})
    yield listed(f"no: {reason}" for reason in notes) if notes else ""
    yield "</section>"


def _row(one: Quantity) -> tuple[str, ...]:
    return (
        one.words,
        f"{number(one.value)} {one.unit}",
        signed(one.change),
        interval(one) or "-",
        "yes" if one.valid else "no",
    )


def _pictures(found: Found, vehicle: Vehicle) -> Iterator[str]:
    yield '<section><h2>The drive</h2><div class="pictures">'
    for picture in pictures(found, vehicle):
        shown = image(picture.svg, picture.caption, "svg+xml")
        yield f"<figure>{shown}<figcaption>{escape(picture.caption)}</figcaption></figure>"
    yield "</div></section>"


def _trust(answer: Answer, drive: Drive) -> Iterator[str]:
    """A lane over time, red where the estimates are not trustworthy, and the reasons."""
    if answer.trusted is None:
        return
    start, length = float(drive.time[0]), max(answer.duration, 1e-9)
    yield "<section><h2>When the estimates are trustworthy</h2>"
    yield f"<p>For {100.0 * answer.trusted:.0f} % of {answer.duration:.1f} s: "
    yield '<span class="key">trustworthy</span><span class="key doubt">not</span></p>'
    spans = "".join(
        f'<span style="left:{100.0 * (one.start - start) / length:.2f}%;'
        f'width:{100.0 * (one.end - one.start) / length:.2f}%"></span>'
        for one in answer.untrusted
    )
    yield f'<div class="lane">{spans}</div>'
    yield f'<div class="scale"><span>{start:.1f} s</span><span>{drive.time[-1]:.1f} s</span></div>'
    rows = [
        (f"{one.start:.1f}", f"{one.end:.1f}", one.reason, ", ".join(one.channels))
        for one in answer.untrusted
    ]
    if rows:
        header = ("from [s]", "to [s]", "not trustworthy because", "missing")
        yield table(header, rows, (True, True, False, False))
    yield "</section>"


def _checks(found: Found, vehicle: Vehicle) -> Iterator[str]:
    """What `til inspect` finds in the longest uniform part of the log."""
    drive = _longest(found.drive)
    yield "<section><h2>Checks of the log</h2>"
    wrong = findings(drive, vehicle)
    faults = [str(one) for one in wrong if one.severity == "fault"]
    notes = [str(one) for one in wrong if one.severity != "fault"]
    yield f'<div class="bad">{listed(faults)}</div>' if faults else ""
    yield f'<div class="note">{listed(notes)}</div>' if notes else ""
    yield "" if wrong else '<div class="good">Nothing was found that does not fit.</div>'
    rows = [
        (
            one.name,
            one.verdict,
            *(text.replace("nan", "-") for text in (f"{one.correlation:.3f}", f"{one.slope:.4g}")),
            one.unit,
        )
        for one in checks(drive, vehicle)
    ]
    header = ("what must hold", "verdict", "correlation", "slope", "unit")
    yield table(header, rows, (False, False, True, True, False))
    yield "</section>"


def _longest(drive: Drive) -> Drive:
    """The longest part without a gap, which is uniform."""
    steps = np.diff(drive.time)
    cuts = np.flatnonzero(steps > 1.5 * np.median(steps)) + 1
    parts = pairwise([0, *cuts.tolist(), len(drive)])
    first, end = max(parts, key=lambda part: part[1] - part[0])
    return drive[first:end]


def _made(done: Sequence[str], settings: Mapping[str, Any]) -> Iterator[str]:
    yield "<section><h2>How the log was read</h2>"
    yield listed(done)
    yield "<h2>Settings and versions</h2>"
    yield f'<p class="made">settings: {items(settings)}; versions: {items(versions())}</p>'
    yield "</section>"
