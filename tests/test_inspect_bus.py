"""`til inspect` of raw CAN logs: what is on the bus, and the map that it proposes."""

import math
from contextlib import suppress
from pathlib import Path

import can
import cantools
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import models
from scenarios.cli.log_commands import inspect
from scenarios.logs.bus import inspect_bus
from scenarios.logs.common_names import meaning_of, sign_of
from twin import TwinError
from twin.logs.can import is_bus_log

SUV = models.path("can/suv.dbc")
# A car as many are: km/h, degrees, torque of a motor and pressure of the brakes, no wheel torques
CAR = """
VERSION ""
BU_: ECU
BO_ 176 WHEEL_SPEEDS: 8 ECU
 SG_ WHEEL_SPEED_FR : 7|16@0+ (0.01,-67.67) [0|250] "km/h" ECU
 SG_ WHEEL_SPEED_FL : 23|16@0+ (0.01,-67.67) [0|250] "km/h" ECU
 SG_ WHEEL_SPEED_RR : 39|16@0+ (0.01,-67.67) [0|250] "km/h" ECU
 SG_ WHEEL_SPEED_RL : 55|16@0+ (0.01,-67.67) [0|250] "km/h" ECU
BO_ 37 STEERING: 8 ECU
 SG_ STEER_ANGLE : 0|12@1- (0.5,0) [-500|500] "deg" ECU
 SG_ STEER_RATE : 16|12@1- (1,0) [-2000|2000] "deg/s" ECU
BO_ 36 KINEMATICS: 8 ECU
 SG_ YAW_RATE : 0|16@1- (0.01,0) [0|0] "deg/sec" ECU
 SG_ LAT_ACCEL : 16|16@1- (0.001,0) [0|0] "g" ECU
 SG_ LONG_ACCEL : 32|16@1- (0.001,0) [0|0] "g" ECU
 SG_ YAW_RATE_VALID : 48|1@1+ (1,0) [0|1] "" ECU
BO_ 180 SPEED: 8 ECU
 SG_ SPEED : 0|16@1+ (0.01,0) [0|250] "km/h" ECU
BO_ 300 POWERTRAIN: 8 ECU
 SG_ MOTOR_TORQUE : 0|16@1- (0.1,0) [-1000|1000] "Nm" ECU
 SG_ BRAKE_PRESSURE : 16|16@1+ (0.01,0) [0|250] "bar" ECU
BO_ 301 NEVER_SENT: 8 ECU
 SG_ X : 0|16@1- (0.1,0) [0|0] "" ECU
"""


def _car_frames(seconds=3.0):
    database = cantools.database.load_string(CAR, "dbc", strict=False)
    frames = []
    for k in range(round(100 * seconds)):
        t = 0.01 * k
        wave = math.sin(t)
        wheels = {f"WHEEL_SPEED_{w}": 72.0 + wave for w in ("FR", "FL", "RR", "RL")}
        for name, values in (
            ("WHEEL_SPEEDS", wheels),
            ("STEERING", {"STEER_ANGLE": 20.0 * wave, "STEER_RATE": 20.0}),
            ("KINEMATICS", {"YAW_RATE": wave, "LAT_ACCEL": 0.03 * wave, "LONG_ACCEL": 0.1,
                            "YAW_RATE_VALID": 1}),
            ("SPEED", {"SPEED": 72.0}),
            ("POWERTRAIN", {"MOTOR_TORQUE": 50.0 * wave, "BRAKE_PRESSURE": 0.0}),
        ):  # fmt: skip
            message = database.get_message_by_name(name)
            frames.append(_frame(t, message.frame_id, message.encode(values, strict=False)))
        if k % 10 == 0:
            frames.append(_frame(t, 0x7FF, bytes(2)))
    return frames


def _suv_frames(seconds=2.0):
    database = cantools.database.load_file(str(SUV))
    frames = []
    for k in range(round(100 * seconds)):
        for j, message in enumerate(database.messages):
            values = {s.name: 9.8 if s.name == "az" else 5.0 for s in message.signals}
            frames.append(_frame(0.01 * k + 0.001 * j, message.frame_id, message.encode(values)))
    return frames


def _frame(time, identifier, data):
    return can.Message(
        timestamp=1e9 + time, arbitration_id=identifier, data=bytes(data), is_extended_id=False
    )


def _write(path, frames):
    with can.Logger(path) as logger:
        for frame in frames:
            logger.on_message_received(frame)
    return path


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "car.dbc").write_text(CAR)
    return tmp_path


def _til(*arguments):
    return CliRunner().invoke(inspect, arguments, catch_exceptions=False)


# --- names


REAL = [  # as databases of cars have them
    ("ESP_02", "ESP_Gierrate", "Unit_DegreOfArcPerSecon", "yaw_rate"),
    ("ESP_02", "ESP_QBit_Gierrate", "", None),
    ("ESP_02", "ESP_Querbeschleunigung", "Unit_ForceOfGravi", "ay"),
    ("ESP_02", "ESP_Laengsbeschl", "Unit_MeterPerSeconSquar", "ax"),
    ("ESP_19", "ESP_HL_Radgeschw_02", "Unit_KiloMeterPerHour", "wheel_speed_rl"),
    ("ESP_21", "ESP_v_Signal", "Unit_KiloMeterPerHour", "vx"),
    ("ESP_05", "ESP_Bremsdruck", "Unit_Bar", "brake_pressure"),
    ("ESP_05", "ESP_BKV_Unterdruck", "Unit_MilliBar", None),
    ("LWI_01", "LWI_Lenkradwinkel", "Unit_DegreOfArc", "steering_wheel_angle"),
    ("WHL_SPD11", "WHL_SPD_FL", "km/h", "wheel_speed_fl"),
    ("SAS11", "SAS_Angle", "Deg", "steering_wheel_angle"),
    ("SAS11", "SAS_Speed", "", None),
    ("ESP12", "CYL_PRES", "Bar", "brake_pressure"),
    ("Yaw_Data", "VehRol_W_Actl", "rad/s", "roll_rate"),
    ("WheelSpeed", "WhlRr_W_Meas", "rad/s", "wheel_speed_rr"),
    ("EBCMWheelSpdFront", "FLWheelSpd", "km/h", "wheel_speed_fl"),
    ("PSCMSteeringAngle", "SteeringWheelRate", "deg/s", None),
    ("ESP_wheelSpeeds", "ESP_wheelSpeedReR", "rpm", "wheel_speed_rr"),
    ("RCM_inertial2", "RCM_longitudinalAccel", "m/s^2", "ax"),
    ("WheelsFront", "LeftSpeed", "km/h", "wheel_speed_fl"),
    ("Motors", "MotorTorqueFront", "Nm", "motor_torque_front"),
    ("Motors", "EM_RL_Torque", "Nm", "drive_torque_rl"),
    ("Motors", "MotorTorqueRequest", "Nm", None),
    ("EPS", "STEER_MOTOR_TORQUE", "Nm", None),
    ("Engine", "ENG_SPEED", "rpm", None),
    ("Brakes", "BrakePressFL", "bar", None),
    ("Ins", "SideSlipAngle", "deg", "sideslip"),
    ("GEARBOX", "GEAR", "", "gear"),
]


@pytest.mark.parametrize(("message", "signal", "unit", "channel"), REAL, ids=[r[1] for r in REAL])
def test_name_and_unit_say_the_channel(message, signal, unit, channel):
    found = meaning_of(message, signal, unit)
    assert (found and found.channel) == channel


def test_unit_of_another_kind_is_no_measurement_of_that_name():
    assert meaning_of("Imu", "yaw_rate", "bar") is None


def test_sign_in_another_signal_is_found():
    others = ["ESP_02_CRC", "ESP_QBit_Gierrate", "ESP_VZ_Gierrate"]
    assert sign_of("ESP_Gierrate", others) == "ESP_VZ_Gierrate"
    assert sign_of("ESP_Querbeschleunigung", others) is None


# --- what is shown


def test_messages_rates_gaps_and_unknown_identifiers_are_shown(folder):
    frames = [
        f for f in _car_frames() if not (f.arbitration_id == 180 and 1.0 < f.timestamp - 1e9 < 2)
    ]
    done = _til(str(_write(folder / "bus.blf", frames)), "--dbc", "car.dbc")
    assert done.exit_code == 0, done.output
    rows = {line.split()[0]: line.split() for line in done.output.splitlines() if line.split()}
    assert rows["0xb0"][1:6] == ["WHEEL_SPEEDS", "8", "300", "100", "0.01"]
    assert float(rows["0xb4"][5]) == pytest.approx(1.0, abs=0.02)  # its longest gap
    assert "0x7ff" in rows
    assert "30 frames are not in the database: 0x7ff." in done.output
    assert "In the database, but not on the bus: NEVER_SENT." in done.output
    low, middle, high = map(float, rows["STEERING.STEER_ANGLE"][3:6])
    assert (low, high) == pytest.approx((0.0, 20.0), abs=0.5)
    assert low < middle < high


@pytest.mark.parametrize("ending", [".blf", ".asc", ".log", ".trc", ".csv"])
def test_raw_log_is_known_without_a_database(folder, ending):
    path = _write(folder / f"bus{ending}", _car_frames(0.5))
    assert is_bus_log(path)
    done = _til(str(path))
    assert done.exit_code == 0
    assert "0xb0" in done.output
    assert "--dbc" in done.output


def test_table_of_numbers_is_no_bus(tmp_path):
    for name in ("log.csv", "log.log"):
        (tmp_path / name).write_text("t,ax\n0.0,1.0\n0.1,2.0\n")
        assert not is_bus_log(tmp_path / name)


# --- the proposed map


def test_proposed_map_is_accepted_as_it_is(folder):
    _write(folder / "bus.blf", _suv_frames())
    (folder / "suv.dbc").write_text(SUV.read_text())
    shown = _til("bus.blf", "--dbc", "suv.dbc")
    text = shown.output[shown.output.index("# map.toml") :]
    Path("map.toml").write_text(text)
    done = _til("bus.blf", "--map", "map.toml", "--vehicle", "suv")
    assert done.exit_code == 0, done.output
    for channel in ("brake_torque_rr", "wheel_speed_fl", "steering_wheel_angle", "az"):
        assert f"{channel}: " in done.output
    assert "follow_speed" not in text


def test_map_is_written_only_if_asked_for_and_never_over_another(folder):
    _write(folder / "bus.log", _car_frames())
    assert _til("bus.log", "--dbc", "car.dbc").exit_code == 0
    assert not list(folder.glob("*.toml"))
    done = _til("bus.log", "--dbc", "car.dbc", "--write-map", "map.toml")
    assert done.exit_code == 0, done.output
    assert _til("bus.log", "--map", "map.toml").exit_code == 0
    again = _til("bus.log", "--dbc", "car.dbc", "--write-map", "map.toml")
    assert again.exit_code == 2
    assert "map.toml exists" in again.output


def test_torques_that_the_car_does_not_explain_are_left_out_and_shown(folder):
    text = inspect_bus(_write(folder / "bus.blf", _car_frames()), Path("car.dbc"), None).map
    assert "follow_speed = true" in text
    assert "radius is a guess" in text
    assert '# motor_torque = { name = "POWERTRAIN.MOTOR_TORQUE" }' in text
    assert "YAW_RATE_VALID" not in text


def test_torques_that_the_car_explains_are_proposed(folder):
    _write(folder / "bus.blf", _car_frames())
    found = _til("bus.blf", "--dbc", "car.dbc", "--vehicle", str(_electric(folder)))
    assert found.exit_code == 0, found.output
    assert '\nmotor_torque = { name = "POWERTRAIN.MOTOR_TORQUE" }' in found.output
    assert "follow_speed" not in found.output
    assert "Tried: it gives a drive" in found.output


def _electric(folder):
    (folder / "electric.toml").write_text(
        "[signals]\ndriven = 'rear'\nfinal_drive = 9.1\n"
        "brake_torque_per_bar_front = 60.0\nbrake_torque_per_bar_rear = 40.0\n"
    )
    return folder / "electric.toml"


def test_map_without_a_steering_signal_says_so(folder):
    frames = [f for f in _car_frames() if f.arbitration_id != 37]
    report = inspect_bus(_write(folder / "bus.blf", frames), Path("car.dbc"), None)
    assert "# NOT COMPLETE, no signal found for: steering_wheel_angle" in report.map
    assert "It is not complete" in report.text


# --- hostile


frames_of_nobody = st.lists(
    st.builds(
        can.Message,
        timestamp=st.floats(0.0, 1e9),
        arbitration_id=st.one_of(st.sampled_from([176, 37, 36, 180, 300]), st.integers(0, 0x7FF)),
        is_extended_id=st.booleans(),
        is_error_frame=st.booleans(),
        is_remote_frame=st.just(False),
        data=st.binary(max_size=8),
        check=st.just(False),
    ),
    min_size=1,
    max_size=40,
)


@given(frames_of_nobody)
@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
def test_hostile_frames_are_a_table_or_one_line(tmp_path_factory, frames):
    folder = tmp_path_factory.mktemp("hostile")
    (folder / "car.dbc").write_text(CAR)
    path = _write(folder / "bus.blf", frames)
    with suppress(TwinError):
        report = inspect_bus(path, folder / "car.dbc", None)
        assert "nan" not in report.text.split("A map by")[0]


def test_overlapping_signals_and_shared_identifiers_are_one_line_each(folder):
    text = CAR.replace("STEER_RATE : 16|12", "STEER_RATE : 8|12").replace("BO_ 301", "BO_ 36")
    (folder / "car.dbc").write_text(text)
    report = inspect_bus(_write(folder / "bus.blf", _car_frames()), Path("car.dbc"), None)
    assert "signals overlap in STEERING: STEER_ANGLE, STEER_RATE" in report.text
    assert "shares its identifier" in report.text


def test_names_that_toml_must_quote_are_quoted(folder):
    text = CAR.replace('"deg/sec"', '"deg/s"').replace('"g"', '"\x07 # ]"')
    (folder / 'odd "name".dbc').write_text(text)
    _write(folder / "bus.blf", _car_frames())
    done = _til("bus.blf", "--dbc", 'odd "name".dbc', "--write-map", "map.toml")
    assert done.exit_code == 0, done.output
    assert _til("bus.blf", "--map", "map.toml").exit_code == 0
