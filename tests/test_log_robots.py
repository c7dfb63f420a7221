"""Logs in MCAP, MATLAB's .mat, RaceLogic's .vbo and AiM's .xrk, written here and read back."""

import json
import struct
import warnings
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin import Drive, TwinError
from twin.logs.formats import format_of
from twin.logs.log_time import TimeWanted
from twin.logs.raw_log import Wanted

N = 50
TIME = 1_700_000_000.0 + 0.02 * np.arange(N)
A, W = np.sin(TIME), 20.0 + np.cos(TIME)
IMU = """std_msgs/Header header
geometry_msgs/Vector3 linear_acceleration
float32[4] wheels
string note
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def mcap(path, *, stamped=True, late=0.05):
    """An MCAP file of two topics; messages are recorded some time after their stamps."""
    from mcap_ros2.writer import Writer

    with path.open("wb") as file, Writer(file) as writer:
        imu = writer.register_msgdef("test_msgs/msg/Imu", IMU)
        speed = writer.register_msgdef("std_msgs/msg/Float64", "float64 data")
        for k in range(N):
            sec, nanosec = divmod(round(1e9 * TIME[k]), 10**9)
            stamp = {"sec": sec if stamped else 0, "nanosec": nanosec if stamped else 0}
            now = round(1e9 * (TIME[k] + late))
            message = {
                "header": {"stamp": stamp, "frame_id": "imu"},
                "linear_acceleration": {"x": A[k], "y": 0.0, "z": 9.81},
                "wheels": [W[k]] * 4,
                "note": "x",
            }
            writer.write_message("/vehicle/imu", imu, message, now, now)
            writer.write_message("/speed", speed, {"data": W[k]}, now, now)
    return path


MAP = """rate = 50
[channels]
ax = { name = "/vehicle/imu.linear_acceleration.x", unit = "m/s2" }
wheel_speed_fl = { name = "/vehicle/imu.wheels[0]", unit = "rad/s" }
[constants]
steering_wheel_angle = 0
drive_torque = 0
brake_torque = 0
road_height = 0
"""


def test_map_names_topic_and_field_of_mcap(tmp_path):
    (tmp_path / "map.toml").write_text(MAP)
    drive = Drive.load(mcap(tmp_path / "log.mcap"), tmp_path / "map.toml")
    np.testing.assert_allclose(drive.time[:N], TIME, atol=1e-6)
    np.testing.assert_allclose(drive.channel("ax")[:N], A, atol=1e-6)
    np.testing.assert_allclose(drive.channel("wheel_speed_fl")[:N], W, atol=1e-5)


def test_mcap_without_stamps_takes_the_times_of_recording_and_says_so(tmp_path):
    log = format_of("a.mcap").read_log(mcap(tmp_path / "log.mcap", stamped=False), Wanted())
    np.testing.assert_allclose(log.channels["/speed.data"].time, TIME + 0.05, atol=1e-6)
    np.testing.assert_allclose(log.channels["/vehicle/imu.wheels[3]"].values, W, atol=1e-5)
    assert "/vehicle/imu: times are those of recording" in " ".join(log.notes)
    with pytest.raises(TwinError, match="MCAP has times of its own"):
        format_of("a.mcap").read_log(tmp_path / "log.mcap", Wanted(TimeWanted("t")))


def test_mcap_of_json_is_read(tmp_path):
    from mcap.writer import Writer

    with (tmp_path / "log.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("car", "jsonschema", b"{}")
        channel = writer.register_channel("/car", "json", schema)
        for k in range(N):
            now = round(1e9 * TIME[k])
            writer.add_message(channel, now, json.dumps({"v": W[k], "on": True}).encode(), now)
        writer.finish()
    log = format_of("a.mcap").read_log(tmp_path / "log.mcap", Wanted())
    np.testing.assert_allclose(log.channels["/car.v"].values, W)


@pytest.mark.parametrize(
    "content",
    [
        {"t": TIME - TIME[0], "a": A, "n": 3.0},
        {"log": {"time": TIME - TIME[0], "a": A, "name": "X"}},
        {
            "a": {"Time": TIME - TIME[0], "Value": A, "Units": "g"},
            "b": {"Time": [0, 1.0], "Value": [1, 2.0]},
        },
        {"time": (TIME - TIME[0])[:, None], "a": A[:, None], "other": np.ones(7)},
    ],
)  # fmt: skip
def test_mat_of_version_5_is_read(tmp_path, content):
    from scipy import io

    io.savemat(tmp_path / "log.mat", content)
    log = format_of("a.mat").read_log(tmp_path / "log.mat", Wanted())
    name = "log.a" if "log" in content else "a"
    np.testing.assert_allclose(log.channels[name].time, TIME - TIME[0], atol=1e-9)
    np.testing.assert_allclose(log.channels[name].values, A)
    assert log.channels[name].unit == ("g" if "b" in content else "")


def test_mat_of_version_7_is_read(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.mat", "w", userblock_size=512) as file:
        for name, values in (("time", TIME - TIME[0]), ("a", A), ("m", np.array([A, W]).T)):
            item = file.create_dataset(f"log/{name}", data=np.atleast_2d(values.T))
            item.attrs["MATLAB_class"] = np.bytes_(b"double")
    log = format_of("a.mat").read_log(tmp_path / "log.mat", Wanted(TimeWanted("log.time", 1.0)))
    np.testing.assert_allclose(log.channels["log.a"].values, A)
    np.testing.assert_allclose(log.channels["log.m[1]"].values, W)


def test_mat_without_time_and_ten_gigabytes_of_claims_are_one_line(tmp_path):
    from scipy import io

    h5py = pytest.importorskip("h5py")
    io.savemat(tmp_path / "log.mat", {"k": np.arange(N), "a": A})
    with pytest.raises(TwinError, match="no column is called time"):
        format_of("a.mat").read_log(tmp_path / "log.mat", Wanted())
    with h5py.File(tmp_path / "big.mat", "w") as file:
        file.create_dataset("a", shape=(1_250_000_000, 1), dtype="f8", chunks=(1000, 1))
    with pytest.raises(TwinError, match="declares 1,250,000,000 values"):
        format_of("a.mat").read_log(tmp_path / "big.mat", Wanted())


VBO = """File created on 25/11/2026 at 12:00:00

[header]
satellites
time
velocity kmh
heading
Long accel

[channel units]
g

[comments]
made by a test

[column names]
sats time velocity heading LongAcc

[data]
"""


def test_vbo_is_read_with_its_clock_and_units(tmp_path):
    clock = [
        f"2359{59 + 0.02 * k:05.2f}" if k < 50 else f"0000{0.02 * (k - 50):05.2f}"
        for k in range(70)
    ]
    rows = [f"008 {c} {3.6 * k:.3f} 090.00 {0.01 * k:+.3E}" for k, c in enumerate(clock)]
    (tmp_path / "log.vbo").write_text(VBO + "\n".join([*rows, "008 0000"]))
    log = format_of("a.vbo").read_log(tmp_path / "log.vbo", Wanted())
    speed, acceleration = log.channels["velocity"], log.channels["LongAcc"]
    np.testing.assert_allclose(np.diff(speed.time), 0.02, atol=1e-6)
    assert (speed.unit, acceleration.unit) == ("km/h", "g")
    np.testing.assert_allclose(acceleration.values, 0.01 * np.arange(70), atol=1e-6)
    assert "1 rows that have not 5 cells are left out." in log.notes


def aim_message(token, body):
    framed = token.ljust(4).encode()
    tail = b"<" + framed + struct.pack("<H", sum(body) & 0xFFFF) + b">"
    return b"<h" + framed + struct.pack("<iB", len(body), 1) + b">" + body + tail


def aim_channel(index, name, unit, period):
    body = bytearray(112)
    struct.pack_into("<H", body, 0, index)
    body[12], body[16], body[20], body[72] = unit, 9, 6, 4  # of a CAN bus, numbers of 4 bytes
    body[24:32] = name[:8].encode().ljust(8, b"\0")
    body[32:56] = name.encode().ljust(24, b"\0")
    struct.pack_into("<I", body, 64, 1000 * period)
    return aim_message("CHS", bytes(body))


def xrk(path, gps=True):
    """Yaw rate [deg/s] every 10 ms, a speed [km/h] every 20 ms, both from 1 s on."""
    kinds = (("Yaw Rate", 5, 10), ("Speed", 16, 20))
    head = b"".join(aim_channel(i, *kind) for i, kind in enumerate(kinds))
    content = aim_message("CNF", head)
    for index, (_, _, period) in enumerate(kinds):
        for stamp in range(1000, 3000, period):
            content += b"(S" + struct.pack("<iHf", stamp, index, stamp / 100.0) + b")"
    if gps:
        content += aim_message("GPS", struct.pack("<i", 1000) + bytes(52))
        content += aim_message("TRK", bytes(64))
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("packed", [False, True])
def test_xrk_is_read_with_its_clock_and_units(tmp_path, packed):
    path = xrk(tmp_path / "log.xrk")
    if packed:
        path = tmp_path / "log.xrz"
        path.write_bytes(zlib.compress((tmp_path / "log.xrk").read_bytes()))
    log = format_of(path).read_log(path, Wanted())
    yaw_rate, speed = log.channels["Yaw Rate"], log.channels["Speed"]
    assert (yaw_rate.unit, speed.unit) == ("deg/s", "km/h")
    np.testing.assert_allclose(np.diff(yaw_rate.time), 0.01, atol=1e-9)
    np.testing.assert_allclose(speed.time, np.arange(0.0, 2.0, 0.02), atol=1e-9)
    np.testing.assert_allclose(speed.values, 10.0 + speed.time / 0.1, rtol=1e-6)
    assert "GPS Speed" in log.text  # the one sample that the test wrote


def test_xrk_without_gps_is_refused_with_the_way_out(tmp_path):
    path = xrk(tmp_path / "log.xrk", gps=False)
    with pytest.raises(TwinError, match="allowed: a log with GPS, or an export as CSV"):
        format_of(path).read_log(path, Wanted())


def test_xrz_that_unpacks_to_more_than_fits_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("twin.logs.aim._LARGEST_UNPACKED", 10_000)
    path = tmp_path / "bomb.xrz"
    path.write_bytes(zlib.compress(bytes(1_000_000)))
    with pytest.raises(TwinError, match="has over 10,000 bytes"):
        format_of(path).read_log(path, Wanted())


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """Sound files of each kind."""
    from scipy import io

    folder = tmp_path_factory.mktemp("fuzz")
    mcap(folder / "sound.mcap")
    io.savemat(folder / "sound.mat", {"t": TIME - TIME[0], "a": A}, do_compression=True)
    rows = [f"008 1200{0.02 * k:05.2f} {k} 90 0.1" for k in range(N)]
    (folder / "sound.vbo").write_text(VBO + "\n".join(rows))
    xrk(folder / "sound.xrk")
    (folder / "sound.csv").write_text("t,a\n" + "".join(f"{k},{k}\n" for k in range(N)))
    return folder


@pytest.mark.parametrize("kind", ["mcap", "mat", "vbo", "xrk", "csv"])
@settings(deadline=None, max_examples=40)
@given(data=st.data())
def test_damaged_file_is_read_or_ends_in_one_line(sound, kind, data):
    content = (sound / f"sound.{kind}").read_bytes()
    start = data.draw(st.integers(0, len(content) - 1))
    patch = data.draw(st.one_of(st.binary(max_size=12), st.just(struct.pack("<Q", 2**63 - 1))))
    length = data.draw(st.sampled_from([len(patch), 0, 8, 100]))
    path = sound / f"damaged.{kind}"
    path.write_bytes(content[:start] + patch + content[start + length :])
    message = "read"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            format_of(path).read_log(path, Wanted())
        except TwinError as error:
            message = str(error)
    assert len(message.splitlines()) == 1
    assert len(message) < 1000
