"""The tables of the truck: KBF Table 2, robustness, and the paper's claim about R and Q."""

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from estimators.benchmarks.kalman_bucy import KalmanBucySettings
from scenarios.experiment.result import Result, Row
from scenarios.papers.truck_drive import NOISE, TruckCase
from scenarios.papers.truck_estimators import ESTIMATORS, kalman_bucy, some
from scenarios.papers.truck_score import UNITS, run_cases
from twin.truck.parameters import STANDARD_GRAVITY

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
    TruckCase(name="gravity on, unaware", gravity=STANDARD_GRAVITY, gravity_aware=False),
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


def table_2(seeds: int, jobs: int, out: Path) -> Result:
    """Every estimator in both readings of the noise, beside KBF Table 2."""
    start = time.perf_counter()
    rows = run_cases(TABLE_2_CASES, ESTIMATORS, range(seeds), jobs=jobs, quantities=tuple(UNITS))
    return _result("kbf-table-2", seeds, start, rows)


def robustness(seeds: int, jobs: int, out: Path) -> Result:
    """MAPE under model error: the real truck differs from what the estimators believe."""
    start = time.perf_counter()
    rows = run_cases(
        ROBUSTNESS_CASES, some(*ROBUSTNESS), range(seeds), jobs=jobs, metrics=("mape_pct",)
    )
    return _result("kbf-robustness", seeds, start, rows)


def tuning(seeds: int, jobs: int, out: Path) -> Result:
    """KBF Section 4.1, "the lower the value of R compared to Q, the better": R and Q by decades."""
    start = time.perf_counter()
    estimators = {
        f"R x {factor:g}, q {density:g}": partial(kalman_bucy, settings=_scaled(factor, density))
        for factor in R_FACTORS
        for density in Q_DENSITIES
    }
    rows = run_cases(TABLE_2_CASES, estimators, range(seeds), jobs=jobs, metrics=("mape_pct",))
    return _result("kbf-tuning", seeds, start, rows)


def _scaled(factor: float, density: float) -> KalmanBucySettings:
    paper = KalmanBucySettings()
    z, roll, pitch = (factor * r for r in paper.measurement_density)
    return replace(paper, measurement_density=(z, roll, pitch), parameter_density=density)


def _result(name: str, seeds: int, start: float, rows: Sequence[Row]) -> Result:
    return Result(
        name=name, settings={"seeds": seeds}, seconds=time.perf_counter() - start, rows=rows
    )
