import dataclasses
import pickle

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from twin.errors import TwinError
from twin.logs.drive import Drive


def make_drive(samples=50, **changes):
    rng = np.random.default_rng(1)
    content = {
        "time": np.arange(samples) * 1e-3,
        "inputs": rng.standard_normal((samples, 2)),
        "input_names": ("steering_wheel_angle", "drive_torque_fl"),
        "measurements": rng.standard_normal((samples, 3)),
        "output_names": ("ax", "ay", "yaw_rate"),
        "truth": {"vx": rng.standard_normal(samples), "mass": np.full(samples, 2125.8)},
        "settings": {"scenario": "mass", "seed": 3, "snr": 10.0, "versions": {"numpy": "2"}},
    }
    return Drive(**(content | changes))


def assert_equal_to_the_bit(a, b):
    assert a.input_names == b.input_names
    assert a.output_names == b.output_names
    assert a.settings == b.settings
    assert list(a.truth) == list(b.truth)
    pairs = [(a.time, b.time), (a.inputs, b.inputs), (a.measurements, b.measurements)]
    pairs += [(a.truth[name], b.truth[name]) for name in a.truth]
    for one, other in pairs:
        assert one.shape == other.shape
        np.testing.assert_array_equal(one.view(np.uint64), other.view(np.uint64))


def test_channel_is_the_column_of_that_name():
    drive = make_drive()
    np.testing.assert_array_equal(drive.channel("drive_torque_fl"), drive.inputs[:, 1])
    np.testing.assert_array_equal(drive.channel("yaw_rate"), drive.measurements[:, 2])


def test_truth_is_no_channel():
    with pytest.raises(TwinError, match=r"no channel 'vx', only steering_wheel_angle, .*yaw_rate$"):
        make_drive().channel("vx")


def test_arrays_are_copied_and_read_only():
    inputs = np.zeros((50, 2))
    drive = make_drive(inputs=inputs)
    inputs[:] = 1.0
    assert not drive.inputs.any()
    for array in (drive.time, drive.inputs, drive.measurements, *drive.truth.values()):
        assert array.flags.c_contiguous
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_attributes_cannot_be_set():
    with pytest.raises(dataclasses.FrozenInstanceError):
        make_drive().time = np.arange(50)  # pyright: ignore[reportAttributeAccessIssue]


def test_length_and_duration_span_the_samples():
    drive = make_drive(time=5.0 + np.arange(50) * 0.01)
    assert len(drive) == 50
    assert drive.duration == pytest.approx(0.49)


def test_sample_time_survives_rounding_of_unix_time():
    drive = make_drive(time=1.7e9 + np.arange(50) * 1e-3)
    assert drive.dt == pytest.approx(1e-3, rel=1e-4)


def test_sample_time_of_a_jittery_log_is_an_error():
    time = np.arange(50) * 1e-3
    time[10] += 1e-5
    drive = make_drive(time=time)
    with pytest.raises(TwinError, match=r"steps of 0\.00099 to 0\.00101 s, must be uniform"):
        _ = drive.dt


def test_replace_checks_and_keeps_the_rest():
    drive = make_drive()
    shorter = drive.replace(settings={"scenario": "other"})
    assert shorter.settings == {"scenario": "other"}
    np.testing.assert_array_equal(shorter.inputs, drive.inputs)
    with pytest.raises(TwinError, match="inputs has shape"):
        drive.replace(inputs=drive.inputs[1:])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time": np.zeros(50)}, r"from 0 to 0 s at sample 1, must be strictly increasing"),
        ({"time": np.arange(50)[::-1]}, "must be strictly increasing"),
        ({"time": np.full(50, np.nan)}, "time must be finite"),
        ({"time": np.zeros((50, 1))}, r"time has shape \(50, 1\)"),
        ({"time": [0.0]}, "at least 2"),
        ({"inputs": np.zeros((50, 3))}, r"inputs has shape \(50, 3\), must be \(50, 2\)"),
        ({"measurements": np.zeros((49, 3))}, r"measurements has shape \(49, 3\)"),
        ({"truth": {"vx": np.zeros(49)}}, r"truth vx has shape \(49,\), must be \(50,\)"),
        ({"truth": {"mass": 2125.8}}, r"truth mass has shape \(\), must be \(50,\)"),
        ({"output_names": ("ax", "ax", "ay")}, "'ax' occurs twice"),
        ({"output_names": ("ax", "ay", "drive_torque_fl")}, "'drive_torque_fl' occurs twice"),
        ({"inputs": [["a", "b"]] * 50}, "inputs must be an array of numbers"),
        ({"settings": {"rng": np.random.default_rng(0)}}, "settings must be fit for JSON"),
    ],
)
def test_bad_content_is_one_line_that_names_it(changes, message):
    with pytest.raises(TwinError, match=message) as caught:
        make_drive(**changes)
    assert "\n" not in str(caught.value)


def test_missing_input_is_an_error_and_missing_measurement_is_not():
    inputs, measurements = np.zeros((50, 2)), np.zeros((50, 3))
    inputs[7, 1] = measurements[7, 1] = np.nan
    assert np.isnan(make_drive(measurements=measurements).channel("ay")[7])
    with pytest.raises(TwinError, match="input drive_torque_fl is nan at sample 7"):
        make_drive(inputs=inputs)


def test_pickled_drive_is_the_same_drive():
    drive = make_drive()
    assert_equal_to_the_bit(pickle.loads(pickle.dumps(drive)), drive)


def test_file_gives_back_the_drive_to_the_bit(tmp_path):
    measurements = np.random.default_rng(2).standard_normal((50, 3))
    measurements[3:9, 1] = np.nan
    measurements[0] = [-0.0, 5e-324, np.inf]
    drive = make_drive(measurements=measurements, settings={"snr": np.inf, "noise_sd": [0.1, 0.2]})
    drive.save(tmp_path / "drive.parquet")
    assert_equal_to_the_bit(Drive.load(tmp_path / "drive.parquet"), drive)


def test_file_of_a_recorded_log_needs_no_truth(tmp_path):
    drive = make_drive(truth={}, inputs=np.empty((50, 0)), input_names=())
    drive.save(tmp_path / "log.parquet")
    assert_equal_to_the_bit(Drive.load(tmp_path / "log.parquet"), drive)


def test_columns_of_the_file_are_named_by_kind(tmp_path):
    make_drive().save(tmp_path / "drive.parquet")
    assert pq.read_schema(tmp_path / "drive.parquet").names == [
        "time",
        "input.steering_wheel_angle",
        "input.drive_torque_fl",
        "measurement.ax",
        "measurement.ay",
        "measurement.yaw_rate",
        "truth.vx",
        "truth.mass",
    ]


def test_failed_save_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "drive.parquet"
    drive = make_drive()
    drive.save(path)
    old = path.read_bytes()

    def full_disk(_table, partial, **_options):
        partial.write_bytes(old[:100])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pq, "write_table", full_disk)
    with pytest.raises(TwinError, match=r"drive\.parquet: cannot be written: No space left"):
        drive.save(path)
    assert path.read_bytes() == old
    assert list(tmp_path.iterdir()) == [path]


def test_save_into_a_missing_folder_names_the_file(tmp_path):
    with pytest.raises(TwinError, match=r"missing/drive\.parquet: cannot be written"):
        make_drive().save(tmp_path / "missing" / "drive.parquet")


def test_missing_file_is_named(tmp_path):
    with pytest.raises(TwinError, match=r"none\.parquet: cannot be read: No such file"):
        Drive.load(tmp_path / "none.parquet")


@pytest.mark.parametrize("share", [0.0, 0.001, 0.3, 0.7, 0.99])
def test_truncated_file_is_one_error(tmp_path, share):
    path = tmp_path / "drive.parquet"
    make_drive().save(path)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(TwinError, match=r"drive\.parquet: cannot be read as Parquet: .+") as caught:
        Drive.load(path)
    assert "\n" not in str(caught.value)


def test_flipped_bits_in_the_data_are_found(tmp_path):
    path = tmp_path / "drive.parquet"
    make_drive(samples=5000).save(path)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(TwinError, match=r"drive\.parquet: cannot be read as Parquet"):
        Drive.load(path)


def test_parquet_of_others_is_refused(tmp_path):
    path = tmp_path / "foreign.parquet"
    pq.write_table(pa.table({"time": [0.0, 1.0]}), path)
    with pytest.raises(TwinError, match=r"foreign\.parquet: is Parquet, but no drive"):
        Drive.load(path)


@pytest.mark.parametrize(
    ("columns", "metadata", "message"),
    [
        ({"time": [0.0, 1.0]}, "{", "must be JSON with version and settings"),
        ({"time": [0.0, 1.0]}, "[]", "must be JSON with version and settings"),
        ({"time": [0.0, 1.0]}, '{"version": 2, "settings": {}}', "format 2, must be 1"),
        ({"time": [0.0, 1.0]}, '{"version": 1, "settings": 5}', "settings must be fit for JSON"),
        ({"input.a": [0.0, 1.0]}, None, "has no column time"),
        ({"time": [0, 1]}, None, "column time is int64, must be double"),
        ({"time": [0.0, 1.0], "speed": [0.0, 1.0]}, None, "column speed is unknown"),
        ({"time": [1.0, 0.0]}, None, "must be strictly increasing"),
        ({"time": [0.0, 1.0], "input.a": [0.0, None]}, None, "input a is nan at sample 1"),
    ],
)
def test_damaged_drive_names_file_and_fault(tmp_path, columns, metadata, message):
    path = tmp_path / "drive.parquet"
    metadata = metadata or '{"version": 1, "settings": {}}'
    table = pa.table(columns).replace_schema_metadata({"twin_drive": metadata})
    pq.write_table(table, path)
    with pytest.raises(TwinError, match=rf"drive\.parquet: .*{message}"):
        Drive.load(path)
