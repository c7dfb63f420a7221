"""Cars that a calibration wrote, and deltas of a chassis."""

import numpy as np
import pytest

from scenarios.__main__ import main
from scenarios.calibration import calibrate
from scenarios.calibration.task import Task
from scenarios.driving.joint_drives import mixed
from scenarios.driving.manoeuvres import swept_steer
from scenarios.driving.record import record
from scenarios.logs.candidate import Candidate
from twin import LOAD, Twin, TwinError, Vehicle, parameter_deltas, with_noise

SUV = Vehicle.load("suv")
DELTAS = {"mass": 120.0, "cm_x": -0.05, "cm_y": 0.01, "cm_z": 0.03, "Jxx": 40.0, "Jzz": 300.0,
          "Jyy": 200.0, "Jxy": 5.0, "Jxz": -30.0, "Jyz": 3.0}  # fmt: skip
MAP = """
[time]
name = "t"
[channels]
ax = { name = "ax", unit = "m/s2" }
ay = { name = "ay", unit = "m/s2" }
yaw_rate = { name = "r", unit = "rad/s" }
steering_wheel_angle = { name = "steer", unit = "deg" }
"""


def test_changed_chassis_has_the_deltas():
    found = parameter_deltas(SUV.chassis(), SUV.changed(**DELTAS).chassis())[: len(LOAD)]
    assert dict(zip(LOAD, found, strict=True)) == pytest.approx(DELTAS, abs=1e-9)


def test_changed_car_drives_as_one_whose_parameters_were_set():
    changed, told = Twin(SUV.changed(**DELTAS)), Twin(SUV)
    p = np.zeros(len(told.parameters))
    p[: len(LOAD)] = [DELTAS[name] for name in LOAD]
    told.set_parameters(p)
    u = np.zeros(len(told.inputs))
    u[0] = 0.3
    for twin in (changed, told):
        twin.reset(20.0)
    for _ in range(300):
        one, other = changed.step(u), told.step(u)
    np.testing.assert_allclose(one, other, atol=1e-6)


@pytest.mark.parametrize(
    ("deltas", "message"),
    [
        ({"colour": 1.0}, "delta 'colour' is unknown; allowed: mass"),
        ({"mass": -2100.0}, "those of a rigid body"),
        ({"Jxx": 1e5}, "those of a rigid body"),
        ({"mass": float("nan")}, "mass is nan; allowed: a finite number"),
    ],
)
def test_deltas_of_no_body_are_refused(deltas, message):
    with pytest.raises(TwinError, match=message):
        SUV.changed(**deltas)


@pytest.fixture(scope="module")
def csv(tmp_path_factory):
    """Twelve seconds of a swept steer of a car with other tyres, at 100 Hz, as text."""
    drive = record(
        SUV.scaled(front_cornering_stiffness=1.15),
        swept_steer(duration=12.0, amplitude=0.6, highest=2.0),
    )
    names = {"ax": "ax", "ay": "ay", "yaw_rate": "r"}
    columns = {"t": drive.time, "steer": np.degrees(drive.channel("steering_wheel_angle"))}
    columns |= {ours: drive.channel(name) for name, ours in names.items()}
    text = MAP
    for wheel in ("fl", "fr", "rl", "rr"):
        columns[f"w_{wheel}"] = drive.channel(f"wheel_speed_{wheel}")
        text += f'wheel_speed_{wheel} = {{ name = "w_{wheel}", unit = "rad/s" }}\n'
        for kind in ("drive", "brake"):
            columns[f"{kind}_{wheel}"] = drive.channel(f"{kind}_torque_{wheel}")
            text += f'{kind}_torque_{wheel} = {{ name = "{kind}_{wheel}", unit = "N m" }}\n'
    folder = tmp_path_factory.mktemp("log")
    rows = np.column_stack(list(columns.values()))[::10]
    np.savetxt(folder / "log.csv", rows, delimiter=",", header=",".join(columns), comments="")
    (folder / "map.toml").write_text(text + "[constants]\nroad_height = 0.0\n")
    return folder


def test_log_of_another_program_makes_a_car_that_vehicle_takes(csv, tmp_path, capsys):
    out = tmp_path / "mine.toml"
    command = ["calibrate", str(csv / "log.csv"), "--map", str(csv / "map.toml")]
    command += ["--vehicle", "suv", "--free", "front_cornering_stiffness", "--out", str(out)]
    assert main([*command, "--evaluations", "5"]) == 0
    table = capsys.readouterr().out
    assert "held out, after" in table
    car = Vehicle.load(out)
    assert dict(car.scales)["front_cornering_stiffness"] == pytest.approx(1.15, abs=0.03)
    assert car.source == SUV.source
    estimate = ["estimate", str(csv / "log.csv"), "--map", str(csv / "map.toml")]
    assert main([*estimate, "--vehicle", str(out), "--out", str(tmp_path / "out")]) == 0


def test_calibration_of_a_car_beside_it_is_found_from_anywhere(tmp_path, monkeypatch):
    (tmp_path / "base.xml").write_text(SUV.source.read_text())
    (tmp_path / "tyres").mkdir()
    tyre = SUV.source.parent / "tyres" / "suv.tir"
    (tmp_path / "tyres" / "suv.tir").write_text(tyre.read_text())
    (tmp_path / "mine.toml").write_text('vehicle = "base.xml"\n[values.mass]\nvalue = 80.0\n')
    monkeypatch.chdir("/")
    car = Vehicle.load(tmp_path / "mine.toml")
    assert car.chassis().mass == pytest.approx(SUV.chassis().mass + 80.0)


@pytest.mark.slow
def test_intervals_hold_on_a_car_that_differs_in_what_is_not_freed():
    """Eight noise seeds of a car with 15 % more roll stiffness and 5 % less friction."""
    truth = {"front_cornering_stiffness": 1.1, "rear_cornering_stiffness": 0.95}
    real = SUV.scaled(**truth, front_anti_roll=1.15, rear_anti_roll=1.15, tyre_friction=0.95)
    clean = record(real, mixed(duration=30.0))
    covered = []
    for seed in range(8):
        drive = with_noise(clean, 20.0, np.random.default_rng(seed)).replace(truth={})
        task = Task(
            candidate=Candidate(vehicle=SUV),
            free=(*truth, "ay_offset", "yaw_rate_offset"),
            signals=("ay", "yaw_rate"),
            drives=(drive,),
        )
        found = calibrate.calibrate(task, evaluations=8)
        covered += [
            low <= value <= high
            for value, low, high in zip(truth.values(), found.low, found.high, strict=False)
        ]
    assert np.mean(covered) >= 0.85
