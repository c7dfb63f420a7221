"""Names of the scenarios and reproductions; what they name is imported only when it is used."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from scenarios.result import Result

if TYPE_CHECKING:
    from twin import Drive


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How a scenario is run.

    Attributes:
        snr: signal-to-noise ratio of the sensors [dB]; inf: no noise.
        seeds: one run each.
        jobs: processes side by side.
        duration: of the drive [s]; None: all of it.
    """

    snr: float
    seeds: tuple[int, ...]
    jobs: int
    duration: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """What a scenario's module offers as `SCENARIO`.

    Attributes:
        run: drives over all seeds and scores.
        timeline: writes the drive of the first seed as a Rerun recording to the given path,
            whole or not at all.
        default_snr: signal-to-noise ratio unless the user names one [dB].
        vehicle: the twin's, by its name in `models`.
        drive: of the real vehicle, without noise.
        variation: by parameter what its load changes, around the twin's vehicle.
    """

    run: Callable[[Settings], Result]
    timeline: Callable[[Settings, Path], None]
    default_snr: float
    vehicle: str
    drive: Callable[[Settings], Drive]
    variation: Callable[[], Mapping[str, float]]


Reproduction = Callable[[int, int, Path], Result]
"""A paper's table or figure from (number of seeds, jobs, existing folder for pictures)."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of the catalogue.

    Attributes:
        target: "module:attribute" of the `Scenario` or `Reproduction`.
        summary: one line for people.
    """

    target: str
    summary: str


SCENARIOS = {
    "mass": Entry(
        "scenarios.mass:SCENARIO", "a car in town finds the mass of the unknown 355 kg on board"
    ),
}

REPRODUCTIONS = {
    "til-table-3": Entry(
        "scenarios.til_mass:table_3", "load parameters of the empty and loaded car"
    ),
    "til-table-4": Entry(
        "scenarios.til_mass:table_4", "mass error without noise, with it, wrong CM"
    ),
    "til-figure-4": Entry(
        "scenarios.til_mass:figure_4", "mass over time from several initial errors"
    ),
    "til-figure-5": Entry("scenarios.til_mass:figure_5", "mass error over the sensors' noise"),
}


def scenario(name: str) -> Scenario:
    """The scenario of that name in `SCENARIOS`."""
    return pkgutil.resolve_name(SCENARIOS[name].target)


def reproduction(name: str) -> Reproduction:
    """The reproduction of that name in `REPRODUCTIONS`."""
    return pkgutil.resolve_name(REPRODUCTIONS[name].target)


def limits() -> Callable[[str, Scenario, Settings], tuple[Result, str]]:
    """What gives the bounds of a scenario, by its name, as a result and as text."""
    return pkgutil.resolve_name("scenarios.limits:run")


def bench() -> Callable[[], Result]:
    """What measures the speed."""
    return pkgutil.resolve_name("scenarios.bench:run")
