"""A wrong sign, unit or delay in a log shows before anything is estimated."""

import numpy as np
import pytest

from scenarios.driving.manoeuvres import swept_steer
from scenarios.driving.record import record
from scenarios.logs.checks import checks
from scenarios.logs.inspect import inspect_log
from twin import OUTPUTS, Vehicle


@pytest.fixture(scope="module")
def drive():
    manoeuvre = swept_steer(duration=12.0, highest=1.0, sweep=12.0)
    manoeuvre.speed[:] = 20.0 + 3.0 * np.sin(1.5 * np.arange(12_000) * 1e-3)
    return record(Vehicle.load("suv"), manoeuvre)


def changed(drive, name, function):
    """The drive as a log would have it, speeds measured, one channel of it changed."""
    names = (*OUTPUTS, "vx", "vy")
    values = {n: drive.truth[n] if n in ("vx", "vy") else drive.channel(n) for n in names}
    values[name] = function(values[name])
    columns = np.column_stack(list(values.values()))
    return drive.replace(measurements=columns, output_names=names, truth={})


def verdicts(drive):
    return {check.name.split(" ")[0]: check.verdict for check in checks(drive)}


def test_sound_drive_passes_every_check(drive):
    assert set(verdicts(drive).values()) == {"good"}
    found = {check.name: check for check in checks(drive)}
    lateral = found["ay = vx yaw_rate + dvy/dt"]
    assert lateral.correlation > 0.99
    assert lateral.slope == pytest.approx(1.0, abs=0.12)  # 1, and gravity on the rolling body
    assert found["vx = radius wheel speed"].slope == pytest.approx(0.358, abs=0.015)  # slip


@pytest.mark.parametrize(
    ("name", "check"),
    [
        ("ay", "ay"),
        ("yaw_rate", "ay"),
        ("ax", "ax"),
        ("roll_rate", "roll_rate"),
        ("pitch_rate", "pitch_rate"),
        ("az", "az"),
    ],
)
def test_wrong_sign_is_found(drive, name, check):
    assert f"WRONG SIGN of {check}" in verdicts(changed(drive, name, np.negative))[check]


def test_wrong_unit_is_found(drive):
    assert "wrong unit or scale" in verdicts(changed(drive, "ay", lambda a: a / 9.81))["ay"]
    assert "without gravity" in verdicts(changed(drive, "az", lambda a: a - 9.81))["az"]


def test_delay_is_measured(drive):
    late = changed(drive, "ay", lambda a: np.roll(a, 200))
    assert {c.name[:2]: c for c in checks(late)}["ay"].lag == pytest.approx(0.2, abs=0.015)


def test_check_without_its_channels_says_which(drive):
    bare = drive.replace(
        measurements=drive.measurements[:, :1], output_names=("ax",), truth={}, inputs=drive.inputs
    )
    said = verdicts(bare)
    assert said["ay"] == "cannot be made without ay, yaw_rate, vx or the wheel speeds"


def test_wheel_speeds_stand_in_for_the_speed(drive):
    found = {check.name: check for check in checks(drive.replace(truth={}))}
    lateral = found["ay = wheels yaw_rate"]
    assert (lateral.verdict, lateral.unit) == ("good", "m")
    assert lateral.slope == pytest.approx(0.36, abs=0.1)


def test_inspection_shows_channels_what_the_map_does_and_the_checks(tmp_path):
    (tmp_path / "log.csv").write_text("t,a [g],gear\n0,1,P\n0.1,,P\n0.2,1,P\n1,2,D\n")
    text = inspect_log(tmp_path / "log.csv", None).text
    assert text.splitlines()[3].split() == ["a", "[g]", "g", "3", "4", "1", "0", "-", "1", "1", "2"]
    assert 'gear     "P"' in text
    assert "No checks" in text
    (tmp_path / "map.toml").write_text(
        '[channels.ax]\nname = "a [g]"\n[constants]\nsteering_wheel_angle = 0\n'
        "drive_torque = 0\nbrake_torque = 0\nroad_height = 0\n"
    )
    text = inspect_log(tmp_path / "log.csv", tmp_path / "map.toml").text
    assert "ax: from 'a [g]' in g at 3 Hz" in text
    assert "cannot be made without ay, yaw_rate" in text
