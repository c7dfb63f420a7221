"""The tables of the truck: KBF Table 2, robustness, and the paper's claim about R and Q."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from estimators.benchmarks.kalman_bucy import KalmanBucySettings
from scenarios.experiment import truck
from scenarios.experiment.engine import rows, runs
from scenarios.experiment.experiment import Case, Recipe
from scenarios.experiment.reproduction import Clock, Making
from scenarios.experiment.result import Result
from scenarios.experiment.truck import CASES, RECIPES, TRUCK_PARAMETERS, UNITS, some, truck_case
from twin.truck.parameters import STANDARD_GRAVITY

ROBUSTNESS_CASES = (
    truck_case("as the paper"),
    truck_case("road class A", road_class="A"),
    truck_case("road class E", road_class="E"),
    truck_case("springs +10 %", spring_factor=1.1),
    truck_case("springs -10 %", spring_factor=0.9),
    truck_case("dampers +10 %", damper_factor=1.1),
    truck_case("dampers -10 %", damper_factor=0.9),
    truck_case("deflections +1 mm", deflection_offset=1e-3),
    truck_case("CG 0.2 m ahead", cm_x=0.2),
    truck_case("gravity on", gravity=STANDARD_GRAVITY),
    truck_case("gravity on, unaware", gravity=STANDARD_GRAVITY, gravity_aware=False),
)
ROBUSTNESS = (
    "kalman-bucy",
    "kalman-bucy-matched",
    "kalman-bucy-detecting",
    "kalman-bucy-sharp",
    "til",
)

R_FACTORS = (1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2)
"""Of the paper's R."""

Q_DENSITIES = (1e-3, 1e-1, 1e1, 1e3, 1e5)
"""Q of the parameters by their nominal values squared [1/s]."""


def table_2(making: Making) -> Result:
    """Every estimator in both readings of the noise, beside KBF Table 2."""
    metrics = ("mape_pct", "rmse", "time_to_10pct")
    return _table("kbf-table-2", CASES, RECIPES, making, metrics, tuple(UNITS))


def robustness(making: Making) -> Result:
    """MAPE under model error: the real truck differs from what the estimators believe."""
    return _table("kbf-robustness", ROBUSTNESS_CASES, some(*ROBUSTNESS), making)


def tuning(making: Making) -> Result:
    """KBF Section 4.1, "the lower the value of R compared to Q, the better": R and Q by decades."""
    recipes = {
        f"R x {factor:g}, q {density:g}": truck.kalman_bucy(_scaled(factor, density))
        for factor in R_FACTORS
        for density in Q_DENSITIES
    }
    return _table("kbf-tuning", CASES, recipes, making)


def _scaled(factor: float, density: float) -> KalmanBucySettings:
    paper = KalmanBucySettings()
    z, roll, pitch = (factor * r for r in paper.measurement_density)
    return replace(paper, measurement_density=(z, roll, pitch), parameter_density=density)


def _table(
    name: str,
    cases: tuple[Case, ...],
    recipes: Mapping[str, Recipe],
    making: Making,
    metrics: Sequence[str] = ("mape_pct",),
    quantities: tuple[str, ...] = TRUCK_PARAMETERS,
) -> Result:
    clock = Clock.started()
    experiment = truck.experiment(name, cases, recipes, quantities)
    found = rows(runs(experiment, making.seeds, making.duration), making.jobs, name)
    return clock.result(name, making, [row for row in found if row.metric in metrics])
