import json
import math
import subprocess
import sys
from io import StringIO
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from estimators.speed_follower import TORQUES
from scenarios import __main__ as cli
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import record
from scenarios.logs import stream as estimate_stream
from scenarios.logs.estimate import Task, observe
from scenarios.logs.pieces import lacking, measured, prepared
from twin import OUTPUTS, TwinError, Vehicle, with_noise
from twin.logs.map import LogMap
from twin.logs.units import GRAVITY

ROOT = Path(__file__).parents[1]
DEG, RADIUS = np.pi / 180.0, 0.36
# A log as another program might write it: its name, its unit, and ours per number, in axes of SAE
SAE = {
    "steering_wheel_angle": ("Steer", "deg", -DEG),
    "ax": ("Ax", "g", GRAVITY),
    "ay": ("Ay", "g", -GRAVITY),
    "az": ("Az", "g", -GRAVITY),
    "roll_rate": ("P", "deg/s", DEG),
    "pitch_rate": ("Q", "deg/s", -DEG),
    "yaw_rate": ("R", "deg/s", -DEG),
    **{f"wheel_speed_{w}": (f"W{w}", "km/h", 1 / (3.6 * RADIUS)) for w in ("fl", "fr", "rl", "rr")},
    **{name: (name.title(), "N m", 1.0) for name in TORQUES},
}
HEAD = 'axes = "SAE"\n[time]\nname = "Time"\nunit = "ms"\n[constants]\nroad_height = 0.0\n'
MAP = HEAD + "".join(
    f'[channels.{ours}]\nname = "{theirs}"\nunit = "{unit}"\n'
    + (f"radius = {RADIUS}\n" if unit == "km/h" else "")
    for ours, (theirs, unit, _) in SAE.items()
)


@pytest.fixture(scope="module")
def drive():
    clean = record(Vehicle.load("suv_loaded"), urban(duration=8.0))
    noisy = with_noise(clean, 20.0, np.random.default_rng(2))
    return part(noisy, slice(3000, 8000))


@pytest.fixture(scope="module")
def saved(drive, tmp_path_factory):
    """The drive as a file, and what `til estimate` leaves of it in a folder."""
    folder = tmp_path_factory.mktemp("saved")
    drive.save(folder / "drive.parquet")
    status = cli.main(["estimate", str(folder / "drive.parquet"), *options(folder / "out")])
    return folder, status


def options(out, *more):
    return ["--vehicle", "suv", "--out", str(out), *more]


def part(drive, samples):
    return drive.replace(
        time=drive.time[samples],
        inputs=drive.inputs[samples],
        measurements=drive.measurements[samples],
        truth={name: values[samples] for name, values in drive.truth.items()},
    )


def write_csv(path, drive):
    columns = {"Time": 1e3 * drive.time}
    columns |= {name: drive.channel(ours) / per for ours, (name, _, per) in SAE.items()}
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, "%.12g", ",", header=",".join(columns), comments="")
    return path


def answer_of(path):
    return json.loads(path.read_text())["answer"]


def mass_of(answer):
    return answer["quantities"][0]


def test_drive_gives_timeline_history_and_scored_result(saved, drive):
    folder, status = saved
    assert status == 0
    names = {path.name for path in (folder / "out").iterdir()}
    assert names == {f"drive.til.{ending}" for ending in ("html", "json", "parquet", "rrd")}
    answer = answer_of(folder / "out" / "drive.til.json")
    mass, errors = mass_of(answer), answer["errors"]
    assert (mass["name"], mass["unit"]) == ("mass", "kg")
    assert mass["value"] == pytest.approx(2337.83 + mass["change"], abs=0.1)
    assert mass["low"] == pytest.approx(mass["change"] - 1.96 * mass["sd"])
    assert set(errors) == {"mass_kg", "mass_pct", "sideslip_deg", "vx_m_s"}
    assert errors["mass_kg"] == pytest.approx(mass["change"] - 355.0)
    assert errors["mass_pct"] < 30.0
    assert errors["vx_m_s"] < 0.05
    assert 0.5 < answer["trusted"] < 1.0
    assert answer["untrusted"][0]["reason"] == "the estimate settles after the start"

    import pyarrow.parquet as pq

    history = pq.read_table(folder / "out" / "drive.til.parquet")
    assert history.num_rows == len(drive)
    assert history["mass"][-1].as_py() == mass["change"]


def test_second_call_keeps_what_is_finished_and_a_bad_log_does_not_stop_the_others(
    saved, drive, capsys
):
    folder, _ = saved
    content = (folder / "drive.parquet").read_bytes()
    (folder / "cut.parquet").write_bytes(content[: len(content) // 2])
    before = (folder / "out" / "drive.til.json").stat().st_mtime_ns
    logs = [str(folder / name) for name in ("cut.parquet", "none.csv", "drive.parquet")]
    capsys.readouterr()
    status = cli.main(["estimate", *logs, *options(folder / "out", "--json", "-")])
    out, err = capsys.readouterr()
    assert status == 2
    assert (folder / "out" / "drive.til.json").stat().st_mtime_ns == before
    result = json.loads(out)
    assert [log["kept"] for log in result["logs"]] == [False, False, True]
    assert [log["answer"] is None for log in result["logs"]] == [True, True, False]
    assert not {"rows", "median", "p90", "paper"} & set(result)
    lines = err.splitlines()
    assert len(lines) == 2
    assert f"til: {folder / 'cut.parquet'}: cannot be read as Parquet" in lines[0]
    assert f"til: {folder / 'none.csv'}: cannot be read: No such file" in lines[1]
    assert not list((folder / "out").glob("cut*"))


def test_another_car_is_another_result(saved):
    folder, _ = saved
    task = Task(
        log=folder / "drive.parquet", map=None, vehicle="suv_loaded", estimator="til",
        out=folder / "out2", name="drive",
    )  # fmt: skip
    (folder / "out2").mkdir()
    for ending in ("json", "rrd", "parquet"):
        name = f"drive.til.{ending}"
        (folder / "out2" / name).write_bytes((folder / "out" / name).read_bytes())
    outcome = observe(task)
    assert (outcome.kept, outcome.error) == (False, "")
    empty = mass_of(answer_of(folder / "out" / "drive.til.json"))
    assert outcome.answer.quantities[0].change < empty["change"] - 200.0


def test_csv_in_everyday_units_and_sae_axes_gives_the_same_estimates(saved, drive):
    folder, _ = saved
    log = write_csv(folder / "sae.csv", drive)
    (folder / "map.toml").write_text(MAP)
    task = Task(
        log=log, map=folder / "map.toml", vehicle="suv", estimator="til", out=folder / "out",
        name="sae",
    )  # fmt: skip
    outcome = observe(task)
    assert outcome.error == ""
    assert "ay: from 'Ay' in g at 1000 Hz, sign turned." in outcome.done
    expected = answer_of(folder / "out" / "drive.til.json")
    found = outcome.answer.to_json()
    assert (found["errors"], set(expected["errors"])) == ({}, {*expected["errors"]})
    for key in ("change", "sd"):
        assert mass_of(found)[key] == pytest.approx(mass_of(expected)[key], rel=1e-5)
    for key in ("speed", "trusted"):
        assert found[key] == pytest.approx(expected[key], rel=1e-5, abs=1e-5)


def test_log_without_torques_gives_sideslip_but_no_mass_and_says_so(tmp_path, drive):
    inputs = [i for i, name in enumerate(drive.input_names) if name not in TORQUES]
    bare = drive.replace(
        inputs=drive.inputs[:, inputs],
        input_names=tuple(drive.input_names[i] for i in inputs),
        measurements=np.column_stack([drive.measurements, drive.truth["vx"]]),
        output_names=(*OUTPUTS, "vx"),
    )
    bare.save(tmp_path / "bare.parquet")
    task = Task(
        log=tmp_path / "bare.parquet", map=None, vehicle="suv", estimator="til", out=tmp_path,
        name="bare",
    )  # fmt: skip
    outcome = observe(task)
    assert outcome.error == ""
    answer = outcome.answer
    assert answer.quantities == ()
    assert answer.errors["sideslip_deg"] < 0.05
    assert answer.errors["sideslip_deg"] < answer.sideslip.band < 4.0
    assert answer.errors["vx_m_s"] < 0.1
    history = pq.read_table(tmp_path / "bare.til.parquet")
    assert (history["sideslip_sd"].to_numpy() > 0.0).mean() > 0.99
    assert any(line.startswith("mass cannot be estimated without drive_t") for line in outcome.done)


def test_log_with_gaps_is_bridged_or_begun_again(drive):
    kept = np.ones(len(drive), dtype=bool)
    kept[1000:1500] = kept[2500:4000] = False
    kept[1::2] = False
    log = prepared(part(drive, kept), 1e-3)
    assert [len(piece) for piece in log.pieces] == [2499, 999]
    assert "1 gaps of up to 1 s are bridged" in "\n".join(log.done)
    assert "1 gaps of more than 1 s" in "\n".join(log.done)
    first = log.pieces[0]
    assert np.isnan(first.measurements[1000:1498]).all()
    np.testing.assert_array_equal(first.inputs[1000:1499], drive.inputs[998:999].repeat(499, 0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: {"input_names": ("x", *d.input_names[1:])}, "input steering_wheel_angle is mi"),
        (
            lambda d: {"measurements": np.full_like(d.measurements, np.nan)},
            "has no vx or the wheel speeds",
        ),
        (
            lambda d: {"inputs": d.inputs[:, :1], "input_names": d.input_names[:1]},
            "has neither torques nor vx",
        ),
    ],
)
def test_log_that_cannot_be_observed_is_one_line(drive, change, message):
    with pytest.raises(TwinError, match=message) as caught:
        prepared(drive.replace(**change(drive)), 1e-3)
    assert "\n" not in str(caught.value)


def test_torques_that_never_change_are_none(drive):
    inputs = drive.inputs.copy()
    inputs[:, 1:9] = 100.0
    names = measured([drive.replace(inputs=inputs)])
    assert not names & {name for name in TORQUES if name.startswith("drive")}
    assert "steering_wheel_angle" in names
    assert set(TORQUES) < measured([drive])


def test_brakes_that_the_map_declares_are_not_known_and_no_mass_is_estimated(drive):
    constants = [name for name in TORQUES if name.startswith("brake")]
    settings = drive.settings | {"log": {"constants": constants}}
    inputs = drive.inputs.copy()
    inputs[:, 5:9] = 0.0
    names = measured([drive.replace(inputs=inputs, settings=settings)])
    assert lacking("mass", names) == constants


def as_json(drive, samples):
    names = (*drive.input_names, *drive.output_names)
    for k in samples:
        values = {name: float(drive.channel(name)[k]) for name in names}
        yield json.dumps({"time": float(drive.time[k])} | values) + "\n"


def streamed(lines, **more):
    written = []
    report = StringIO()
    car = Vehicle.load("suv")
    stream = estimate_stream.observe(car, lines, written.append, report=report, **more)
    return [json.loads(line) for line in written], stream, report.getvalue()


def test_stream_of_json_is_the_stream_of_csv_and_of_a_mapped_log(tmp_path, drive):
    short = part(drive, slice(0, 1000))
    short.save(tmp_path / "drive.csv")
    (tmp_path / "map.toml").write_text(MAP)
    mapped = write_csv(tmp_path / "sae.csv", short).read_text().splitlines()
    found, stream, report = streamed(as_json(short, range(1000)))
    assert report == "til: samples: 1000 taken\n"
    assert stream.counts["taken"] == len(found) == 1000
    as_csv = streamed((tmp_path / "drive.csv").read_text().splitlines())[0]
    assert as_csv == found
    by_map = streamed(mapped, log_map=LogMap.load(tmp_path / "map.toml"))[0]
    for name in ("mass", "vx", "sideslip", "mass_sd"):
        assert by_map[-1][name] == pytest.approx(found[-1][name], rel=1e-4, abs=1e-6)


def test_stream_whose_time_runs_backwards_goes_on(drive):
    order = [*range(500), *range(400, 405), *range(500, 1000)]
    found, stream, report = streamed(as_json(drive, order))
    assert stream.counts["late"] == 5
    assert "5 late" in report
    assert len(found) == 1000
    assert all(math.isfinite(line["mass"]) for line in found)


def test_stream_goes_on_from_its_state(tmp_path, drive):
    state = tmp_path / "state.npz"
    whole = streamed(as_json(drive, range(800)))[0]
    streamed(as_json(drive, range(400)), state=state)
    rest = streamed(as_json(drive, range(400, 800)), state=state)[0]
    assert rest == whole[400:]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([], "has no samples"),
        (['{"time": 0, "ax": 1}'], "steering_wheel_angle is missing in the first sample"),
        (['{"ax": 1}'], "no column is called time"),
        (["{nonsense"], "line 1 is no JSON"),
        (["time,ax", "left,left"], "has no row of names with rows of numbers below it"),
        (["time,ax", "1"], "has no row of names with rows of numbers below it"),
        (["time (ticks),ax", "1,1"], "'ticks', an unknown unit of time"),
    ],
)
def test_broken_stream_is_one_line(lines, message):
    with pytest.raises(TwinError, match=message) as caught:
        streamed(lines)
    assert "\n" not in str(caught.value)


def test_stream_stands_in_a_pipe(drive):
    """Each estimate comes before the next sample goes in; then the input is out of range."""
    lines = list(as_json(drive, range(3)))
    command = [sys.executable, "-m", "scenarios", "estimate", "-", "--vehicle", "suv"]
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command, cwd=ROOT, stdin=pipe, stdout=pipe, stderr=pipe, text=True
    ) as til:
        for k, line in enumerate(lines):
            til.stdin.write(line)
            til.stdin.flush()
            assert json.loads(til.stdout.readline())["time"] == pytest.approx(drive.time[k])
        steered = json.loads(lines[2]) | {"time": 10.0, "steering_wheel_angle": 99.0}
        til.stdin.write(json.dumps(steered) + "\n")
        out, err = til.communicate()
    assert (til.returncode, out) == (2, "")
    assert err == ("til: update: steering_wheel_angle is 99.0 in sample 0; allowed: -15 to 15\n")


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["a.csv", "--vehicle", "submarine"], "submarine"),
        (["-", "b.csv", "--vehicle", "suv"], "a stream, -, stands alone"),
        (["b.csv", "--vehicle", "suv", "--state", "s"], "--state: is that of a stream"),
        (["b.csv"], "Missing option '--vehicle'"),
        ([], "Missing argument 'LOG...'"),
    ],
)
def test_mistake_on_the_command_line_is_one_line(args, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["estimate", *args]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert message in err
