"""Pictures for people: matplotlib, on paper of one size, written whole or not at all."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios.experiment.result import replacing
from twin import TwinError


@contextmanager
def figure(path: Path, *, title: str, rows: int = 1, shared: bool = True) -> Iterator[Any]:
    """Axes to draw on, one above the other; saved as PNG when the block ends well.

    Args:
        path: of the picture.
        title: above it.
        rows: how many axes.
        shared: whether they share the horizontal one.

    Raises:
        TwinError: matplotlib is not installed.
    """
    with canvas(path, title=title, size=(8.0, 2.0 + 2.5 * rows)) as sheet:
        axes = sheet.subplots(rows, 1, sharex=shared)
        for one in np.atleast_1d(axes):
            one.grid(alpha=0.3)
        yield axes


@contextmanager
def canvas(path: Path, *, title: str, size: tuple[float, float]) -> Iterator[Any]:
    """An empty figure of matplotlib to lay out and draw on; saved as PNG when the block ends well.

    Args:
        path: of the picture.
        title: above it.
        size: width and height [inch].

    Raises:
        TwinError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise TwinError(
            f"{path.name}: pictures need matplotlib: pip install -e '.[plots]' in the project"
        ) from None
    sheet = Figure(figsize=size, dpi=120, layout="constrained")
    sheet.suptitle(title)
    yield sheet
    with replacing(path) as partial:
        sheet.savefig(partial, format="png")


def spread(axes: Any, x: Sequence[float], values: NDArray[np.float64], *, label: str) -> None:
    """A line through the medians over seeds, with the band from the 10th to the 90th percentile.

    Args:
        axes: of matplotlib.
        x: (n,) positions.
        values: (n, seeds).
        label: of the line.
    """
    low, median, high = np.percentile(values, (10.0, 50.0, 90.0), axis=1)
    (line,) = axes.plot(x, median, marker="o", ms=4, label=label)
    axes.fill_between(x, low, high, color=line.get_color(), alpha=0.2, lw=0)
