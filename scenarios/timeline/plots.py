"""Series over time in a timeline for the Rerun viewer: what is drawn, in which colour and view."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

Array = NDArray[np.float64]

PLOT_RATE = 100.0  # [Hz] at most

# Where curves coincide the truth, drawn last, is a thin line within the twin's broad one.
# Colours: the twin and what it estimates, the truth, its band, the noisy measurement
TWIN, TRUTH, BAND_COLOUR, MEASURED = (235, 120, 50), (70, 190, 130), (60, 105, 85), (125, 130, 140)


class Line(NamedTuple):
    """A series of a plot: (N,) values and how they are drawn."""

    entity: str
    name: str
    values: Array
    colour: tuple[int, int, int]
    width: float


class Plot(NamedTuple):
    """Series that belong in one view, under one entity."""

    entity: str
    title: str
    lines: list[Line]


def thinned(time: Array, rate: float) -> NDArray[np.int64]:
    """Indices of samples at no more than a rate [Hz], the first and the last among them."""
    period = np.floor((time - time[0]) * rate + 1e-6)
    first = np.flatnonzero(np.diff(period, prepend=-1.0) > 0.0)
    return np.union1d(first, [time.size - 1])


def send_plot(recording: rr.RecordingStream, time: Array, plot: Plot) -> None:
    """Logs the series of a plot over time (N,) [s]."""
    import rerun as rr

    samples = thinned(time, PLOT_RATE)
    index = [rr.TimeColumn("time", duration=time[samples])]
    for line in plot.lines:
        entity = f"{plot.entity}/{line.entity}"
        style = rr.SeriesLines(names=line.name, colors=line.colour, widths=line.width)
        recording.log(entity, style, static=True)
        columns = rr.Scalars.columns(scalars=line.values[samples])
        recording.send_columns(entity, index, columns)


def everything() -> rr.TimeRange:
    """All of time, for an axis."""
    import rerun as rr

    return rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())


def plot_view(
    plot: Plot,
    *,
    legend: bool,
    left: bool = False,
    limits: tuple[float, float] | None = None,
) -> rrb.TimeSeriesView:
    """The view of a plot, over all of time.

    Args:
        plot: what it shows.
        legend: whether it explains the series, in a corner below.
        left: which corner.
        limits: of the vertical axis; by default all fits.
    """
    import rerun.blueprint as rrb

    corner = rrb.Corner2D.LeftBottom if left else rrb.Corner2D.RightBottom
    return rrb.TimeSeriesView(
        origin=plot.entity,
        name=plot.title,
        axis_x=rrb.TimeAxis(view_range=everything()),
        axis_y=rrb.ScalarAxis(range=limits) if limits else None,
        plot_legend=rrb.PlotLegend(corner, visible=legend),
    )
