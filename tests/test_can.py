from contextlib import suppress

import can
import cantools
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from twin import Drive, TwinError
from twin.logs.can import read_bus, read_log
from twin.logs.can_signals import Database, decode
from twin.logs.raw_log import Wanted

DBC = """
VERSION ""
BU_: ECU
BO_ 256 Imu: 8 ECU
 SG_ ax : 0|16@1- (0.01,0) [-100|100] "m/s2" ECU
 SG_ ay : 23|16@0- (0.01,0) [-100|100] "m/s2" ECU
 SG_ temperature : 32|8@1+ (1,-40) [-40|215] "degC" ECU
BO_ 512 Chassis: 8 ECU
 SG_ page M : 0|4@1+ (1,0) [0|15] "" ECU
 SG_ steer m0 : 8|16@1- (0.1,0) [-1000|1000] "deg" ECU
 SG_ speed m1 : 8|16@1+ (0.01,0) [0|650] "km/h" ECU
BO_ 2147484672 Real: 8 ECU
 SG_ torque : 0|32@1- (1,0) [0|0] "N m" ECU
SIG_VALTYPE_ 2147484672 torque : 1;
"""
MAP = """
rate = 100
follow_speed = true
[can]
database = "car.dbc"
[channels]
ax = { name = "Imu.ax" }
steering_wheel_angle = { name = "Chassis.steer" }
vx = { name = "Chassis.speed" }
[constants]
road_height = 0.0
"""


@pytest.fixture(scope="module")
def database(tmp_path_factory):
    path = tmp_path_factory.mktemp("database") / "car.dbc"
    path.write_text(DBC)
    return Database.load(path)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "car.dbc").write_text(DBC)
    (tmp_path / "map.toml").write_text(MAP)
    return tmp_path


def _frames(seconds=1.0):
    """A bus at 100 Hz: signals that are known functions of time, and messages that nobody knows."""
    database = cantools.database.load_string(DBC, "dbc", strict=False)
    frames = []
    for k in range(round(100 * seconds)):
        t = 1000.0 + 0.01 * k
        page = k % 2
        chassis = {"page": page, **({"speed": 72.0} if page else {"steer": 0.1 * k})}
        for name, values, late in (
            ("Imu", {"ax": 0.01 * k, "ay": -0.01 * k, "temperature": 20}, 0.0),
            ("Chassis", chassis, 0.001),
            ("Real", {"torque": 1.5 * k}, 0.002),
        ):
            message = database.get_message_by_name(name)
            frames.append(
                can.Message(
                    timestamp=t + late,
                    arbitration_id=message.frame_id,
                    is_extended_id=message.is_extended_frame,
                    data=message.encode(values),
                )
            )
        frames.append(can.Message(timestamp=t + 0.003, arbitration_id=0x7FF, is_extended_id=False))
    return frames


def _write(path, frames):
    with can.Logger(path) as logger:
        for frame in frames:
            logger.on_message_received(frame)
    return path


@pytest.mark.parametrize("ending", [".blf", ".asc", ".log", ".trc", ".csv"])
def test_every_format_gives_the_same_signals(folder, ending):
    log = read_log(_write(folder / f"bus{ending}", _frames()), Wanted(database=folder / "car.dbc"))
    ax, steer = log.channels["Imu.ax"], log.channels["Chassis.steer"]
    assert ax.unit == "m/s2"
    assert ax.values == pytest.approx(0.01 * np.arange(100), abs=1e-9)
    assert log.channels["Imu.ay"].values == pytest.approx(-0.01 * np.arange(100), abs=1e-9)
    assert np.diff(ax.time) == pytest.approx(0.01, abs=2e-3)
    assert steer.values == pytest.approx(0.1 * np.arange(0, 100, 2), abs=1e-9)  # its pages only
    assert log.channels["Real.torque"].values == pytest.approx(1.5 * np.arange(100))
    assert any("100 frames are not in the database: 0x7ff" in note for note in log.notes)


def test_map_makes_a_drive_of_a_raw_log(folder):
    path = _write(folder / "bus.blf", _frames(3.0))
    drive = Drive.load(path, map=folder / "map.toml")
    assert drive.channel("vx")[2:] == pytest.approx(20.0)
    steer = np.degrees(drive.channel("steering_wheel_angle"))
    assert np.diff(steer) == pytest.approx(0.1, abs=0.01)  # at 100 Hz, one tenth a sample


def test_decoding_agrees_with_cantools_bit_by_bit(folder):
    reference = cantools.database.load_string(DBC, "dbc", strict=False)
    database = Database.load(folder / "car.dbc")
    rng = np.random.default_rng(0)
    payload = rng.integers(0, 256, (200, 8), dtype=np.uint8)
    for name, identifier in (("Imu", 256), ("Chassis", 512)):
        payload[:, 0] = np.where(name == "Chassis", payload[:, 0] % 2, payload[:, 0])
        found, short = decode(database.messages[identifier], payload, np.full(200, 8))
        assert short == 0
        for k, row in enumerate(payload):
            wanted = reference.get_message_by_name(name).decode(row.tobytes())
            for signal, values in found.items():
                if signal in wanted:
                    assert values[k] == pytest.approx(wanted[signal])
                else:
                    assert np.isnan(values[k])


def test_short_frames_are_counted_and_not_guessed(folder):
    frames = _frames()
    for frame in frames[::40]:
        frame.data, frame.dlc = frame.data[:1], 1
    log = read_log(_write(folder / "bus.blf", frames), Wanted(database=folder / "car.dbc"))
    assert log.channels["Imu.ax"].values.size == 90
    assert any("Imu: 10 frames are too short" in note for note in log.notes)


def test_frames_out_of_order_are_sorted(folder):
    path = _write(folder / "bus.log", _frames())
    lines = path.read_text().splitlines()
    lines[0], lines[40] = lines[40], lines[0]
    path.write_text("\n".join(lines))
    log = read_log(path, Wanted(database=folder / "car.dbc"))
    assert np.all(np.diff(log.channels["Imu.ax"].time) > 0.0)
    assert log.channels["Imu.ax"].values == pytest.approx(0.01 * np.arange(100), abs=1e-9)


def test_overlapping_signals_are_said(folder):
    text = DBC.replace("temperature : 32|8", "temperature : 8|8")
    (folder / "car.dbc").write_text(text)
    assert "signals overlap in Imu: ax, temperature" in Database.load(folder / "car.dbc").notes[0]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("car.dbc", b"\x00\xff nonsense", "cannot be read"),
        ("car.dbc", b"", "cannot be read"),
        ("car.dbc", b'VERSION ""', "has no messages"),
        ("car.txt", b"", "allowed: .dbc, .arxml, .kcd, .sym"),
    ],
)
def test_broken_database_is_one_line(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(TwinError, match=message) as error:
        Database.load(tmp_path / name)
    assert "\n" not in str(error.value)


def test_raw_log_without_a_database_names_the_map(folder):
    path = _write(folder / "bus.blf", _frames())
    with pytest.raises(TwinError, match=r"allowed: with a database, \[can\] in the map"):
        read_log(path, Wanted())


@pytest.mark.parametrize("ending", [".blf", ".asc", ".log", ".trc", ".csv", ".mf4"])
@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(content=st.binary(max_size=400))
def test_any_bytes_are_a_bus_or_one_line(tmp_path_factory, ending, content):
    path = tmp_path_factory.mktemp("fuzz") / f"bus{ending}"
    path.write_bytes(content)
    with suppress(TwinError):
        assert read_bus(path).frames


@settings(max_examples=200, deadline=None)
@given(data=st.lists(st.binary(max_size=8), min_size=2, max_size=8))
def test_any_payload_gives_finite_numbers_or_none(database, data):
    length = np.array([len(d) for d in data])
    payload = np.zeros((len(data), 8), dtype=np.uint8)
    for row, d in zip(payload, data, strict=True):
        row[: len(d)] = np.frombuffer(d, dtype=np.uint8)
    for message in database.messages.values():
        found, _ = decode(message, payload, length)
        assert all(np.isfinite(v[~np.isnan(v)]).all() for v in found.values())
