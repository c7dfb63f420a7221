"""Files as loggers and programs write them: read right or refused, never read wrong."""

import os

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from twin import TwinError
from twin.logs.csv import read_log as read_text
from twin.logs.log_time import TimeWanted, spread
from twin.logs.parquet import read_log as read_parquet
from twin.logs.raw_log import LARGEST_LOG, Wanted

TIME = 2.0 + 0.02 * np.arange(50)
A, B = np.sin(TIME), 20.0 + np.cos(TIME)


def table(delimiter=",", decimal=".", scale=1.0, quote=""):
    """Rows of time, a and b as text."""
    rows = [
        delimiter.join(f"{quote}{v:.10g}{quote}" for v in row)
        for row in zip(scale * TIME, A, B, strict=True)
    ]
    return "\n".join(rows).replace(".", decimal) + "\n"


@pytest.fixture
def read(tmp_path):
    """A function that writes text or bytes and reads them as a log."""

    def read(content, name=None, unit=None, names=()):
        path = tmp_path / "log.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_text(path, Wanted(TimeWanted(name, unit), frozenset(names)))

    return read


def check(log, samples=50, a="a", b="b", unit=None):
    channel = log.channels[a]
    np.testing.assert_allclose(channel.time, TIME[:samples], atol=1e-6)
    np.testing.assert_allclose(channel.values, A[:samples], atol=1e-6)
    np.testing.assert_allclose(log.channels[b].values, B[:samples], atol=1e-6)
    if unit is not None:
        assert log.channels[a].unit == unit
    return " ".join(log.notes)


MOTEC = (
    '"Format","MoTeC CSV File",,,"Workbook",""\n"Venue","X",,,"Worksheet",""\n'
    '"Sample Rate","50.000","Hz",,"End Time","1.0","s"\n\n\n"Time","a","b"\n"s","m/s/s","km/h"'
    "\n\n\n"
)
AIM = (
    '"Format","AiM CSV File"\n"Session","X"\n"Beacon Markers","12.3","45.6"\n"Sample Rate","50"\n\n'
    '"Time","a","b"\n"Time","a","b"\n"s","g","km/h"\n\n'
)
RACECHRONO = (
    'This file is created using RaceChrono v8.0.\nFormat,3\nSession title,"X"\nCreated,1/1/2026\n'
    "\ntimestamp,a,b\nunix time,G,m/s\n,calc,100: gps\n"
)


@pytest.mark.parametrize(
    ("head", "quote", "unit"), [(MOTEC, '"', "m/s/s"), (AIM, '"', "g"), (RACECHRONO, "", "G")]
)
def test_heads_of_key_rows_units_and_sources(read, head, quote, unit):
    check(read(head + table(quote=quote)), unit=unit)


@pytest.mark.parametrize(
    "text",
    [
        "# t,a,b\n" + table(),
        "# t a b\n" + table(" "),
        "# made by hand\n#\n# t, a, b\n" + table(", "),
        "t;a;b\n" + table(";"),
        "t;a;b\n" + table(";", ","),
        "t\ta\tb\n" + table("\t", ","),
        "t|a|b\n" + table("|"),
        "t,a,b\n" + table().replace("\n", ",\n"),
        "  t   a   b\n" + table("   "),
        'TIME;"a";"b"\n[s];[g];[km/h]\n' + table(";"),
        "t,a,b,rate,rate\n" + table().replace("\n", ",1,2\n"),
    ],
)
def test_layouts_read_alike(read, text):
    check(read(text))


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig", "latin-1"])
def test_encodings_read_alike(read, encoding):
    check(read(("t,a [°],b\n" + table()).encode(encoding)), a="a [°]", unit="°")


def test_first_decimal_comma_may_stand_anywhere(read):
    zeros = "".join(f"{t};0;0\n" for t in range(1000))
    log = read("time (ms);a;b\n" + zeros + "1000;0,5;1,25\n")
    np.testing.assert_array_equal(log.channels["a"].values[-2:], [0.0, 0.5])
    assert log.channels["b"].values[-1] == 1.25


def test_points_and_commas_in_one_column_are_not_guessed(read):
    log = read("t;a\n0;1.500\n1;2,5\n2;3\n3;4\n")
    assert log.text == {"a": "mixed decimal points and commas"}


@pytest.mark.parametrize(
    ("damage", "samples", "said"),
    [
        (lambda rows: [*rows[:-1], rows[-1][:8]], 49, "1 rows that have not 3 cells"),
        (lambda rows: [*rows, "\0" * 64], 50, "64 null characters"),
        (lambda rows: [*rows[:20], "t,a,b", *rows[20:]], 50, "1 rows of text among the numbers"),
        (lambda rows: [*rows[:20], "1,2,3,4,5", *rows[20:]], 50, "1 rows that have not 3 cells"),
        (lambda rows: [*rows[:20], "x\0\0\0", *rows[20:]], 50, "1 lines with null characters"),
        (lambda rows: [*rows[:20], ",1,2", *rows[20:]], 50, "1 rows without a time"),
        (lambda rows: [*rows[:-1], rows[-1][:2] + '"'], 49, "1 rows that have not 3 cells"),
    ],
)
def test_damaged_rows_are_left_out_counted_and_said(read, damage, samples, said):
    text = "\n".join(["t,a,b", *damage(table().splitlines())])
    assert said in check(read(text), samples)


def test_cell_that_is_no_number_is_missing(read):
    rows = table().splitlines()
    rows[7] = rows[7].replace(rows[7].split(",")[1], "INV")
    log = read("\n".join(["t,a,b", *rows]) + "\n")
    assert np.isnan(log.channels["a"].values[7])
    assert np.isnan(log.channels["a"].values).sum() == 1
    assert "a: 1 cells that are no number count as missing." in log.notes


def test_rows_one_cell_longer_than_the_names_are_refused(read):
    with pytest.raises(TwinError, match="rows of numbers have 3 cells, the row of names 2"):
        read("t,a\n" + table())


@pytest.mark.parametrize(
    ("name", "scale"),
    [
        ("Time (msec)", 1e3), ("time_us", 1e6), ("t [min]", 1 / 60), ("Time [h]", 1 / 3600),
        ("TIME (sec)", 1.0), ("timestamp ns", 1e9), ("Time (0.1 s)", 10.0), ("elapsed_time", 1.0),
        ("Time (milliseconds)", 1e3), ("Session Time [s]", 1.0),
    ],
)  # fmt: skip
def test_unit_of_time_is_understood(read, name, scale):
    check(read(f"{name},a,b\n" + table(scale=scale)))


@pytest.mark.parametrize("name", ["Time (ticks)", "t [m]", "time (counts)", "Time [cycles]"])
def test_unknown_unit_of_time_is_refused(read, name):
    with pytest.raises(TwinError, match="an unknown unit of time; allowed: s, ms"):
        read(f"{name},a,b\n" + table())


def test_unknown_unit_of_time_is_what_the_map_says(read):
    check(read("Time (ticks),a,b\n" + table(scale=1e3), "Time (ticks)", 1e-3))


def test_without_a_column_called_time_the_candidates_are_named(read):
    rows = [f"{i},{row}" for i, row in enumerate(table().splitlines())]
    text = "\n".join([",elapsed,a,b", *rows])
    with pytest.raises(TwinError, match=r"no column is called time.*these rise: 'elapsed'$"):
        read(text)
    check(read(text, "elapsed"))
    with pytest.raises(TwinError, match="time 'index' is a running number, not a time"):
        read("index" + text, "index")


def test_two_times_that_differ_are_refused_and_two_that_agree_are_one(read):
    rows = [f"{t:.6g},{row}" for t, row in zip(TIME - 2.0, table().splitlines(), strict=True)]
    check(read("\n".join(["time,timestamp,a,b", *rows]), "timestamp"))
    log = read("\n".join(["time,timestamp,a,b", *rows]))
    np.testing.assert_allclose(log.channels["a"].time, TIME - 2.0, atol=1e-9)
    rows = [f"{2.0 * t:.6g},{row}" for t, row in zip(TIME, table().splitlines(), strict=True)]
    with pytest.raises(TwinError, match="time may be 'time' or 'timestamp', which differ"):
        read("\n".join(["time,timestamp,a,b", *rows]))


def test_milliseconds_since_1970_without_a_unit_are_refused(read):
    rows = "".join(f"{1_700_000_000_000 + 20 * i},1,2\n" for i in range(10))
    with pytest.raises(TwinError, match=r"without a unit is up to 1.7e"):
        read("time,a,b\n" + rows)
    assert np.ptp(read("time,a,b\n" + rows, None, 1e-3).channels["a"].time) == pytest.approx(0.18)


@pytest.mark.parametrize(
    "stamp",
    [
        lambda t: f"2026-01-01T12:00:{t:06.3f}Z", lambda t: f"2026-01-01 12:00:{t:06.3f}",
        lambda t: f"12:00:{t:06.3f}", lambda t: f"59:{t:06.3f}", lambda t: f"0:59:{t:06.3f}",
        lambda t: f"01/13/2026 11:59:{t:06.3f} PM", lambda t: f"25-Nov-2026 12:00:{t:06.3f}",
        lambda t: f"2026-01-01T12:00:{t:06.3f}+01:00",
    ],
)  # fmt: skip
def test_dates_and_clocks_are_time(read, stamp):
    rows = [f"{stamp(t)},{a},{b}" for t, a, b in zip(TIME, A, B, strict=True)]
    channel = read("\n".join(["time,a,b", *rows])).channels["a"]
    np.testing.assert_allclose(channel.time - channel.time[0], TIME - TIME[0], atol=1e-5)
    with pytest.raises(TwinError, match="which has no other unit"):
        read("\n".join(["time,a,b", *rows]), "time", 1e-3)


def test_clock_goes_on_behind_midnight(read):
    channel = read("time,a\n23:59:59.0,1\n23:59:59.5,2\n00:00:00.0,3\n00:00:00.5,4\n").channels["a"]
    np.testing.assert_allclose(np.diff(channel.time), 0.5)


def test_coarse_stamps_are_spread_and_single_doubles_counted():
    time = np.arange(1000) * 1e-3
    coarse, said = spread(np.floor(time[37:] * 100.0 + 1e-9) / 100.0)
    np.testing.assert_allclose(coarse, time[37:], atol=1e-9)
    assert "spread evenly" in said[0]
    double = time.copy()
    double[500] = double[499]
    kept, said = spread(double)
    np.testing.assert_array_equal(kept, double)
    assert said == ["1 samples share a time stamp with another: the first counts."]


def parquet(path, columns, index=None, metadata=None):
    import json

    arrow = pa.table(columns)
    if index is not None:
        content = {"index_columns": [index], "columns": [], "pandas_version": "2"}
        arrow = arrow.replace_schema_metadata({"pandas": json.dumps(content)})
    pq.write_table(arrow, path)
    return path


NS = pa.array(
    (1_700_000_000_000_000_000 + np.round(1e9 * TIME)).astype(np.int64), pa.timestamp("ns")
)


@pytest.mark.parametrize(
    ("columns", "index"),
    [
        ({"a": A, "__index_level_0__": NS}, "__index_level_0__"),
        ({"a": A, "stamp": NS}, "stamp"),
        ({"a": A, "when": NS}, None),
        ({"a": A, "__index_level_0__": TIME}, "__index_level_0__"),
        (
            {"a": A, "lapse": pa.array(np.round(1e6 * TIME).astype(np.int64), pa.duration("us"))},
            None,
        ),
        ({"a": A, "time": pa.array([f"{t:.2f}" for t in TIME]).cast(pa.decimal128(10, 2))}, None),
        ({"a": A, "time": pa.array([f"2026-01-01T00:00:{t:05.2f}" for t in TIME])}, None),
        ({"a": A, "n": np.arange(50), "t": TIME}, "n"),
    ],
)
def test_parquet_finds_its_time(tmp_path, columns, index):
    log = read_parquet(parquet(tmp_path / "log.parquet", columns, index), Wanted())
    channel = log.channels["a"]
    np.testing.assert_allclose(channel.time - channel.time[0], TIME - TIME[0], atol=1e-6)
    np.testing.assert_array_equal(channel.values, A)


@pytest.mark.parametrize("number", [np.arange(50), np.arange(50.0)])
def test_running_index_of_parquet_is_no_time(tmp_path, number):
    columns = {"a": A, "__index_level_0__": number}
    path = parquet(tmp_path / "log.parquet", columns, "__index_level_0__")
    with pytest.raises(TwinError, match="no column is called time"):
        read_parquet(path, Wanted())


def test_unit_for_a_timestamp_is_refused(tmp_path):
    path = parquet(tmp_path / "log.parquet", {"a": A, "stamp": NS})
    with pytest.raises(TwinError, match="is a timestamp, which has no other unit"):
        read_parquet(path, Wanted(TimeWanted("stamp", 1e-3)))


@pytest.mark.parametrize("reader", [read_text, read_parquet])
def test_pipe_folder_and_unreadable_file_are_one_line(tmp_path, reader):
    os.mkfifo(tmp_path / "pipe")
    for name in ("pipe", "."):
        with pytest.raises(TwinError, match="is a folder, pipe or device; allowed: a file"):
            reader(tmp_path / name, Wanted())
    with pytest.raises(TwinError, match="cannot be read: No such file"):
        reader(tmp_path / "none", Wanted())


def test_short_text_repeated_a_million_times_stays_small(tmp_path):
    words = pa.DictionaryArray.from_arrays(pa.array(np.zeros(200_000, np.int32)), ["x" * 100_000])
    path = tmp_path / "log.parquet"
    pq.write_table(
        pa.table(
            {
                "t": np.arange(200_000.0),
                "a": words.dictionary.take(pa.array([0] * 3 + [None] * 199_997)),
                "b": np.ones(200_000),
            }
        ),
        path,
    )
    assert read_parquet(path, Wanted()).channels["b"].values.size == 200_000
    assert LARGEST_LOG * 8 * 2 < 2**30
