import pytest

from scenarios.__main__ import main
from scenarios.experiment import gains_file as gains
from scenarios.experiment.reproduction import Making
from scenarios.experiment.sideslip_and_mass import BOUNDS, gains_of
from scenarios.papers import til_tables
from twin import TwinError

GAINS, PREDICTED = {"a": 1.5, "b": 2.5}, {"a": 1.0, "b": 2.0}


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "gains.toml"
    gains.write(
        path, vehicle="suv", estimator="til", gains=GAINS, predicted=PREDICTED, made={"seed": 1000}
    )
    return path


def test_best_evaluated_gains_come_back(file):
    assert gains.read(file, vehicle="suv", estimator="til", names=["b", "a"]) == {
        "b": 2.5,
        "a": 1.5,
    }


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"vehicle": "sports_car"}, "vehicle is 'suv'; allowed here: 'sports_car'"),
        ({"estimator": "zero"}, "estimator is 'til'; allowed here: 'zero'"),
        ({"names": ["c"]}, r"gains\.c is None; allowed: a finite number"),
    ],
)
def test_gains_for_something_else_are_refused(file, changes, message):
    wanted = {"vehicle": "suv", "estimator": "til", "names": ["a"]} | changes
    with pytest.raises(TwinError, match=rf"gains\.toml: {message}"):
        gains.read(file, **wanted)


@pytest.mark.parametrize(("text", "message"), [(None, "cannot be read"), ("= 3", "is no TOML")])
def test_file_that_is_none_is_named(tmp_path, text, message):
    path = tmp_path / "x.toml"
    if text:
        path.write_text(text)
    with pytest.raises(TwinError, match=rf"x\.toml: {message}"):
        gains.read(path, vehicle="suv", estimator="til", names=["a"])


@pytest.mark.parametrize("estimator", list(BOUNDS))
@pytest.mark.parametrize("car", ["sports_car", "bmw_320i"])
def test_shipped_gains_lie_within_their_bounds(car, estimator):
    for name, value in gains_of(car, estimator).items():
        low, high = BOUNDS[estimator][name]
        assert low * 0.999 <= value <= high * 1.001


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["tune", "laps", "--bounds", "ay_vy", "0.5", "0.1"], "bounds of ay_vy are 0.5 to 0.1"),
        (["tune", "mass", "--bounds", "drift", "1", "2"], "has no gain 'drift'; allowed: mass"),
        (["tune", "laps", "--estimator", "zero"], "estimator is 'zero'; allowed: til"),
        (["run", "mixed", "--gains", "x.toml"], "--gains: joint on mixed takes none"),
        (["run", "laps", "--gains", "x.toml"], "x.toml: cannot be read"),
    ],
)
def test_mistake_on_the_command_line_is_one_line(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert message in err


def test_table_8_prints_gains_that_were_tuned_and_what_they_cost_elsewhere(tmp_path):
    result = til_tables.table_8(Making(seeds=(0,), jobs=1, out=tmp_path))
    values = {(row.estimator, row.case, row.quantity): row.median for row in result.rows}
    for estimator, made in result.settings["made"].items():
        assert made["evaluations"] >= 60, estimator
        assert not set(made["tuned_on"]) & set(made["held_out"])
    assert values["til", "optimised", "yaw_rate"] != values["til", "in use", "yaw_rate"]
    assert ("til", "in use, held out", "cost, all-scales:laps") in values
    assert (tmp_path / "til-table-8.png").is_file()
