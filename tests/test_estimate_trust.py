"""`til estimate` says when an estimate is not to be trusted, and why."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenarios import __main__ as cli
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import record
from twin import INPUTS, WHEELS, Vehicle

TORQUES = [name for name in INPUTS if "torque" in name]
NAMES = ["ax", "steering_wheel_angle", *(f"wheel_speed_{w}" for w in WHEELS), *TORQUES]


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Ten seconds of the loaded car at 50 Hz."""
    drive = record(Vehicle.load("suv_loaded"), urban(duration=12.0))
    columns = {"t": drive.time[2000::20]}
    columns |= {name: drive.channel(name)[2000::20] for name in NAMES}
    path = tmp_path_factory.mktemp("log") / "log.parquet"
    pq.write_table(pa.table(columns), path)
    return path


def estimated(log, capsys, factor=1.0, changes=""):
    lines = ["[constants]", "road_height = 0", "[channels]"]
    for name in NAMES:
        unit = "N m" if "torque" in name else "rad/s" if "wheel_speed" in name else "rad"
        unit = "m/s2" if name == "ax" else unit
        scale = factor if "torque" in name else 1.0
        more = changes if name == "ax" else ""
        lines.append(f'{name} = {{ name = "{name}", unit = "{unit}", factor = {scale}{more} }}')
    path = log.with_name("map.toml")
    path.write_text("\n".join(lines))
    out = log.with_name(f"out{factor}{bool(changes)}")
    args = ["estimate", str(log), "--map", str(path), "--vehicle", "suv", "--out", str(out)]
    assert cli.main([*args, "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    told = result["logs"][0]
    return told, told["answer"], pq.read_table(out / "log.til.parquet")


def test_right_map_is_trustworthy(log, capsys):
    told, answer, _ = estimated(log, capsys)
    assert told["trustworthy"] is True
    assert told["faults"] == []
    mass = answer["quantities"][0]
    assert mass["low"] < 355.0 < mass["high"]


def test_estimate_on_its_bound_is_not_trustworthy_and_says_so(log, capsys):
    told, answer, history = estimated(log, capsys, factor=2.5)
    assert told["trustworthy"] is False
    assert answer["quantities"][0]["change"] == pytest.approx(0.6 * 2337.8, rel=1e-4)
    assert "mass rests on the bound of its estimate, 1402.68 kg." in told["faults"]
    assert answer["trusted"] == 0.0
    assert not np.asarray(history["trustworthy"]).any()


def test_finding_makes_an_estimate_not_trustworthy_with_its_reason(log, capsys):
    told, _, _ = estimated(log, capsys, changes=", delay = -0.4")
    assert told["trustworthy"] is False
    assert "ax is 0.4" in told["faults"][0]
    assert "[channels.ax] delay = 0.4" in told["faults"][0]
