"""TiL Tables 3 to 6: the paper's figures beside ours."""

import time
from pathlib import Path

import numpy as np

from scenarios import mass, pitch, roll_yaw
from scenarios.experiment.result import Result, Row
from scenarios.experiment.study import REAL, TWIN, Study, rows
from scenarios.papers import joint_tables
from twin import Vehicle


def table_3(seeds: int, jobs: int, out: Path) -> Result:
    """Our loaded chassis beside the paper's, which no point masses of Table 2 can give."""
    start = time.perf_counter()
    real, nominal = Vehicle.load(REAL).chassis(), Vehicle.load(TWIN).chassis()
    # d is measured from the front axle and the road: where the chassis frame stands
    place = np.array([-1.25, 0.0, 0.644])
    quantities = (
        ("mass", "kg", real.mass, 2480.8),
        ("Jxx", "kg m2", real.inertia[0, 0], 901.9),
        ("Jyy", "kg m2", real.inertia[1, 1], 4394.4),
        ("Jzz", "kg m2", real.inertia[2, 2], 4760.0),
        ("cm_x", "cm", 100.0 * (real.cm + place)[0], -131.6),
        ("cm_y", "cm", 100.0 * (real.cm + place)[1], 1.6),
        ("cm_z", "cm", 100.0 * (real.cm + place)[2], 68.4),
    )
    return Result(
        name="til-table-3",
        settings={"nominal_mass": nominal.mass},
        seconds=time.perf_counter() - start,
        rows=[
            Row.over_seeds(
                [value], case="loaded chassis", quantity=name, metric="value", unit=unit,
                estimator="model", paper=paper,
            )
            for name, unit, value, paper in quantities
        ],
    )  # fmt: skip


def table_4(seeds: int, jobs: int, out: Path) -> Result:
    """Mass."""
    return _table("til-table-4", mass.STUDY, seeds, jobs)


def table_5(seeds: int, jobs: int, out: Path) -> Result:
    """Roll and yaw inertia, also by the joint observer."""
    return _table("til-table-5", roll_yaw.STUDY, seeds, jobs, joint=True)


def table_6(seeds: int, jobs: int, out: Path) -> Result:
    """Pitch inertia, also by the joint observer."""
    return _table("til-table-6", pitch.STUDY, seeds, jobs, joint=True)


def _table(name: str, study: Study, seeds: int, jobs: int, *, joint: bool = False) -> Result:
    start = time.perf_counter()
    found = rows(study, study.cases, range(seeds), jobs)
    if joint:
        found += joint_tables.rows(study, study.cases, range(seeds), jobs)
    return Result(
        name=name,
        settings={"seeds": seeds},
        seconds=time.perf_counter() - start,
        rows=found,
    )
