import os

import numpy as np
import pytest

from scenarios import p1
from scenarios.__main__ import main

has_data = pytest.mark.skipif(
    not os.environ.get(p1.VARIABLE), reason="needs the drives of STANFORD_P1"
)


def columns(late):
    """Weaving at 10 m/s; the navigation system's channels come late."""
    time = np.arange(0.0, 20.0, 0.002)
    yaw_rate = 0.3 * np.sin(2.0 * np.pi * 0.3 * time)
    later = 0.3 * np.sin(2.0 * np.pi * 0.3 * (time - late))
    speed = np.full_like(time, 10.0)
    return {"time": time, "yaw_rate": yaw_rate, "long_vel": speed, "ayG": speed * later}


@pytest.mark.parametrize(("late", "found"), [(0.44, 0.44), (0.1, 0.0), (0.0, 0.0)])
def test_late_navigation_system_is_told_from_tyres(late, found):
    assert p1._late(columns(late)) == pytest.approx(found, abs=0.02)


def test_folder_that_is_not_there_is_one_line(monkeypatch, capsys):
    monkeypatch.delenv(p1.VARIABLE, raising=False)
    assert main(["run", "p1"]) == 2
    assert "STANFORD_P1: is ''; allowed: a folder with RAMP_STEER_L.parquet" in (
        capsys.readouterr().err
    )


@has_data
def test_measured_drive_has_forces_and_a_car_of_its_weight():
    log = p1.read("STRAIGHT_LINE_1")
    assert log.late == 0.0
    measured, nominal = (row.median for row in p1._at_rest(log))
    assert measured == pytest.approx(nominal, rel=0.04)
    assert log.forces["fz_fl"].shape == log.drive.time.shape
