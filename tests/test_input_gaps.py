"""Gaps in the inputs of a log are bridged or cut out, and `til estimate` says so."""

import json
from io import StringIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from estimators.weigh.trip import Trip
from scenarios import __main__ as cli
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import record
from scenarios.logs import stream
from scenarios.logs.inspect import inspect_log
from twin import Drive, TwinError, Vehicle, with_noise
from twin.logs.input_gaps import LONGEST_GAP, without_gaps

TIME = np.arange(0.0, 10.0, 0.01)
RATE, START = 50, 12.0  # of the log [Hz], and where the gap begins [s]
STEERING, TORQUE = "input.steering_wheel_angle", "input.drive_torque_rl"


def test_short_gap_is_interpolated_and_marked():
    values = TIME.copy()
    values[300:330] = np.nan
    found = without_gaps(TIME, {"a": values, "b": -TIME})
    np.testing.assert_allclose(found.columns["a"], TIME)
    assert found.kept.all()
    assert np.flatnonzero(found.bridged).tolist() == list(range(300, 330))
    gap = found.gaps[0]
    assert (gap.names, gap.bridged) == (("a",), True)
    assert (gap.start, gap.end) == pytest.approx((3.0, 3.29))


def test_long_gap_and_those_at_the_ends_are_cut_out():
    values = TIME.copy()
    values[:20] = values[300:500] = np.inf
    found = without_gaps(TIME, {"a": values})
    assert not found.bridged.any()
    assert np.flatnonzero(~found.kept).tolist() == [*range(20), *range(300, 500)]
    assert [gap.bridged for gap in found.gaps] == [False, False]


def test_gap_of_just_the_longest_is_bridged_and_one_more_sample_is_not():
    for samples, bridged in ((98, True), (102, False)):
        values = TIME.copy()
        values[300 : 300 + samples] = np.nan
        assert without_gaps(TIME, {"a": values}).gaps[0].bridged == bridged
    assert LONGEST_GAP == 1.0


def test_inputs_that_are_never_there_together_are_none():
    a, b = TIME.copy(), TIME.copy()
    a[:600] = b[400:] = np.nan
    assert without_gaps(TIME, {"a": a, "b": b}) is None


@pytest.fixture(scope="module")
def columns():
    """A drive of the loaded SUV at 50 Hz, as its file has it."""
    clean = record(Vehicle.load("suv_loaded"), urban(duration=24.0))
    drive = with_noise(clean, 20.0, np.random.default_rng(4))[1000 :: 1000 // RATE]
    return dict(drive._columns()) | {"measurement.vx": drive.truth["vx"]}


def holed(columns, name, seconds):
    """The drive with one input missing for a time."""
    first = round((START - columns["time"][0]) * RATE)
    part = slice(first, first + round(seconds * RATE))
    changed = dict(columns)
    changed[name] = columns[name].copy()
    changed[name][part] = np.nan
    return changed, part


def map_of(columns, folder):
    lines = []
    for column in columns:
        _, _, name = column.partition(".")
        if column.startswith(("input.", "measurement.")):
            unit = {"a": "m/s2", "w": "rad/s", "v": "m/s"}.get(name[0], "rad/s")
            unit = "N m" if "torque" in name else "m" if "height" in name else unit
            unit = "rad" if "steering" in name else unit
            lines.append(f'[channels.{name}]\nname = "{column}"\nunit = "{unit}"\n')
    path = folder / "map.toml"
    path.write_text("".join(lines))
    return path


def estimated(columns, folder, capsys):
    """The result of `til estimate` for the drive as another program's log."""
    kept = {name: values for name, values in columns.items() if not name.startswith("truth")}
    pq.write_table(pa.table(kept), folder / "log.parquet")
    options = ["--map", str(map_of(kept, folder)), "--vehicle", "suv", "--out", str(folder)]
    assert cli.main(["estimate", str(folder / "log.parquet"), *options]) == 0
    text = capsys.readouterr().out
    history = pq.read_table(folder / "log.til.parquet").to_pandas()
    return text, json.loads((folder / "log.til.json").read_text()), history


@pytest.mark.parametrize("name", [STEERING, TORQUE])
@pytest.mark.parametrize("seconds", [0.3, 5.0])
def test_log_with_a_gap_in_an_input_is_estimated(columns, tmp_path, capsys, name, seconds):
    gap, _ = holed(columns, name, seconds)
    text, told, history = estimated(gap, tmp_path, capsys)
    mass = told["answer"]["quantities"][0]
    assert mass["low"] < 355.0 < mass["high"]
    assert told["trustworthy"] is True
    short, end = name.removeprefix("input."), START + seconds
    assert f"{short}: missing from 11.98" in text
    word = "interpolated" if seconds < LONGEST_GAP else "the twin started again"
    span = next(one for one in told["answer"]["untrusted"] if one["start"] > START - 0.1)
    assert short in span["reason"]
    assert word in span["reason"]
    assert span["start"] == pytest.approx(START, abs=0.05)
    assert end < span["end"] < end + 1.5
    inside = (history["time"] > START) & (history["time"] < end + 0.9)
    assert not history["trustworthy"][inside].any()
    assert history["trustworthy"][history["time"] > end + 2.0].all()


def streamed(columns):
    """Estimates and report of `til estimate -` for the drive's samples as lines."""
    names = [name for name in columns if not name.startswith("truth")]
    lines = [
        json.dumps(
            {name: None if np.isnan(v) else float(v) for name, v in zip(names, row, strict=True)}
        )
        for row in zip(*(columns[name] for name in names), strict=True)
    ]
    found, report = [], StringIO()
    stream.observe(
        Vehicle.load("suv"), lines, lambda line: found.append(json.loads(line)), report=report
    )
    return found, report.getvalue()


@pytest.mark.parametrize("name", [STEERING, TORQUE])
@pytest.mark.parametrize("seconds", [0.3, 5.0])
def test_stream_with_a_gap_in_an_input_is_estimated(columns, name, seconds):
    gap, _ = holed(columns, name, seconds)
    found, report = streamed(gap)
    last, end = found[-1], START + seconds
    assert abs(last["mass"] - 355.0) < 2.0 * (last["mass_sd"] + 0.03 * 2700.0)
    assert last["trustworthy"]
    inside = [one for one in found if START < one["time"] < end + 0.9]
    assert inside
    assert not any(one["trustworthy"] for one in inside)
    assert any(one.get("missing") == [name.removeprefix("input.")] for one in inside)
    if seconds > LONGEST_GAP:
        silent = [one for one in inside if START + LONGEST_GAP + 0.1 < one["time"] < end - 0.1]
        assert not silent
        assert "starts again at the measured speed" in report
        assert "1 restarts" in report
    else:
        assert "held; nothing counts as measured there" in report


def test_drive_of_ours_with_a_gap_is_read(columns, tmp_path):
    table = {name: values for name, values in columns.items() if name != "measurement.vx"}
    pq.write_table(pa.table(table), tmp_path / "plain.parquet")
    whole = Drive.from_frame(table)
    gap, part = holed(table, TORQUE, 0.3)
    drive = Drive.from_frame(gap)
    assert len(drive) == len(whole)
    assert np.isnan(drive.measurements[part]).all()
    outside = np.ones(len(whole), dtype=bool)
    outside[part] = False
    np.testing.assert_array_equal(drive.inputs[outside], whole.inputs[outside])
    assert len(Drive.from_frame(holed(table, TORQUE, 5.0)[0])) == len(whole) - 5 * RATE


def test_nothing_but_gaps_is_one_line(columns):
    gap = dict(columns)
    gap[STEERING] = np.full(len(columns["time"]), np.nan)
    with pytest.raises(TwinError, match="input steering_wheel_angle is nan at sample 0"):
        Drive.from_frame(gap)


def test_inspect_and_weigh_take_a_cut_drive(columns, tmp_path):
    drive = Drive.from_frame(holed(columns, TORQUE, 5.0)[0])
    trip = Trip.of_drive(drive, 0.36, "cut")
    assert trip.rate == pytest.approx(RATE)
    assert np.isnan(trip.force).sum() == 5 * RATE
    drive.save(tmp_path / "cut.parquet")
    assert (
        "the longest time without a gap" in inspect_log(tmp_path / "cut.parquet", None, "suv").text
    )
