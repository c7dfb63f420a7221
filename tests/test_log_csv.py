"""CSV as different programs write it."""

import numpy as np
import pytest

from twin.logs.csv import read_log
from twin.logs.log_time import TimeWanted
from twin.logs.raw_log import Wanted


@pytest.fixture
def read(tmp_path):
    """A function that writes text or bytes as CSV and reads it as a log."""

    def read(content, name=None, unit=None):
        path = tmp_path / "log.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_log(path, Wanted(TimeWanted(name, unit)))

    return read


@pytest.mark.parametrize(
    "content",
    [
        "time,speed\n0,1.5\n1,2.5\n",
        "time;speed\n0;1.5\n1;2.5\n",
        "time;speed\n0;1,5\n1;2,5\n",
        "time\tspeed\n0\t1.5\n1\t2.5\n",
        "# a remark\n# another\n\ntime,speed\n0,1.5\n1,2.5\n",
        "time,speed\r\n0,1.5\r\n1,2.5\r\n",
        '"time","speed"\n0,1.5\n1,2.5\n',
        "\ufefftime,speed\n0,1.5\n1,2.5\n",
        "speed,time\n1.5,0\n2.5,1\n",
        "time,speed\ns,m/s\n0,1.5\n1,2.5\n",
    ],
)
def test_dialects_read_alike(read, content):
    channel = read(content).channels["speed"]
    np.testing.assert_array_equal(channel.time, [0.0, 1.0])
    np.testing.assert_array_equal(channel.values, [1.5, 2.5])


def test_units_come_from_brackets_or_from_a_row_of_their_own(read):
    log = read("t [ms],a (g),b\n0,1,2\n1000,1,2\n")
    assert {name: channel.unit for name, channel in log.channels.items()} == {"a (g)": "g", "b": ""}
    assert log.channels["b"].time[-1] == 1.0
    log = read("t,a,b\n[s],[°/s],\n0,1,2\n1,1,2\n".encode("latin-1"))
    assert {name: channel.unit for name, channel in log.channels.items()} == {"a": "°/s", "b": ""}


def test_empty_cells_are_missing_and_text_is_set_aside(read):
    log = read("t,a,gear\n0,,P\n1,3,D\n")
    np.testing.assert_array_equal(log.channels["a"].values, [np.nan, 3.0])
    assert log.text == {"gear": '"P"'}


def test_time_is_what_the_map_says(read):
    log = read("t,us,a\n0,5,1\n1,6,1\n", "us", 1e-6)
    np.testing.assert_allclose(log.channels["a"].time, [5e-6, 6e-6], rtol=1e-14)
