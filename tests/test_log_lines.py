"""A stream reads what a file may have, by the same map."""

import numpy as np
import pytest

from scenarios.logs.lines import LineReader
from twin import Drive, TwinError
from twin.logs.map import LogMap

MAP = (
    "[channels.ax]\nname = 'a'\n[constants]\nsteering_wheel_angle = 0\n"
    "drive_torque = 0\nbrake_torque = 0\nroad_height = 0\n"
)
TIMES = np.arange(20) * 0.5
VALUES = np.round(np.sin(TIMES), 6)


@pytest.fixture
def read(tmp_path):
    """A function that gives the samples of lines, and the drive of the same lines as a file."""

    def read(text, head=""):
        (tmp_path / "map.toml").write_text("rate = 2\n" + head + MAP)
        (tmp_path / "log.csv").write_text(text)
        reader = LineReader(LogMap.load(tmp_path / "map.toml"))
        samples = list(reader.samples(text.splitlines(keepends=True)))
        time = np.array([sample["time"] for sample in samples])
        values = np.array([sample["ax"] for sample in samples])
        return time, values, Drive.load(tmp_path / "log.csv", tmp_path / "map.toml"), reader.notes()

    return read


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("time (ms),a\n,g\n", lambda t, a: f"{1e3 * t:g},{a}"),
        ("Format,X\nRate,2,Hz\n\ntime,a\nmin,g\n\n", lambda t, a: f"{t / 60:.9f},{a}"),
        ("# t a\n# s g\n", lambda t, a: f"{t:g} {a}"),
        ("time;a\n;g\n", lambda t, a: f"12:00:{t:06.3f};{a}".replace(".", ",")),
        ("time,a\n,g\n", lambda t, a: f"2026-01-01T00:00:{t:06.3f}Z,{a}"),
    ],
)
def test_stream_reads_what_the_file_reads(read, head, row):
    text = head + "".join(row(t, a) + "\n" for t, a in zip(TIMES, VALUES, strict=True))
    time, values, drive, _ = read(text)
    np.testing.assert_allclose(time, drive.time, atol=1e-5)
    np.testing.assert_allclose(values, drive.channel("ax"), atol=1e-5)
    np.testing.assert_allclose(values, 9.80665 * VALUES, atol=1e-5)


def test_damaged_rows_and_cells_of_a_stream_are_counted(read):
    rows = [f"{t},{a}" for t, a in zip(TIMES, VALUES, strict=True)]
    rows[5] = "2.5,INV"
    rows.insert(9, "t,a")
    rows[-1] = "9"
    time, values, _, notes = read("t,a\n,g\n" + "\n".join(rows))
    assert (time.size, np.isnan(values).sum()) == (19, 1)
    assert "2 rows that are damaged are left out." in notes
    assert "1 cells that are damaged are left out." in notes


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ("t [ticks],a\n", "in 'ticks', an unknown unit of time"),
        ("elapsed,a\n", "no column is called time"),
        ("t,b\n", "'a', which the map names, is missing"),
        ("t,a\n", "channels.ax.unit is missing and the lines give none"),
    ],
)
def test_stream_is_refused_as_a_file_is(read, head, message):
    with pytest.raises(TwinError, match=message):
        read(head + "0,1\n1,2\n2,3\n")
