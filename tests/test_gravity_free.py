"""Accelerations free of gravity in hills: found, and right with the slope that is mapped."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from wrong_maps import LOAD, good_log, the_map

from scenarios.logs.estimators import til
from scenarios.logs.findings import findings, hills
from scenarios.logs.mass_interval import with_hills
from scenarios.logs.pieces import prepared
from twin import WHEELS, Drive, Vehicle

MASS, RADIUS = 2337.8 + LOAD, 0.3609


@pytest.fixture(scope="module")
def hilly(tmp_path_factory):
    """The good log as it would be in hills of 6 %: driven alike, hence with other torques."""
    path = good_log(tmp_path_factory.mktemp("hills"))
    table = pq.read_table(path)
    columns = {name: table[name].to_numpy() for name in table.column_names}
    slope = 0.06 * np.sin(2.0 * np.pi * columns["t"] / 25.0)
    moving = columns["wheel_speed_rl"] > 1.0
    force = MASS * 9.81 * np.sin(slope) * moving
    for wheel in WHEELS:
        columns[f"drive_torque_{wheel}"] = columns[f"drive_torque_{wheel}"] + 0.25 * RADIUS * force
    columns["slope"] = 100.0 * np.tan(slope) * moving
    columns["az"] = columns["az"] - 9.81
    pq.write_table(pa.table(columns), path)
    return path


def drive_by(path, head="", more=""):
    map_path = path.with_name("map.toml")
    map_path.write_text(head + the_map() + more)
    return Drive.load(path, map_path)


def test_accelerations_free_of_gravity_are_found(hilly):
    found = findings(drive_by(hilly), Vehicle.load("suv"))
    assert "free_of_gravity = true" in " ".join(map(str, found))
    without_az = the_map()
    start = without_az.index("[channels.az]")
    end = without_az.index("[channels.roll_rate]")
    (hilly.with_name("map.toml")).write_text(without_az[:start] + without_az[end:])
    found = findings(Drive.load(hilly, hilly.with_name("map.toml")), Vehicle.load("suv"))
    assert "hills" in " ".join(map(str, found))


def test_with_their_slope_they_give_the_mass(hilly):
    slope = '\n[channels.slope]\nname = "slope"\nunit = "%"\n'
    drive = drive_by(hilly, "free_of_gravity = true\n", slope)
    vehicle = Vehicle.load("suv")
    assert findings(drive, vehicle) == []
    # as an accelerometer in the same hills: what a twin on a flat road gets wrong there is known
    found = til(vehicle, prepared(drive, 1e-3))
    hill = hills(drive, vehicle)
    assert hill == pytest.approx(0.44, abs=0.1)
    found = with_hills(found, hill)
    assert 30.0 < found.sd["mass"] < 120.0
    assert abs(found.estimate["mass"][-1] - LOAD) < 1.96 * found.sd["mass"]


def test_level_town_has_no_hills(tmp_path):
    path = good_log(tmp_path)
    assert hills(drive_by(path), Vehicle.load("suv")) < 0.06
