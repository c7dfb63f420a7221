"""Logs and drives in MDF 4."""

import struct

import numpy as np
import pytest
from asammdf import MDF, Signal

from twin import Drive, TwinError
from twin.logs.mdf import read_log
from twin.logs.raw_log import Wanted

NO_TIME = Wanted()


@pytest.fixture(scope="module")
def drive():
    rng = np.random.default_rng(3)
    measurements = rng.standard_normal((40, 2))
    measurements[3, 1] = np.nan
    return Drive(
        time=np.arange(40) * 1e-3,
        inputs=rng.standard_normal((40, 1)),
        input_names=("steering_wheel_angle",),
        measurements=measurements,
        output_names=("ax", "vx"),
        truth={"mass": np.full(40, 2125.8)},
        settings={"text": 'a <b> & "c" ü', "snr": 10.0},
    )


@pytest.fixture
def log_file(tmp_path):
    """A log of two rates, one channel of text and one name used twice."""
    path = tmp_path / "log.mf4"
    fast, slow = np.arange(0.0, 1.0, 0.01), np.arange(0.0, 1.0, 0.1)
    with MDF(version="4.10") as file:
        file.append([Signal(9.81 + fast, fast, unit="m/s2", name="a")])
        file.append([Signal((36.0 * slow).astype(np.float32), slow, unit="km/h", name="v")])
        file.append([Signal(np.array([b"P", b"D"]), slow[:2], name="gear", encoding="utf-8")])
        file.append([Signal(slow, slow, unit="deg", name="a")])
        file.save(path, compression=1)
    return path


def refusal(path):
    with pytest.raises(TwinError) as caught:
        read_log(path, NO_TIME)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def block(content, kind, number=0):
    """Address of a block of a kind."""
    address = -1
    for _ in range(number + 1):
        address = content.index(kind, address + 1)
    return address


def test_file_gives_back_the_drive_to_the_bit(tmp_path, drive):
    drive.save(tmp_path / "drive.mf4")
    again = Drive.load(tmp_path / "drive.mf4")
    for name in ("time", "inputs", "measurements"):
        np.testing.assert_array_equal(getattr(again, name), getattr(drive, name))
    assert (again.input_names, again.output_names) == (drive.input_names, drive.output_names)
    assert again.settings == drive.settings
    np.testing.assert_array_equal(again.truth["mass"], drive.truth["mass"])
    assert [path.name for path in tmp_path.iterdir()] == ["drive.mf4"]


def test_channels_keep_their_own_rates_and_units(log_file):
    log = read_log(log_file, NO_TIME)
    assert {name: (c.unit, c.time.size) for name, c in log.channels.items()} == {
        "a": ("m/s2", 100),
        "v": ("km/h", 10),
        "a.2": ("deg", 10),
    }
    assert list(log.text) == ["gear"]
    np.testing.assert_allclose(log.channels["v"].values[-1], 32.4, rtol=1e-6)


def test_map_needs_no_units_where_the_log_has_them(log_file, tmp_path):
    (tmp_path / "map.toml").write_text(
        'rate = 100\n[channels.vx]\nname = "v"\n[channels.az]\nname = "a"\n[constants]\n'
        "steering_wheel_angle = 0\ndrive_torque = 0\nbrake_torque = 0\nroad_height = 0\n"
    )
    drive = Drive.load(log_file, map=tmp_path / "map.toml")
    np.testing.assert_allclose(drive.channel("vx")[:91], 10.0 * drive.time[:91], atol=1e-6)
    assert np.isnan(drive.channel("vx")[92:]).all()
    np.testing.assert_allclose(drive.channel("az"), 9.81 + drive.time, atol=1e-9)


def test_log_of_another_program_is_no_drive(log_file):
    with pytest.raises(TwinError, match=r"but no drive.*needs a map"):
        Drive.load(log_file)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9, 0.99])
def test_truncated_file_is_one_line(log_file, share):
    content = log_file.read_bytes()
    log_file.write_bytes(content[: int(share * len(content))])
    assert "ends within the header" in (text := refusal(log_file)) or "truncated" in text


def test_ten_gigabytes_declared_in_a_header_are_one_line(log_file):
    content = bytearray(log_file.read_bytes())
    address = block(content, b"##CG")
    (links,) = struct.unpack_from("<Q", content, address + 16)
    struct.pack_into("<Q", content, address + 24 + 8 * links + 8, 1_250_000_000)
    log_file.write_bytes(content)
    assert "declares 2,500,000,000 values (18.6 GiB); allowed: 45,000,000" in refusal(log_file)


def test_compressed_block_larger_than_it_says_is_refused(log_file):
    content = bytearray(log_file.read_bytes())
    address = block(content, b"##DZ")
    struct.pack_into("<Q", content, address + 24 + 8, 16)
    log_file.write_bytes(content)
    assert "declares 16 bytes and has more" in refusal(log_file)


def test_list_that_leads_back_to_itself_is_refused(log_file):
    content = bytearray(log_file.read_bytes())
    address = block(content, b"##DG")
    struct.pack_into("<Q", content, address + 24, address)
    log_file.write_bytes(content)
    assert "in a list once" in refusal(log_file)


def test_link_out_of_the_file_is_refused(log_file):
    content = bytearray(log_file.read_bytes())
    struct.pack_into("<Q", content, block(content, b"##DG") + 24, 1 << 40)
    log_file.write_bytes(content)
    assert "a block should stand at byte 1099511627776" in refusal(log_file)


def test_entities_in_a_comment_are_refused(log_file):
    content = log_file.read_bytes()
    comment = content.index(b"<HDcomment")
    log_file.write_bytes(content[:comment] + b"<!ENTITY a" + content[comment + 10 :])
    assert "DOCTYPE and entities are not allowed" in refusal(log_file)


def test_time_that_runs_backwards_is_named(tmp_path):
    path = tmp_path / "log.mf4"
    with MDF(version="4.10") as file:
        file.append([Signal(np.arange(3.0), np.array([0.0, 2.0, 1.0]), name="a")])
        file.save(path)
    assert "time of 'a' runs backwards, from 2 to 1 s at sample 2" in refusal(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"MDF     3.30    " + bytes(200), "is MDF '3.30'; allowed: MDF 4"),
        (b"time,a\n0,1\n" * 20, "is no MDF file"),
        (b"MDF     4.10    " + bytes(200), "is no block of MDF 4"),
    ],
)
def test_other_files_are_refused(tmp_path, content, message):
    (tmp_path / "log.mf4").write_bytes(content)
    assert message in refusal(tmp_path / "log.mf4")
