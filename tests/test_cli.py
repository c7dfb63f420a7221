import json
import os
import re
import signal
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from estimators.base import sideslip_estimate
from scenarios import __main__ as cli
from scenarios.cli import catalogue
from scenarios.cli.catalogue import REPRODUCTIONS, SCENARIOS, Entry
from scenarios.experiment.experiment import Case, Experiment, Recipe, Score
from scenarios.experiment.result import Result, Row
from scenarios.timeline import write
from twin import Drive, TwinError

ROOT = Path(__file__).parents[1]


def make_result(name, settings, seeds, case="same"):
    row = Row.over_seeds(
        [float(seed) for seed in seeds],
        case=case,
        quantity="mass",
        metric="rms_pct",
        unit="%",
        estimator="til",
    )
    return Result(name=name, settings=settings, seconds=0.5, rows=[row])


class FakePlant:
    """A drive of two samples; some durations are mistakes and bugs."""

    def drive(self, case, rng, duration):
        if duration == 13.0:
            raise TwinError("suv.xml: mass is -1 kg,\nmust be positive")
        if duration == 14.0:
            raise KeyboardInterrupt
        if duration == 15.0:
            raise ZeroDivisionError
        return Drive(
            time=np.arange(2) * 0.1,
            inputs=np.empty((2, 0)),
            input_names=(),
            measurements=np.empty((2, 0)),
            output_names=(),
            truth={},
            settings={},
        )


class FakeEstimator:
    def reset(self, *_):
        """It has no state."""

    def run(self, drive):
        return sideslip_estimate(drive.time, np.zeros(len(drive)))


def score_fake(trial):
    run = trial.run
    return [Score("mass", "rms_pct", "%", float(run.seed), case=f"{run.case.snr:g}dB")]


def reproduce_fake(making):
    (making.out / "fake.png").write_text("picture")
    settings = {"jobs": making.jobs, "duration": making.duration}
    return make_result("fake-table-1", settings, making.seeds)


def bench_fake():
    return make_result("bench", {}, [0])


def draw_fake(trials, path):
    path.write_text(f"timeline of seed {trials[0].run.seed}")


def limit_fake(experiment, snr, duration):
    case = experiment.at(snr)[0]
    kept = {"snr": case.snr, "duration": duration}
    result = make_result(f"limits of {experiment.name}", kept, [1])
    return result, f"bounds at {case.snr:g} dB"


FAKE = Experiment(
    name="fake",
    cases=(Case(name="fake", plant=FakePlant(), snr=10.0),),
    estimators={"til": Recipe(estimator="til", make=lambda run, drive: FakeEstimator())},
    quantities=("mass",),
    metrics=score_fake,
)


@pytest.fixture(autouse=True)
def catalogue_and_folder(monkeypatch, tmp_path):
    """A catalogue of fakes, in an empty working directory."""
    for name in list(SCENARIOS):
        monkeypatch.delitem(SCENARIOS, name)
    for name in list(REPRODUCTIONS):
        monkeypatch.delitem(REPRODUCTIONS, name)
    monkeypatch.setitem(SCENARIOS, "fake", Entry(f"{__name__}:FAKE", "does nothing"))
    for name in "fake-table-1", "fake-table-2":
        entry = Entry(f"{__name__}:reproduce_fake", "a table of nothing")
        monkeypatch.setitem(REPRODUCTIONS, name, entry)
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def til(capsys):
    def run(*args):
        status = cli.main(args)
        return (status, *capsys.readouterr())

    return run


def run_json(til, *args):
    """Runs with --json -, whose standard output must be one JSON object."""
    status, out, err = til(*args, "--json", "-")
    assert (status, err) == (0, "")
    return json.loads(out)


def test_list_names_scenarios_and_reproductions_with_a_line_each(til):
    status, out, err = til("list")
    assert (status, err) == (0, "")
    assert [line.split(maxsplit=1) for line in out.splitlines() if line.startswith("  ")] == [
        ["fake", "does nothing"],
        ["fake-table-1", "a table of nothing"],
        ["fake-table-2", "a table of nothing"],
    ]


def test_run_prints_a_table_and_writes_nothing(til, tmp_path):
    status, out, err = til("run", "fake", "--seeds", "3")
    assert (status, err) == (0, "")
    title, heading, _, row = out.splitlines()
    assert re.fullmatch(r"fake \(\d+\.\d s\)", title)
    assert heading.split()[-2:] == ["median", "p90"]
    assert row.split() == ["10dB", "mass", "rms_pct", "%", "til", "3", "1.00", "1.80"]
    assert list(tmp_path.iterdir()) == []


def test_run_without_options_is_one_seed_at_the_scenario_s_noise(til):
    data = run_json(til, "run", "fake")
    assert list(data) == ["name", "settings", "versions", "seconds", "rows"]
    assert data["settings"] == {"snr": 10.0, "seeds": [0], "jobs": 1, "duration": None}
    assert (data["rows"][0]["seeds"], data["rows"][0]["median"]) == (1, 0.0)


def test_options_of_run_reach_the_scenario(til):
    options = "run fake --snr 5 --seed 7 --seeds 3 --jobs 2 --duration 2.5"
    data = run_json(til, *options.split())
    assert data["settings"] == {"snr": 5.0, "seeds": [7, 8, 9], "jobs": 2, "duration": 2.5}
    assert (data["rows"][0]["seeds"], data["rows"][0]["median"]) == (3, 8.0)


def test_infinite_signal_to_noise_ratio_is_taken(til):
    assert run_json(til, "run", "fake", "--snr", "inf")["rows"][0]["case"] == "infdB"


def test_json_file_comes_beside_the_table(til, tmp_path):
    status, out, _ = til("run", "fake", "--json", "fake.json")
    assert status == 0
    assert out.startswith("fake (")
    assert json.loads((tmp_path / "fake.json").read_text())["name"] == "fake"


@pytest.fixture
def _timeline(monkeypatch):
    monkeypatch.setitem(write.KINDS, "parameters", draw_fake)


@pytest.mark.usefixtures("_timeline")
def test_rrd_file_holds_the_timeline_of_the_first_seed(til, tmp_path):
    assert til("run", "fake", "--seed", "7", "--rrd", "fake.rrd")[0] == 0
    assert [path.name for path in tmp_path.iterdir()] == ["fake.rrd"]
    assert (tmp_path / "fake.rrd").read_text() == "timeline of seed 7"


@pytest.mark.usefixtures("_timeline")
@pytest.mark.parametrize("options", [(), ("--rrd", "fake.rrd")])
def test_view_opens_the_timeline(til, monkeypatch, options):
    seen = []
    monkeypatch.setattr(
        "scenarios.timeline.timeline.view", lambda path: seen.append(path.read_text())
    )
    assert til("run", "fake", "--view", *options)[0] == 0
    assert seen == ["timeline of seed 0"]


def test_reproduction_of_one_name_is_one_result(til, tmp_path):
    data = run_json(
        til, *["reproduce", "fake-table-1", "--seeds", "3", "--jobs", "2", "--duration", "1.5"]
    )
    assert data["name"] == "fake-table-1"
    assert data["settings"] == {"jobs": 2, "duration": 1.5}
    assert data["rows"][0]["seeds"] == 3
    assert (tmp_path / "out" / "fake.png").exists()


def test_reproduction_of_all_is_a_list_of_results(til, tmp_path):
    data = run_json(til, "reproduce", "--out", "a/b")
    assert list(data) == ["results"]
    assert [result["rows"][0]["seeds"] for result in data["results"]] == [20, 20]
    assert (tmp_path / "a" / "b" / "fake.png").exists()


def test_reproduction_named_twice_runs_once(til):
    _, out, _ = til("reproduce", "fake-table-1", "fake-table-2", "fake-table-1")
    assert out.count("fake-table-1 (0.5 s)") == 2  # both fakes give that name
    assert len(out.split("\n\n")) == 2


def test_bench_has_the_same_shape(til, monkeypatch):
    monkeypatch.setitem(catalogue._TARGETS, "bench", f"{__name__}:bench_fake")
    assert run_json(til, "bench")["name"] == "bench"


@pytest.fixture
def limits(monkeypatch):
    monkeypatch.setitem(catalogue._TARGETS, "limits", f"{__name__}:limit_fake")


@pytest.mark.usefixtures("limits")
def test_limits_are_shown_as_text_at_the_scenario_s_noise(til):
    assert til("limits", "fake") == (0, "limits of fake (0.5 s)\nbounds at 10 dB\n", "")


@pytest.mark.usefixtures("limits")
def test_options_of_limits_reach_what_gives_them(til):
    data = run_json(til, "limits", "fake", "--snr", "5", "--duration", "2.5")
    assert data["settings"] == {"snr": 5.0, "duration": 2.5}
    assert len(data["rows"]) == 1


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("drive", "No such command 'drive'."),
        ("run", "Missing argument 'NAME'. (see til run --help)"),
        ("run lap", "no scenario 'lap', only fake"),
        ("limits lap", "no scenario 'lap', only fake"),
        ("limits fake --snr inf", "limits: snr is inf; allowed: a number of dB"),
        ("reproduce fake-table-1 t", "no reproduction 't', only fake-table-1, fake-table-2"),
        ("run fake --sedes 3", "No such option '--sedes'"),
        ("run fake --seeds 0", "0 is not in the range x>=1"),
        ("run fake --seed -1", "-1 is not in the range x>=0"),
        ("run fake --jobs 0", "0 is not in the range x>=1"),
        ("reproduce --seeds 0", "0 is not in the range x>=1"),
        ("run fake --snr loud", "'loud' is not a valid float"),
        ("run fake --snr nan", "nan is neither a number of dB nor inf"),
        ("run fake --snr -inf", "-inf is neither a number of dB nor inf"),
        ("run fake --duration 0", "0 s is not positive and finite"),
        ("run fake --duration inf", "inf s is not positive and finite"),
        ("run fake --duration 13", "suv.xml: mass is -1 kg, must be positive"),
        ("run fake --json none/f.json", "none/f.json cannot be written: No such file"),
        ("run fake --rrd none/f.rrd", "none/f.rrd cannot be written: No such file"),
        ("run fake --rrd mass.txt", "mass.txt must end in .rrd"),
        ("bench --json /proc/f.json", "/proc/f.json cannot be written: "),
        ("run fake --json .", "File '.' is a directory."),
        ("reproduce --out /proc/out", "--out: /proc/out cannot be written: "),
    ],
)
def test_mistake_is_one_line_and_status_2(til, tmp_path, command, message):
    status, out, err = til(*command.split())
    assert (status, out) == (2, "")
    assert err.startswith("til: ")
    assert err.endswith("\n")
    assert len(err.splitlines()) == 1
    assert message in err
    assert list(tmp_path.iterdir()) == []


def test_interrupt_is_one_line_and_status_130(til):
    assert til("run", "fake", "--duration", "14") == (130, "", "til: interrupted\n")


def test_bug_keeps_its_traceback(til):
    with pytest.raises(ZeroDivisionError):
        til("run", "fake", "--duration", "15")


def test_help_is_no_mistake(til):
    for command in ([], ["list"], ["run"], ["reproduce"], ["limits"], ["bench"]):
        status, out, err = til(*command, "--help")
        assert (status, err) == (0, "")
        assert out.startswith(" ".join(["Usage: til", *command]))


def test_list_imports_neither_mujoco_nor_numba_nor_numpy():
    code = (
        "import sys; from scenarios.__main__ import main; status = main(['list']);"
        "print(*sys.modules); sys.exit(status)"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    modules = set(run.stdout.split())
    assert "scenarios.cli.catalogue" in modules
    assert modules & {"mujoco", "numba", "numpy", "joblib", "rerun"} == set()


def test_module_runs_as_the_program_does():
    command = [sys.executable, "-m", "scenarios", "run", "no-such-scenario"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith("til: ")
    assert "no scenario 'no-such-scenario', only ferrari, hard, i3, lane-change" in run.stderr


def test_ctrl_c_ends_parallel_work_with_one_line(tmp_path):
    code = f"""
import sys, time
from scenarios import __main__ as cli
from scenarios.cli import catalogue
from scenarios.experiment.experiment import Case, Experiment, Recipe

class Slow:
    def drive(self, case, rng, duration):
        open({str(tmp_path)!r} + f"/{{rng.integers(1 << 40)}}", "w").close()
        time.sleep(60)

slow = Experiment(
    name="slow", cases=(Case(name="slow", plant=Slow(), snr=10.0),),
    estimators={{"til": Recipe(estimator="til")}}, quantities=(), metrics=lambda trial: [],
)
catalogue.scenario = lambda name: slow
sys.exit(cli.main(["run", "mass", "--seeds", "4", "--jobs", "2"]))
"""
    run = subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=ROOT, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    while len(list(tmp_path.iterdir())) < 2:
        assert run.poll() is None
        time.sleep(0.05)
    os.killpg(run.pid, signal.SIGINT)
    _, err = run.communicate(timeout=30)
    assert (run.returncode, err) == (130, "til: interrupted\n")


def test_new_car_is_written_once(til, tmp_path):
    assert til("new-car", "mine") == (
        0,
        "mine.toml describes a car: change what you know of yours.\n",
        "",
    )
    status, out, err = til("new-car", "mine")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "mine.toml: is there already" in err
    assert "[chassis]" in (tmp_path / "mine.toml").read_text()


def test_inspect_shows_a_log_and_names_a_missing_one(til, tmp_path):
    (tmp_path / "log.csv").write_text("t,a [g]\n0,1\n1,2\n")
    status, out, err = til("inspect", "log.csv")
    assert (status, err) == (0, "")
    assert "a [g]    g     1          2" in out
    status, out, err = til("inspect", "none.csv")
    assert (status, out, err) == (
        2,
        "",
        "til: none.csv: cannot be read: No such file or directory\n",
    )


def test_program_alone_prints_its_help(til):
    status, out, err = til()
    assert (status, err) == (0, "")
    assert out == til("-h")[1]
    assert "doctor" in out


def test_version_is_that_of_the_package(til):
    assert til("--version")[1] == f"til {metadata.version('twin-in-the-loop')}\n"


def test_picture_of_a_scenario_without_one_is_refused_before_the_run(til):
    status, out, err = til("run", "fake", "--duration", "15", "--png", "x.png")  # 15 s: a bug
    assert (status, out) == (2, "")
    assert "--png: fake has no picture" in err
    assert not Path("x.png").exists()
