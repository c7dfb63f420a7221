"""Names of the scenarios and reproductions; what they name is imported only when it is used."""

from __future__ import annotations

import ast
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenarios.experiment.experiment import Experiment
    from scenarios.experiment.reproduction import Making
    from scenarios.experiment.result import Result

ATTRIBUTE = "EXPERIMENT"  # what makes a module a scenario


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of the catalogue.

    Attributes:
        target: "module:attribute" of the `Experiment`, or of what makes a table or figure.
        summary: one line for people.
    """

    target: str
    summary: str


def _scenarios(folder: Path) -> dict[str, Entry]:
    """The modules of a folder that define an experiment, by name; none is imported."""
    found = {}
    for file in sorted(folder.glob("[!_]*.py")):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        targets = {
            target.id
            for node in tree.body
            if isinstance(node, ast.Assign)
            for target in node.targets
            if isinstance(target, ast.Name)
        }
        if ATTRIBUTE in targets:
            summary = (ast.get_docstring(tree) or "").partition("\n")[0].rstrip(".")
            name = file.stem.replace("_", "-")
            found[name] = Entry(f"{folder.name}.{file.stem}:{ATTRIBUTE}", summary)
    return found


SCENARIOS = _scenarios(Path(__file__).parents[1])

_TABLES, _FIGURES = "scenarios.papers.til_tables", "scenarios.papers.til_figures"
_STATES, _TRUCK = "scenarios.papers.state_figures", "scenarios.papers.truck"
REPRODUCTIONS = {
    "honesty": Entry(
        "scenarios.papers.honesty:honesty", "are the claims true on cars that are not the twin?"
    ),
    "faults": Entry(
        "scenarios.papers.faults:faults", "broken channels of a log: found, or trusted and off?"
    ),
    "til-table-3": Entry(f"{_TABLES}:table_3", "load parameters of the empty and loaded car"),
    "til-table-4": Entry(f"{_TABLES}:table_4", "mass: noise, wrong CM"),
    "til-table-5": Entry(f"{_TABLES}:table_5", "roll and yaw inertia: noise, wrong mass, wrong CM"),
    "til-table-6": Entry(
        f"{_TABLES}:table_6", "pitch inertia: noise, noisy road, wrong mass, wrong CM"
    ),
    "til-figure-4": Entry(f"{_FIGURES}:figure_4", "mass over time from several initial errors"),
    "til-figure-5": Entry(f"{_FIGURES}:figure_5", "mass error over the sensors' noise"),
    "til-figure-6": Entry(
        f"{_FIGURES}:figure_6", "roll and yaw inertia over time, CM right and wrong"
    ),
    "til-figure-7": Entry(f"{_FIGURES}:figure_7", "roll inertia error over noise"),
    "til-figure-8": Entry(f"{_FIGURES}:figure_8", "yaw inertia error over noise"),
    "til-figure-9": Entry(f"{_FIGURES}:figure_9", "pitch inertia over time"),
    "til-figure-10": Entry(f"{_FIGURES}:figure_10", "pitch inertia error over noise"),
    "til-figure-11": Entry(f"{_FIGURES}:figure_11", "pitch inertia error over the road's noise"),
    "til-table-8": Entry(f"{_TABLES}:table_8", "gains of the observers of sideslip and mass"),
    "til-reduction": Entry(
        "scenarios.reduction.study:reduction", "which entries of K matter: hand-chosen or automatic"
    ),
    "til-figure-14": Entry(f"{_STATES}:figure_14", "what the car does on the laps"),
    "til-figure-15": Entry(f"{_STATES}:figure_15", "what the car does in the lane changes"),
    "til-figure-16": Entry(f"{_STATES}:figure_16", "mass and sideslip on the laps"),
    "til-figure-17": Entry(f"{_STATES}:figure_17", "the last part of the laps"),
    "til-figure-18": Entry(f"{_STATES}:figure_18", "mass and sideslip in the lane changes"),
    "til-joint-table": Entry(
        f"{_TABLES}:joint_table", "sideslip and mass of every observer on every real vehicle"
    ),
    "til-double-track-ramp": Entry(
        f"{_STATES}:ramp", "the double track's mass is a ramp: three initial errors"
    ),
    "til-joint-all": Entry(f"{_TABLES}:joint_all", "all drives, all real vehicles: joint observer"),
    "kbf-table-2": Entry(f"{_TRUCK}_tables:table_2", "every filter in both readings of the noise"),
    "kbf-figure-5": Entry(f"{_TRUCK}_figures:figure_5", "the truck's velocities over time"),
    "kbf-figure-6": Entry(f"{_TRUCK}_figures:figure_6", "the truck's mass and inertia over time"),
    "kbf-tuning": Entry(f"{_TRUCK}_tables:tuning", "R and Q by decades: a lower R is not better"),
    "plan": Entry("scenarios.planning.study:planning", "planned manoeuvres against standard ones"),
    "kbf-robustness": Entry(f"{_TRUCK}_tables:robustness", "filters that believe in another truck"),
}


def scenario(name: str) -> Experiment:
    """The scenario of that name in `SCENARIOS`."""
    return pkgutil.resolve_name(SCENARIOS[name].target)


def reproduction(name: str) -> Callable[[Making], Result]:
    """What makes the table or figure of that name in `REPRODUCTIONS`."""
    return pkgutil.resolve_name(REPRODUCTIONS[name].target)


# What commands call; slow to import
_TARGETS = {
    "run": "scenarios.experiment.engine:run_experiment",
    "limits": "scenarios.report.limits:limits_of",
    "tune": "scenarios.tuning.run:tune",
    "timeline": "scenarios.timeline.write:write",
    "view": "scenarios.timeline.timeline:view",
    "picture": "scenarios.experiment.engine:draw",
    "gains": "scenarios.experiment.gains_file:of_run",
    "making": "scenarios.experiment.reproduction:Making",
    "cluster": "scenarios.experiment.progress:cluster",
    "bench": "scenarios.cli.bench:run",
}


def find(name: str) -> Any:
    """What a command calls, by a name of `_TARGETS`."""
    return pkgutil.resolve_name(_TARGETS[name])


def inspection() -> Callable[[Path, Path | None, str | None, Path | None], Any]:
    """What tells of a log, with a map or without, as text, and proposes a map."""
    return pkgutil.resolve_name("scenarios.logs.inspect:inspect_log")


def new_car() -> Any:
    """The module that writes new cars and tyres."""
    return import_module("scenarios.calibration.new_car")


def car_check() -> tuple[Any, Any]:
    """The modules that check a car, and that draw what they found."""
    package = "scenarios.car_check"
    return import_module(f"{package}.check"), import_module(f"{package}.picture")


def tyre_fit() -> Any:
    """The module that fits a tyre to measurements."""
    return import_module("scenarios.calibration.tyre_report")


def weigh() -> tuple[Any, Callable[[str], Any]]:
    """The module that weighs recorded drives, and what reads the name of a reference."""
    return import_module("scenarios.weighing.weigh"), pkgutil.resolve_name(
        "scenarios.weighing.logs:Log"
    ).parse


def planning() -> Any:
    """The module that plans manoeuvres."""
    return import_module("scenarios.planning.report")


def calibration() -> tuple[Callable[..., Any], Callable[..., Any]]:
    """What says what is fitted to which logs, and what fits it."""
    return pkgutil.resolve_name("scenarios.calibration.plan:plan_of"), pkgutil.resolve_name(
        "scenarios.calibration.calibrate:run"
    )


def estimate() -> Any:
    """The module that observes recorded drives."""
    return import_module("scenarios.logs.estimate")


def report_of_logs() -> Any:
    """The module that writes the reports on recorded drives."""
    return import_module("scenarios.logs.report")


def estimate_stream() -> Any:
    """The module that observes samples from standard input."""
    return import_module("scenarios.logs.stream")


def live(name: str) -> Any:
    """A module of the observer on a bus."""
    return import_module(f"scenarios.live.{name}")
