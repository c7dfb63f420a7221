"""A picture of K: how much each innovation corrects each state, way by way."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from estimators.til.forecast_errors import CORRECTED
from scenarios.experiment.result import replacing
from twin import OUTPUTS, TwinError

COLOURS = "RdBu_r"
SPAN = 1e-3  # of an entry to the largest of its column that still shows


def draw(path: Path, found: Mapping[str, Mapping[tuple[str, str], float]], title: str) -> None:
    """Draws K of every way side by side, whole or not at all.

    Args:
        path: of the PNG.
        found: entries of K by (state, output), by name of the way.
        title: above.

    Raises:
        TwinError: matplotlib is not installed.
    """
    try:
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import SymLogNorm
        from matplotlib.figure import Figure
    except ImportError:
        raise TwinError(
            f"{path.name}: pictures need matplotlib: pip install -e '.[plots]' in the project"
        ) from None
    columns = (len(found) + 1) // 2
    sheet = Figure(figsize=(3.2 * columns, 11.0), dpi=110, layout="constrained")
    sheet.suptitle(title)
    grids = np.atleast_1d(sheet.subplots(2, columns, sharex=True, sharey=True)).ravel()
    for grid in grids[len(found) :]:
        grid.set_axis_off()
    matrices = {label: _matrix(k) for label, k in found.items()}
    largest = max(np.abs(k).max() for k in matrices.values())
    norm = SymLogNorm(SPAN * largest, vmin=-largest, vmax=largest)
    for grid, (label, k) in zip(grids, matrices.items(), strict=False):
        grid.imshow(k, cmap=COLOURS, norm=norm, aspect="auto")
        grid.set_title(f"{label}: {np.count_nonzero(k)}", fontsize=9)
        grid.set_xticks(range(len(OUTPUTS)), OUTPUTS, rotation=90, fontsize=7)
        grid.set_yticks(range(len(CORRECTED)), CORRECTED, fontsize=7)
    sheet.colorbar(
        ScalarMappable(norm, COLOURS),
        ax=grids,
        label="K [1/s, units of the state over those of the output]",
    )
    with replacing(path) as partial:
        sheet.savefig(partial, format="png")


def _matrix(k: Mapping[tuple[str, str], float]) -> np.ndarray:
    """(n, ny), zero where there is no entry."""
    return np.array([[k.get((to, of), 0.0) for of in OUTPUTS] for to in CORRECTED])
