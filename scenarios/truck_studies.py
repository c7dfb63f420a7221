"""The tables of the truck: KBF Table 2, robustness, and the paper's claim about R and Q."""

from collections.abc import Sequence
from dataclasses import replace

from estimators.kalman_bucy import KalmanBucySettings
from scenarios.truck import NOISE, TruckCase
from scenarios.truck_score import ESTIMATORS, PARAMETERS, Row, filter_with, run_case
from twin.truck_parameters import STANDARD_GRAVITY

TABLE_2_CASES = tuple(TruckCase(name=name, noise=name) for name in NOISE)

ROBUSTNESS_CASES = (
    TruckCase(name="as the paper"),
    TruckCase(name="road class A", road_class="A"),
    TruckCase(name="road class E", road_class="E"),
    TruckCase(name="springs +10 %", spring_factor=1.1),
    TruckCase(name="springs -10 %", spring_factor=0.9),
    TruckCase(name="dampers +10 %", damper_factor=1.1),
    TruckCase(name="dampers -10 %", damper_factor=0.9),
    TruckCase(name="deflections +1 mm", deflection_offset=1e-3),
    TruckCase(name="CG 0.2 m ahead", cm_x=0.2),
    TruckCase(name="gravity on", gravity=STANDARD_GRAVITY),
    TruckCase(name="gravity on, filter unaware", gravity=STANDARD_GRAVITY, gravity_aware=False),
)

R_FACTORS = (1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2)
"""Of the paper's R."""

Q_DENSITIES = (1e-3, 1e-1, 1e1, 1e3, 1e5)
"""Q of the parameters by their nominal values squared [1/s]."""


def table_2(seeds: Sequence[int], *, jobs: int = 1) -> list[Row]:
    """Every estimator in both readings of the noise, beside KBF Table 2."""
    return [row for case in TABLE_2_CASES for row in run_case(case, ESTIMATORS, seeds, jobs=jobs)]


def robustness(seeds: Sequence[int], *, jobs: int = 1) -> list[Row]:
    """MAPE under model error: the real truck differs from what the filters believe."""
    names = ("kalman-bucy", "kalman-bucy-matched", "kalman-bucy-detecting", "kalman-bucy-sharp")
    estimators = {name: ESTIMATORS[name] for name in names}
    rows = []
    for case in ROBUSTNESS_CASES:
        rows += _parameter_errors(run_case(case, estimators, seeds, jobs=jobs))
    return rows


def tuning(seeds: Sequence[int], *, jobs: int = 1) -> list[Row]:
    """KBF Section 4.1, "the lower the value of R compared to Q, the better": R and Q by decades."""
    estimators = {
        f"R x {factor:g}, q {density:g}": filter_with(
            lambda case, factor=factor, density=density: _scaled(factor, density)
        )
        for factor in R_FACTORS
        for density in Q_DENSITIES
    }
    rows = []
    for case in TABLE_2_CASES:
        rows += _parameter_errors(run_case(case, estimators, seeds, jobs=jobs))
    return rows


def _scaled(factor: float, density: float) -> KalmanBucySettings:
    paper = KalmanBucySettings()
    z, roll, pitch = (factor * r for r in paper.measurement_density)
    return replace(paper, measurement_density=(z, roll, pitch), parameter_density=density)


def _parameter_errors(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row.metric == "mape_pct" and row.quantity in PARAMETERS]
