"""What the drive of a scenario can tell of the load at all: `til limits`.

The Cramer-Rao bound of `estimators.identifiability.cramer_rao`, taken at the real vehicle's load,
of which an estimator knows all the other parameters ("single") or none of them ("joint").

The bound of each channel alone counts only samples of a car that moves. Open-loop twins of another
mass come to a stop at another instant, and that jump is not what a law on one signal looks at.
"""

import time
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from estimators.identifiability.cramer_rao import CramerRaoBound, cramer_rao, sensitivities
from estimators.til.law import ParameterLaw
from scenarios.cli.catalogue import Scenario, Settings
from scenarios.experiment.progress import progress
from scenarios.experiment.result import Result, Row
from twin import OUTPUTS, Drive, Twin, TwinError, Vehicle, noise_sd

Array = NDArray[np.float64]

UNITS = {
    "mass": "kg",
    **dict.fromkeys(("cm_x", "cm_y", "cm_z"), "m"),
    **dict.fromkeys(("Jxx", "Jyy", "Jzz"), "kg m2"),
}
IMU, WHEEL_SPEEDS = OUTPUTS[:6], OUTPUTS[6:]
TOGETHER = {"all channels": OUTPUTS, "IMU": IMU}
ALONE = {**{name: (name,) for name in IMU}, "wheel_speed": WHEEL_SPEEDS}
MOVING = 3.0  # [rad/s] of the wheels, 1 m/s


def run(name: str, scenario: Scenario, settings: Settings) -> tuple[Result, str]:
    """The bounds as rows, and as text for people.

    Raises:
        TwinError: there is no noise, and so no limit.
    """
    if settings.snr == float("inf"):
        raise TwinError(
            "limits: snr is inf; allowed: a number of dB (without noise nothing limits)"
        )
    start = time.perf_counter()
    drive, variation = scenario.drive(settings), scenario.variation()
    sd = noise_sd(drive.measurements, settings.snr, drive.output_names)
    sensitivity = np.concatenate(
        [
            sensitivity_at_truth(scenario.vehicle, drive, [parameter], variation)
            for parameter in progress(UNITS, "sensitivities", len(UNITS))
        ]
    )
    together = {
        case: cramer_rao(tuple(UNITS), sensitivity, using(sd, channels))
        for case, channels in TOGETHER.items()
    }
    moving = sensitivity[:, is_moving(drive, MOVING)]
    alone = {
        channel: cramer_rao(tuple(UNITS), moving, using(sd, channels))
        for channel, channels in ALONE.items()
    }
    rows = [
        row for case, bound in together.items() for row in _rows_together(case, bound, variation)
    ]
    for channel, bound in alone.items():
        rows += _rows(f"{channel} alone, moving", "limit_single", bound, bound.single, variation)
    result = Result(
        name=f"limits of {name}",
        settings={"snr": settings.snr, "duration": settings.duration},
        seconds=time.perf_counter() - start,
        rows=rows,
    )
    used = f"{len(drive) * drive.dt:g} s with noise of {settings.snr:g} dB"
    return result, "\n\n".join(
        [
            f"{used}; exact model, known start, no bias",
            *(_text(case, bound, variation) for case, bound in together.items()),
            f"each channel alone, of a moving car: single [%]\n{_by_channel(alone, variation)}",
        ]
    )


def sensitivity_at_truth(
    vehicle: str, drive: Drive, parameters: Sequence[str], variation: Mapping[str, float]
) -> Array:
    """(p, N, 10) what parameters change in the outputs, around the real vehicle's load."""
    twin = Twin(Vehicle.load(vehicle))
    speed = float(drive.truth["vx"][0])
    return sensitivities(twin, drive, parameters, variation, speed=speed)


def using(sd: Array, channels: Sequence[str]) -> Array:
    """The (10,) standard deviations, with NaN for all other channels."""
    return np.where(np.isin(OUTPUTS, channels), sd, np.nan)


def is_moving(drive: Drive, least: float) -> NDArray[np.bool_]:
    """(N,) whether the wheels turn at least so fast [rad/s], in the mean; zero: always."""
    if least == 0.0:
        return np.ones(len(drive), dtype=np.bool_)
    return np.mean([drive.channel(name) for name in WHEEL_SPEEDS], axis=0) >= least


def law_limit(law: ParameterLaw, sensitivity: Array, drive: Drive, sd: Array) -> float:
    """The bound on one parameter from what its law uses of a drive.

    That is one signal, of a car that moves, with an offset if the law fits one along.

    Args:
        law: of the parameter.
        sensitivity: (1, N, 10) to it.
        drive: without noise.
        sd: (10,) of the noise.
    """
    bound = cramer_rao(
        [law.parameter],
        sensitivity[:, is_moving(drive, law.least_wheel_speed)],
        using(sd, [law.output]),
        free_offsets=law.offset_sd > 0.0,
    )
    return float(bound.single[0])


def percent(sd: float, variation: float) -> float:
    """A standard deviation in % of what is to be found; NaN where nothing is."""
    return 100.0 * sd / abs(variation) if variation else float("nan")


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
        parts.append(f"{case}: not told, or not apart: {', '.join(bound.unidentifiable)}")
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
