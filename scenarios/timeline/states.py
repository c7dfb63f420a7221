"""What is one thing or another over time, in a timeline for the Rerun viewer: lanes of colour."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.timeline.plots import PLOT_RATE, everything, thinned

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

Colour = tuple[int, int, int]


class Lane(NamedTuple):
    """A lane: (N,) indices of its states, and how each is called and coloured."""

    entity: str
    states: NDArray[np.int64]
    colours: Mapping[str, Colour]


def send_lane(recording: rr.RecordingStream, time: NDArray[np.float64], lane: Lane) -> None:
    """Logs the first state over time (N,) [s] and each one that differs from the one before."""
    import rerun as rr

    names = list(lane.colours)
    style = rr.StateConfiguration(values=names, colors=list(lane.colours.values()))
    recording.log(lane.entity, style, static=True)
    samples = thinned(time, PLOT_RATE)
    shown = lane.states[samples]
    new = np.flatnonzero(np.diff(shown, prepend=-1))
    index = [rr.TimeColumn("time", duration=time[samples[new]])]
    columns = rr.StateChange.columns(state=[names[i] for i in shown[new]])
    recording.send_columns(lane.entity, index, columns)


def lanes_view(title: str, entities: Sequence[str]) -> rrb.StateTimelineView:
    """The view of some lanes, over all of time."""
    import rerun.blueprint as rrb

    return rrb.StateTimelineView(
        origin="/",
        contents=[f"+ /{entity}" for entity in entities],
        name=title,
        time_view=rrb.TimeAxis(view_range=everything()),
    )
