"""Malformed files: a reader gives a result or one line, never anything else, and soon."""

import os
import time
import warnings

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin import Drive, TwinError, Vehicle
from twin.car.template import template
from twin.logs.formats import format_of
from twin.logs.map import LogMap
from twin.logs.raw_log import Wanted

LONGEST = 10.0  # [s] that a small file may take
MAP = (
    'axes = "SAE"\n[channels.ax]\nname = "a"\nunit = "g"\n[constants]\nsteering_wheel_angle = 0\n'
    "drive_torque = 0\nbrake_torque = 0\nroad_height = 0\n"
)
DRIVE = Drive(
    time=np.arange(50) * 1e-3,
    inputs=np.ones((50, 1)),
    input_names=("steering_wheel_angle",),
    measurements=np.random.default_rng(0).standard_normal((50, 2)),
    output_names=("ax", "vx"),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Sound files of each kind."""
    folder = tmp_path_factory.mktemp("fuzz")
    for ending in ("csv", "parquet", "mf4"):
        DRIVE.save(folder / f"sound.{ending}")
    (folder / "sound.map").write_text(MAP)
    (folder / "sound.car").write_text(template("mine"))
    (folder / "sound.xml").write_bytes(Vehicle.load("suv").source.read_bytes())
    return folder


def read(path):
    """Reads a file as what its name says."""
    if path.suffix == ".map":
        return LogMap.load(path)
    if path.suffix == ".car":
        os.replace(path, path.with_suffix(".toml"))
        return Vehicle.load(path.with_suffix(".toml"))
    if path.suffix == ".xml":
        return Vehicle.load(path)
    try:
        Drive.load(path)
    except TwinError:
        return format_of(path).read_log(path, Wanted())


def survives(path, content):
    """Whether a file is read or refused in one line, without a warning and soon."""
    path.write_bytes(content)
    start = time.monotonic()
    message = "read"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            read(path)
        except TwinError as error:
            message = str(error)
    assert len(message.splitlines()) == 1
    assert len(message) < 1000
    assert time.monotonic() - start < LONGEST


KINDS = ("csv", "parquet", "mf4", "map", "car", "xml")


@pytest.mark.parametrize("kind", KINDS)
@settings(deadline=None, max_examples=25)
@given(content=st.binary(max_size=600))
def test_random_bytes_end_in_one_line(folder, kind, content):
    survives(folder / f"random.{kind}", content)


@pytest.mark.parametrize("kind", KINDS)
@settings(deadline=None, max_examples=40)
@given(data=st.data())
def test_damaged_file_is_read_or_ends_in_one_line(folder, kind, data):
    content = (folder / f"sound.{kind}").read_bytes()
    start = data.draw(st.integers(0, len(content) - 1))
    patch = data.draw(st.binary(max_size=12))
    length = data.draw(st.sampled_from([len(patch), len(patch), 0, 1, 8, 100]))
    survives(folder / f"damaged.{kind}", content[:start] + patch + content[start + length :])


WORDS = ["", "x", "1e999", "nan", "[]", "[[a]]", '"', "-1", "9" * 5000]


@pytest.mark.parametrize("kind", ["map", "csv", "car"])
@settings(deadline=None, max_examples=40)
@given(data=st.data())
def test_damaged_text_is_read_or_ends_in_one_line(folder, kind, data):
    lines = (folder / f"sound.{kind}").read_text().split("\n")
    at = data.draw(st.integers(0, len(lines) - 1))
    word = data.draw(st.sampled_from(WORDS))
    key, _, _ = lines[at].partition("=")
    lines[at] = data.draw(st.sampled_from([word, f"{key}= {word}", f"{word}{lines[at]}"]))
    survives(folder / f"edited.{kind}", "\n".join(lines).encode())


def test_ten_gigabytes_of_zeros_in_a_parquet_header_are_one_line(tmp_path):
    path = tmp_path / "zeros.parquet"
    million = pa.nulls(1_000_000, pa.float64())
    pq.write_table(pa.table({"time": million, "a": million}), path)
    declared = pq.read_metadata(path)
    for _ in range(624):
        declared.append_row_groups(pq.read_metadata(path))
    declared.write_metadata_file(path)
    message = r"declares 1,250,000,000 values \(9.31 GiB\); allowed: 45,000,000"
    with pytest.raises(TwinError, match=message):
        Drive.load(path)
