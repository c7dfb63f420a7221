"""The file, the picture and the words of a fitted tyre."""

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import models
from scenarios.calibration.tyre_data import TyreData, read_tyre_data
from scenarios.calibration.tyre_fit import TyreFit, evaluate, fit_tyre, samples_of
from scenarios.report.pictures import figure
from twin import TwinError
from twin.car.template import write_new
from twin.tyre.files import read_tyre_file
from twin.tyre.size import parse_size, tyre_text

_LOADS = 4  # levels of load that the picture shows
_POINTS = 600  # samples of a level that it draws


def fit_to_file(
    paths: Sequence[Path], out: Path, size: str | None = None, load_index: int | None = None
) -> tuple[TyreFit, Path]:
    """Fits a tyre to measurements and writes its .tir file and a picture beside it.

    Args:
        paths: files of measurements of one tyre.
        out: the .tir file.
        size: of the tyre: what the data do not tell starts from it; None: from tyres/suv.tir.
        load_index: where the size has none.

    Returns:
        The fit, and the path of the picture.

    Raises:
        TwinError: a file cannot be read or fitted, or `out` is there already.
    """
    if out.suffix != ".tir":
        raise TwinError(f"{out}: is the name of no tyre file; allowed: one that ends in .tir")
    if out.exists():
        raise TwinError(f"{out}: is there already; allowed: a name that is not taken")
    text = models.path("tyres/suv.tir").read_text()
    if size is not None:
        text = tyre_text(parse_size(size, load_index), size)
    start = read_tyre_file(models.path("tyres/suv.tir")).copy()
    for match in re.finditer(r"(?m)^([A-Z]\w+) *= *([-+.\deE]+)", text):
        if match[1].lower() in (start.dtype.names or ()):
            start[match[1].lower()] = float(match[2])
    fit = fit_tyre(start, read_tyre_data(paths))
    picture = out.with_suffix(".png")
    draw(picture, fit, out.stem)
    write_new(out, _file_text(text, fit, [path.name for path in paths]))
    return fit, picture


def _file_text(text: str, fit: TyreFit, names: Sequence[str]) -> str:
    head = [
        f"$ Magic Formula 5.2, fitted to {fit.data.fz.size} samples of {', '.join(names)}.",
        *(f"$ {note}" for note in fit.notes),
        *(f"$ {sentence}" for sentence in sentences(fit)),
    ]
    body = text[text.index("[MDI_HEADER]") :]
    for key, value in fit.values.items():
        body, found = re.subn(rf"(?m)^{key} .*$", f"{key:19} = {value:.6g}     $ fitted", body)
        if found != 1:
            raise TwinError(f"tyres/suv.tir: has {key} {found} times, must have it once")
    return "\n".join(head) + "\n" + body


def sentences(fit: TyreFit) -> list[str]:
    """What was reached, a line for each force."""
    lines = []
    for step in fit.steps:
        unit = "N m" if step.name.startswith("M_z") else "N"
        line = (
            f"{step.name}: rms {step.rmse:.3g} {unit}, {100.0 * step.rmse / step.span:.2g} % of "
            f"the span, {step.samples} samples"
        )
        if step.on_bound:
            line += f"; on their bounds, so not to be relied on: {', '.join(step.on_bound)}"
        lines.append(line)
    return lines


def draw(path: Path, fit: TyreFit, title: str) -> None:
    """Measured points and the fit's lines, by level of load.

    Args:
        path: of the PNG.
        fit: to draw.
        title: above it.
    """
    data = fit.data
    along = any(step.name.startswith("F_x,") for step in fit.steps)
    moment = any(step.name.startswith("M_z") for step in fit.steps)
    panels = [("F_y [N]", 1), *([("F_x [N]", 0)] if along else [])]
    panels += [("M_z [N m]", 2)] if moment else []
    with figure(path, title=title, rows=len(panels), shared=False) as axes:
        for axis, (label, column) in zip(np.atleast_1d(axes), panels, strict=True):
            _panel(axis, fit, data, column)
            axis.set(
                ylabel=label, xlabel="longitudinal slip" if column == 0 else "slip angle [deg]"
            )
            axis.legend(fontsize=7, ncols=2, title="load; points are measured")


def _panel(axis: Any, fit: TyreFit, data: TyreData, column: int) -> None:
    upright = np.abs(data.gamma) < np.radians(0.75)
    pure = np.abs(data.alpha) < np.radians(0.6) if column == 0 else np.abs(data.kappa) < 0.015
    x = data.kappa if column == 0 else np.degrees(data.alpha)
    y = (data.fx, data.fy, data.mz)[column]
    kept = pure & upright & np.isfinite(y)
    levels = _levels(data.fz[kept])
    for level, colour in zip(levels, ("C0", "C1", "C2", "C3"), strict=False):
        near = kept & (np.abs(data.fz - level) < 0.1 * level)
        shown = np.flatnonzero(near)[:: 1 + near.sum() // _POINTS]
        axis.plot(x[shown], y[shown], ".", ms=2, color=colour, alpha=0.4)
        line = np.linspace(x[near].min(), x[near].max(), 121) if near.any() else np.zeros(2)
        samples = np.zeros((line.size, 5))
        samples[:, 0], samples[:, 4] = level, samples_of(fit.tyre, data)[:, 4].mean()
        samples[:, 1 if column == 0 else 2] = line if column == 0 else np.radians(line)
        out = np.empty((line.size, 3))
        evaluate(fit.tyre, samples, out)
        axis.plot(line, out[:, column], color=colour, label=f"{level:.0f} N")


def _levels(load: np.ndarray) -> list[float]:
    """Loads that the samples gather about, light to heavy."""
    if load.size == 0:
        return []
    edges = np.quantile(load, np.linspace(0.0, 1.0, _LOADS + 1))
    found: list[float] = []
    for low, high in pairwise(edges):
        level = float(np.median(load[(load >= low) & (load <= high)]))
        if not found or level > 1.2 * found[-1]:
            found.append(level)
    return found
