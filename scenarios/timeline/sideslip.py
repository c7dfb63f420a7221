"""Sideslip with its band, its error, and whether to trust an estimate, in a timeline."""

from __future__ import annotations

import numpy as np

from estimators.base import Estimate
from scenarios.timeline.plots import BAND_COLOUR, TRUTH, TWIN, Line, Plot
from scenarios.timeline.states import Colour, Lane
from twin import Drive

TRUSTED = "trustworthy"
DOUBTED = "not trustworthy"
_DOUBT: Colour = (190, 70, 70)


def sideslip_plots(drive: Drive, estimate: Estimate) -> list[Plot]:
    """Sideslip with twice its standard deviation and, where it is known, the truth and the error.

    Args:
        drive: its truth may have a sideslip [rad].
        estimate: has no plot without a sideslip, nor in a simulation where it has no deviation.
    """
    truth = drive.truth.get("sideslip")
    slip, sd = np.degrees(estimate.sideslip), estimate.sideslip_sd
    if not np.isfinite(slip).any() or (sd is None and "log" not in drive.settings):
        return []
    lines = []
    if sd is not None:
        band = 2.0 * np.degrees(sd)
        lines = [
            Line("upper", "+2 standard deviations", slip + band, BAND_COLOUR, 1.0),
            Line("lower", "-2 standard deviations", slip - band, BAND_COLOUR, 1.0),
        ]
    lines.append(Line("estimate", "estimate", slip, TWIN, 2.5))
    plots = [Plot("sideslip", "sideslip [deg]", lines)]
    if truth is not None:
        true = np.degrees(truth)
        lines.append(Line("truth", "truth", true, TRUTH, 1.2))
        error = [Line("error", "error", slip - true, TWIN, 1.5)]
        plots.append(Plot("sideslip_error", "error of the sideslip [deg]", error))
    return plots


def trust_lane(estimate: Estimate) -> Lane | None:
    """When the estimate is trustworthy, and else for which reason; None where nobody judged."""
    trusted, reason = estimate.trustworthy, estimate.trust_reason
    if trusted is None:
        return None
    words = tuple(estimate.reasons) if reason is not None else ("",)
    names = [TRUSTED, *(word or DOUBTED for word in words)]
    states = np.where(trusted, 0, 1 + (0 if reason is None else reason.astype(np.int64)))
    used = np.unique(states)
    colours = {names[i]: _DOUBT if i else TRUTH for i in used}
    return Lane("trust", np.searchsorted(used, states), colours)
