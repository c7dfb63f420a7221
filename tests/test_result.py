import io
import json
import os
import platform
import sys
import threading
from importlib import metadata
from pathlib import Path

import joblib
import numpy as np
import pytest

from scenarios.experiment.progress import DELAY, parallel, progress
from scenarios.experiment.result import Result, Row, json_text, replacing, write_json

LABELS = {
    "case": "noisy, correct CM",
    "quantity": "mass",
    "metric": "rms_pct",
    "unit": "%",
    "estimator": "til",
}


def make_row(**changes):
    return Row(**(LABELS | {"seeds": 20, "median": 0.9, "p90": 1.7} | changes))


def make_result(*rows, **settings):
    return Result(name="mass", settings=settings, seconds=1.2, rows=rows or (make_row(),))


def test_row_over_seeds_has_median_and_90th_percentile():
    row = Row.over_seeds(np.arange(11.0), **LABELS, paper=1.61)
    assert (row.seeds, row.median, row.p90) == (11, 5.0, 9.0)
    assert (row.paper, row.limit) == (1.61, None)


def test_one_seed_is_its_own_median_and_percentile():
    row = Row.over_seeds([2.5], **LABELS)
    assert (row.seeds, row.median, row.p90) == (1, 2.5, 2.5)


def test_missing_seed_makes_the_figures_missing():
    row = Row.over_seeds([1.0, np.nan, 2.0], **LABELS)
    assert np.isnan([row.median, row.p90]).all()


def test_median_stands_when_fewer_than_half_the_seeds_are_infinite():
    row = Row.over_seeds([1.0, 2.0, 3.0, np.inf, np.inf], **LABELS)
    assert row.median == 3.0
    assert not np.isfinite(row.p90)


@pytest.mark.parametrize("values", [[], [[1.0, 2.0]], 1.0])
def test_values_that_are_no_array_over_seeds_are_refused(values):
    with pytest.raises(ValueError, match=r"shape \(seeds,\)"):
        Row.over_seeds(values, **LABELS)


def test_json_has_the_shape_every_reader_expects():
    packages = ("mujoco", "numpy", "numba", "twin-in-the-loop")
    versions = {"python": platform.python_version()}
    versions |= {package: metadata.version(package) for package in packages}
    data = json.loads(json_text(make_result(make_row(paper=1.61), snr=10.0).to_json()))
    assert data == {
        "name": "mass",
        "settings": {"snr": 10.0},
        "versions": versions,
        "seconds": 1.2,
        "rows": [
            LABELS | {"seeds": 20, "median": 0.9, "p90": 1.7, "paper": 1.61, "limit": None},
        ],
    }
    assert list(data) == ["name", "settings", "versions", "seconds", "rows"]
    assert list(data["rows"][0]) == [
        *("case", "quantity", "metric", "unit", "estimator"),
        *("seeds", "median", "p90", "paper", "limit"),
    ]


def test_json_has_null_for_what_is_not_finite():
    data = make_result(make_row(median=np.nan, p90=np.float64(np.inf)), snr=np.inf).to_json()
    assert (data["rows"][0]["median"], data["rows"][0]["p90"]) == (None, None)
    assert data["settings"] == {"snr": None}


def test_json_turns_numpy_and_paths_into_plain_types():
    settings = {
        "seeds": (0, 1),
        "gains": np.array([[1.0, np.nan]]),
        "count": np.int64(3),
        "on": np.True_,
        "out": Path("out"),
    }
    assert json.loads(json_text(make_result(**settings).to_json()))["settings"] == {
        "seeds": [0, 1],
        "gains": [[1.0, None]],
        "count": 3,
        "on": True,
        "out": "out",
    }


def test_table_is_aligned_with_three_digits():
    rows = (
        make_row(case="clean", seeds=1, median=0.9, p90=1.23456),
        make_row(case="noisy", seeds=20, median=12.345, p90=np.nan),
        make_row(case="wild", seeds=300, median=98765.0, p90=1.5e-9),
    )
    assert make_result(*rows).table().splitlines() == [
        "case   quantity  metric   unit  estimator  seeds  median       p90",
        "-----  --------  -------  ----  ---------  -----  ------  --------",
        "clean  mass      rms_pct  %     til            1   0.900      1.23",
        "noisy  mass      rms_pct  %     til           20    12.3       nan",
        "wild   mass      rms_pct  %     til          300   98800  1.50e-09",
    ]


def test_table_shows_paper_and_limit_only_if_a_row_has_one():
    def columns(*rows):
        return make_result(*rows).table().splitlines()[0].split()[8:]

    assert columns(make_row()) == []
    assert columns(make_row(), make_row(paper=1.61)) == ["paper"]
    assert columns(make_row(), make_row(limit=0.8)) == ["limit"]
    with_gap = make_result(make_row(), make_row(paper=100.0)).table().splitlines()
    assert [line.split()[-1] for line in with_gap[2:]] == ["-", "100"]


def test_table_without_rows_is_its_heading():
    assert len(Result(name="mass", settings={}, seconds=0.0, rows=()).table().splitlines()) == 2


def test_json_file_holds_the_object(tmp_path):
    path = tmp_path / "mass.json"
    path.write_text("old")
    write_json(make_result().to_json(), path)
    assert json.loads(path.read_text())["name"] == "mass"
    assert list(tmp_path.iterdir()) == [path]


def write_half(path):
    with replacing(path) as partial:
        partial.write_text("half")
        raise RuntimeError


def test_error_while_writing_leaves_the_older_file_and_nothing_else(tmp_path):
    path = tmp_path / "mass.rrd"
    path.write_text("old")

    with pytest.raises(RuntimeError):
        write_half(path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_symbolic_link_stays_one(tmp_path):
    path, link = tmp_path / "mass.json", tmp_path / "latest.json"
    link.symlink_to(path)
    write_json({"name": "mass"}, link)
    assert link.is_symlink()
    assert json.loads(path.read_text()) == {"name": "mass"}


def test_device_is_written_to_and_not_replaced():
    write_json({}, Path("/dev/null"))
    assert Path("/dev/null").is_char_device()


@pytest.mark.parametrize("jobs", [1, 2])
def test_parallel_keeps_the_order(jobs, capfd):
    assert parallel(abs, range(-5, 0), jobs, "numbers") == [5, 4, 3, 2, 1]
    assert capfd.readouterr() == ("", "")


def test_chosen_joblib_backend_takes_over():
    def thread(_):
        return os.getpid(), threading.current_thread() is threading.main_thread()

    with joblib.parallel_config(backend="threading"):
        assert parallel(thread, range(3), 2, "threads") == [(os.getpid(), False)] * 3


@pytest.mark.parametrize(
    ("terminal", "delay", "shown"), [(True, 0.0, True), (True, DELAY, False), (False, 0.0, False)]
)
def test_bar_appears_on_a_terminal_once_it_takes_long(monkeypatch, terminal, delay, shown):
    stderr = io.StringIO()
    stderr.isatty = lambda: terminal
    monkeypatch.setattr(sys, "stderr", stderr)
    monkeypatch.setattr("scenarios.experiment.progress.DELAY", delay)
    assert list(progress(range(3), "drives", 3)) == [0, 1, 2]
    assert ("drives" in stderr.getvalue()) == shown
