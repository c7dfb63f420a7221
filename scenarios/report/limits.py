"""How well a drive lets the load be estimated at all: `til limits`.

The Cramer-Rao bound of `estimators.identifiability.cramer_rao`, taken at the real vehicle's load,
of which an estimator knows all the other parameters ("single") or none of them ("joint").

The bound of each channel alone counts only samples of a car that moves. Open-loop twins of another
mass come to a stop at another instant, and that jump is not what a law on one signal looks at.
"""

import math
import time
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from estimators.identifiability.cramer_rao import CramerRaoBound, cramer_rao
from scenarios.experiment.bounds import (
    WHEEL_SPEEDS,
    is_moving,
    percent,
    sensitivities_at,
    using,
)
from scenarios.experiment.experiment import CarPlant, Experiment
from scenarios.experiment.progress import progress
from scenarios.experiment.result import Result, Row
from twin import OUTPUTS, TwinError, noise_sd

Array = NDArray[np.float64]

UNITS = {
    "mass": "kg",
    **dict.fromkeys(("cm_x", "cm_y", "cm_z"), "m"),
    **dict.fromkeys(("Jxx", "Jyy", "Jzz"), "kg m2"),
}
IMU = OUTPUTS[:6]
TOGETHER = {"all channels": OUTPUTS, "IMU": IMU}
ALONE = {**{name: (name,) for name in IMU}, "wheel_speed": WHEEL_SPEEDS}
MOVING = 3.0  # [rad/s] of the wheels, 1 m/s


def limits_of(
    experiment: Experiment, snr: float | None = None, duration: float | None = None
) -> tuple[Result, str]:
    """The bounds as rows, and as text for people.

    Args:
        experiment: whose first case is looked at.
        snr: of the sensors [dB]; None: the case's.
        duration: of the drive [s]; None: all of it.

    Raises:
        TwinError: there is no noise and so no bound, or no car with a constant load.
    """
    case = experiment.at(snr)[0]
    if case.snr == math.inf:
        raise TwinError(
            "limits: snr is inf; allowed: a number of dB (without noise nothing limits)"
        )
    if not isinstance(case.plant, CarPlant):
        raise TwinError(f"limits: {experiment.name} has none; allowed: a simulated car")
    start = time.perf_counter()
    drive, variation = case.plant.clean(duration), case.variation()
    if np.ptp(drive.truth["mass"]) > 0.0:
        raise TwinError(f"limits: {experiment.name} has none; allowed: a car with a constant load")
    sd = noise_sd(drive.measurements, case.snr, drive.output_names)
    sensitivity = np.concatenate(
        [
            sensitivities_at(case, drive, [parameter])
            for parameter in progress(UNITS, "sensitivities", len(UNITS))
        ]
    )
    names = tuple(UNITS)
    together = {
        group: cramer_rao(names, sensitivity, using(sd, channels))
        for group, channels in TOGETHER.items()
    }
    moving = sensitivity[:, is_moving(drive, MOVING)]
    alone = {
        channel: cramer_rao(names, moving, using(sd, channels))
        for channel, channels in ALONE.items()
    }
    rows = [
        row for group, bound in together.items() for row in _rows_together(group, bound, variation)
    ]
    for channel, bound in alone.items():
        rows += _rows(f"{channel} alone, moving", "limit_single", bound, bound.single, variation)
    result = Result(
        name=f"limits of {experiment.name}",
        settings={"snr": case.snr, "duration": duration},
        seconds=time.perf_counter() - start,
        rows=rows,
    )
    used = f"{len(drive) * drive.dt:g} s with noise of {case.snr:g} dB"
    return result, "\n\n".join(
        [
            f"{used}; exact model, known start, no bias",
            *(_text(group, bound, variation) for group, bound in together.items()),
            f"each channel alone, of a moving car: single [%]\n{_by_channel(alone, variation)}",
        ]
    )


def _rows(
    case: str, metric: str, bound: CramerRaoBound, sds: Array, variation: Mapping[str, float]
) -> list[Row]:
    return [
        _row(case, name, metric, percent(sd, variation[name]), "%")
        for name, sd in zip(bound.parameters, sds, strict=True)
    ]


def _rows_together(case: str, bound: CramerRaoBound, variation: Mapping[str, float]) -> list[Row]:
    names = bound.parameters
    return [
        *_rows(case, "limit_single", bound, bound.single, variation),
        *_rows(case, "limit_joint", bound, bound.joint, variation),
        *(
            _row(case, f"{names[k]} {names[i]}", "limit_correlation", bound.correlation[i, k], "-")
            for i in range(len(names))
            for k in range(i)
        ),
    ]


def _row(case: str, quantity: str, metric: str, value: float, unit: str) -> Row:
    return Row.over_seeds(
        [value], case=case, quantity=quantity, metric=metric, unit=unit, estimator="cramer-rao"
    )


def _text(case: str, bound: CramerRaoBound, variation: Mapping[str, float]) -> str:
    parts = [
        f"{case}: standard deviations\n{_deviations(bound, variation)}",
        f"{case}: correlation of the joint errors\n{_correlation(bound)}",
    ]
    if bound.unidentifiable:
        parts.append(f"{case}: not identifiable, or not apart: {', '.join(bound.unidentifiable)}")
    return "\n\n".join(parts)


def _deviations(bound: CramerRaoBound, variation: Mapping[str, float]) -> str:
    heading = ["", "unit", "variation", "single", "joint", "single [%]", "joint [%]"]
    lines = [
        [
            name,
            UNITS[name],
            *map(_number, (variation[name], single, joint)),
            *(_number(percent(sd, variation[name])) for sd in (single, joint)),
        ]
        for name, single, joint in zip(bound.parameters, bound.single, bound.joint, strict=True)
    ]
    return _aligned([heading, *lines])


def _correlation(bound: CramerRaoBound) -> str:
    lines = [
        [name, *(f"{value:.2f}" for value in row)]
        for name, row in zip(bound.parameters, bound.correlation, strict=True)
    ]
    return _aligned([["", *bound.parameters], *lines])


def _by_channel(bounds: Mapping[str, CramerRaoBound], variation: Mapping[str, float]) -> str:
    lines = [
        [name, *(_number(percent(bound.single[i], variation[name])) for bound in bounds.values())]
        for i, name in enumerate(UNITS)
    ]
    return _aligned([["", *bounds], *lines])


def _number(value: float) -> str:
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"


def _aligned(lines: Sequence[Sequence[str]]) -> str:
    """Columns of equal width, the first to the left."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )
