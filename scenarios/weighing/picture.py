"""The picture of many weighings: load and interval of each trip in their order, notes beside."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from estimators.weigh.weighing import Weighing
from scenarios.report.pictures import figure

_SHOWN = (-150.0, 400.0)  # [kg] at most; a load beyond is drawn at the edge
_LABELLED = 60  # trips up to which each is named


def draw(
    path: Path, weighings: Sequence[Weighing], notes: Mapping[str, str], *, title: str
) -> None:
    """Draws the trips as PNG.

    Args:
        path: of the picture.
        weighings: in order of time.
        notes: words beside a trip, by its name.
        title: above the picture.

    Raises:
        TwinError: matplotlib is not installed.
    """
    with figure(path, title=title) as axes:
        axes.axhline(0.0, color="0.6", lw=0.8)
        for believable, colour in ((True, "tab:blue"), (False, "0.65")):
            chosen = [i for i, w in enumerate(weighings) if w.believable == believable]
            _points(axes, [weighings[i] for i in chosen], chosen, colour, believable)
        for i, w in enumerate(weighings):
            if w.name in notes and np.isfinite(w.load):
                top = float(np.clip(w.load + min(w.half_width, 100.0), *_SHOWN))
                axes.annotate(
                    notes[w.name], (i, top), (0, 4), textcoords="offset points", ha="center",
                    fontsize=7, color="tab:red",
                )  # fmt: skip
        if len(weighings) <= _LABELLED:
            axes.set_xticks(range(len(weighings)), [w.name for w in weighings])
            axes.tick_params(axis="x", rotation=90, labelsize=6)
        axes.set(ylabel="load [kg]")
        axes.legend(fontsize=7, loc="upper left", ncols=2)


def _points(
    axes: Any, weighings: Sequence[Weighing], places: Sequence[int], colour: str, believable: bool
) -> None:
    if not weighings:
        return
    loads = np.clip([w.load for w in weighings], *_SHOWN)
    widths = np.minimum([w.half_width for w in weighings], 200.0)
    axes.errorbar(
        places, loads, yerr=widths, fmt="o", ms=3, lw=1.0, color=colour,
        label="95 % interval" if believable else "not to be believed",
    )  # fmt: skip
