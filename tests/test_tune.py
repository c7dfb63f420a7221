"""The search, on bowls instead of drives; and what the studies tune."""

import math
import tomllib
from dataclasses import replace

import pytest

from scenarios import ferrari, laps, mass, mixed, roll_yaw
from scenarios.experiment import single
from scenarios.experiment.experiment import Gain, Score
from scenarios.experiment.laws import gains_of, with_gains
from scenarios.tuning import run as tuning
from scenarios.tuning import tune
from scenarios.tuning.tune import Objective
from twin import TwinError

GAINS = (
    Gain(name="a", low=1.0, high=1e4, today=5.0),
    Gain(name="b", low=1.0, high=1e4, today=5.0),
)


def bowl(gains):
    return sum((math.log10(x) - 2.0) ** 2 for x in gains.values()) + 0.5


class Interrupted(Exception):
    pass


def objective(cost=bowl, gains=GAINS, worst=1e3):
    return Objective(name="bowl", gains=gains, cost=cost, metric="depth", unit="1", worst=worst)


def interrupted_after(calls):
    """A bowl that somebody breaks off."""
    left = [calls]

    def cost(gains):
        if left[0] == 0:
            raise Interrupted
        left[0] -= 1
        return bowl(gains)

    return cost


def test_search_finds_the_bottom_and_tells_tried_from_predicted(tmp_path):
    found = tune.search(objective(), 20, 1, tmp_path / "journal")
    assert found.cost == pytest.approx(bowl(found.evaluated))
    assert found.cost < 0.55
    assert found.predicted["a"] == pytest.approx(100.0, rel=0.5)
    assert found.evaluations == 20
    assert list(tmp_path.iterdir()) == []


def test_interrupted_search_goes_on_to_the_same_result(tmp_path):
    journal = tmp_path / "journal"
    whole = tune.search(objective(), 16, 1, journal)
    with pytest.raises(Interrupted):
        tune.search(objective(interrupted_after(10)), 16, 1, journal)
    before = journal.read_text()
    with journal.open("a") as file:
        file.write('{"costs": [1.0,')  # cut off while it was written
    assert len(before.splitlines()) == 1 + 10 // tune.BATCH
    calls = []
    resumed = tune.search(objective(lambda g: calls.append(g) or bowl(g)), 16, 1, journal)
    assert resumed == whole
    assert len(calls) == 16 - 10 // tune.BATCH * tune.BATCH


def test_journal_of_another_tuning_is_refused(tmp_path):
    journal = tmp_path / "journal"
    with pytest.raises(Interrupted):
        tune.search(objective(interrupted_after(4)), 8, 1, journal)
    other = (Gain(name="a", low=1.0, high=1e5, today=5.0), GAINS[1])
    with pytest.raises(TwinError, match="journal: belongs to another tuning"):
        tune.search(objective(gains=other), 8, 1, journal)
    journal.write_text("gains\n")
    with pytest.raises(TwinError, match="journal: is no journal"):
        tune.search(objective(), 8, 1, journal)


def test_gains_that_diverge_cost_the_worst_and_not_the_tuning(tmp_path):
    def cost(gains):
        if gains["a"] > 300.0:
            raise TwinError("blew up")
        return math.nan if gains["b"] > 1000.0 else bowl(gains)

    found = tune.search(objective(cost), 12, 1, tmp_path / "journal")
    assert found.cost < 1e3
    assert found.evaluated["a"] <= 300.0
    everywhere = tune.search(objective(lambda gains: math.inf), 4, 1, tmp_path / "journal")
    assert everywhere.cost == 1e3


def test_todays_gains_are_tried_first(tmp_path):
    seen = []
    tune.search(objective(lambda g: seen.append(dict(g)) or bowl(g)), 4, 1, tmp_path / "j")
    assert seen[0] == pytest.approx({"a": 5.0, "b": 5.0})


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ({"a": (10.0, 1.0)}, "bounds of a are 10 to 1; allowed: 0 < lower < upper"),
        ({"a": (0.0, 1.0)}, "bounds of a are 0 to 1"),
        ({"c": (1.0, 2.0)}, "has no gain 'c'; allowed: a, b"),
    ],
)
def test_bounds_that_make_no_sense_are_named(bounds, message):
    with pytest.raises(TwinError, match=message):
        tune.with_bounds(GAINS, bounds)


def test_gains_of_laws_are_put_where_they_belong():
    laws = roll_yaw.EXPERIMENT.estimators["til-paper"].laws
    assert [gain.name for gain in gains_of(laws)] == ["Jxx gain", "Jzz gain"]
    changed = with_gains(laws, {"Jxx gain": 7.0, "Jzz gain": 11.0})
    assert [(law.parameter, law.gain) for law in changed] == [("Jxx", 7.0), ("Jzz", 11.0)]


def runs_of(experiment, estimator="til", cost="robust", gains=()):
    return experiment.costs[cost].runs(experiment, estimator, gains)


def test_cases_that_count_are_those_of_a_right_twin():
    names = list(dict.fromkeys(run.case.name for run in runs_of(mass.EXPERIMENT)))
    assert names == ["noiseless, correct CM", "noisy, correct CM"]
    assert all("wrong" not in run.case.name for run in runs_of(roll_yaw.EXPERIMENT))


def test_no_reported_seed_tunes():
    for experiment in (mass.EXPERIMENT, laps.EXPERIMENT):
        for cost in experiment.costs:
            assert min(run.seed for run in runs_of(experiment, cost=cost)) >= 1000


def figures(**values):
    """Scores of a run that has these figures, named quantity and metric."""
    return [Score(*name.split("__"), "1", value) for name, value in values.items()]


def test_cost_of_laws_is_the_geometric_mean_over_parameters_and_cases(monkeypatch):
    found = figures(Jxx__rms_pct=2.0, Jxx__time_to_10pct=70.0, Jzz__rms_pct=8.0)
    monkeypatch.setattr(tuning, "score", lambda run: (found, ()))
    cost = tuning.RunCost(roll_yaw.EXPERIMENT, "til-paper", "robust")
    assert cost({"Jxx gain": 7.0, "Jzz gain": 11.0}) == pytest.approx(4.0)


def test_result_of_a_tuning_is_on_file_with_what_made_it(tmp_path, monkeypatch):
    monkeypatch.setattr(
        tuning, "score", lambda run: (figures(Jxx__rms_pct=dict(run.gains)["Jxx gain"]), ())
    )
    path = tmp_path / "a.toml"
    result = tuning.tune(roll_yaw.EXPERIMENT, "til-paper", path, evaluations=4)
    written = tomllib.loads(path.read_text())
    assert (written["vehicle"], written["estimator"]) == ("suv", "til-paper")
    assert written["made"]["tuning"] == "til tune roll-yaw"
    assert written["made"]["seeds"] == list(single.SEEDS)
    rows = {(row.case, row.quantity): row.median for row in result.rows}
    assert rows["best evaluated", "Jxx gain"] == written["gains"]["Jxx gain"]
    assert rows["best predicted", "Jxx gain"] == written["predicted"]["Jxx gain"]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("experiment", "estimator", "changes", "message"),
    [
        (mass, "best", {}, "estimator is 'best'; allowed: til, til-paper"),
        (mass, "til", {"cost": "paper"}, "cost is 'paper'; allowed: robust"),
        (laps, "zero", {}, "estimator is 'zero'; allowed: til, til-paper, double-track"),
        (laps, "til", {"cost": "cheap"}, "cost is 'cheap'; allowed: robust, paper"),
        (laps, "til", {"bounds": {"ay_vy": (0.5, 0.1)}}, "bounds of ay_vy are 0.5 to 0.1"),
        (mixed, "joint", {}, "mixed has no gains to choose"),
        (ferrari, "til", {}, "ferrari has no gains to choose"),
    ],
)
def test_what_cannot_be_tuned_is_named(tmp_path, experiment, estimator, changes, message):
    with pytest.raises(TwinError, match=message):
        tuning.tune(experiment.EXPERIMENT, estimator, tmp_path / "x.toml", evaluations=4, **changes)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("method", ["evolution", "random"])
def test_other_methods_search_and_go_on_after_an_interruption(tmp_path, method):
    aim = Objective(
        name="bowl", gains=GAINS, cost=bowl, metric="depth", unit="1", worst=1e3, method=method
    )
    whole = tune.search(aim, 48, 1, tmp_path / "journal")
    assert len(whole.points) == len(whole.costs) == 48
    assert min(whole.costs) == pytest.approx(bowl(whole.evaluated))
    with pytest.raises(Interrupted):
        tune.search(replace(aim, cost=interrupted_after(22)), 48, 1, tmp_path / "journal")
    assert tune.search(aim, 48, 1, tmp_path / "journal") == whole
    assert not any(tmp_path.iterdir())


def test_evolution_is_better_than_random_points_on_a_bowl(tmp_path):
    aim = objective(gains=tuple(Gain(name=n, low=1.0, high=1e4, today=5.0) for n in "abcd"))
    found = {
        name: tune.search(replace(aim, method=name), 100, 1, tmp_path / name).cost
        for name in ("evolution", "random")
    }
    assert found["evolution"] - 0.5 < 0.3 * (found["random"] - 0.5)


def test_convergence_is_where_the_best_cost_fell():
    assert tuning.best_after([3.0, 4.0, 2.0, 2.0, 1.0]) == {"1": 3.0, "3": 2.0, "5": 1.0}


def test_held_out_vehicles_are_reported_and_not_tuned_on(tmp_path, monkeypatch):
    seen = []

    def scored(run):
        seen.append(run.case.name)
        slip = dict(run.gains)["yaw_rate"] / (100.0 if "laps" in run.case.name else 10.0)
        return figures(sideslip__rmse=slip, mass__rmse_last_60s=0.0), ()

    monkeypatch.setattr(tuning, "score", scored)
    path = tmp_path / "a.toml"
    result = tuning.tune(
        laps.EXPERIMENT, "til", path, evaluations=4, on=("mismatched:laps",),
        held_out=("mismatched:lane-change", "same:laps"),
    )  # fmt: skip
    made = tomllib.loads(path.read_text())["made"]
    assert made["tuned_on"] == ["mismatched:laps"]
    assert set(seen[:8]) == {"mismatched, laps"}
    assert made["held_out"]["mismatched:lane-change"] == pytest.approx(10 * made["cost"], rel=1e-4)
    assert made["held_out"]["same:laps"] == pytest.approx(made["cost"], rel=1e-4)
    rows = {row.case: row.median for row in result.rows if row.quantity == "cost"}
    assert rows["held out, same:laps"] == pytest.approx(made["cost"])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"on": ("mars:laps",)}, "'mars:laps' is no real vehicle on a drive; allowed: VEHICLE:DR"),
        ({"held_out": ("same:moon",)}, "'same:moon' is no real vehicle on a drive"),
        ({"on": ("same:laps",), "held_out": ("same:laps",)}, "same:laps is tuned on and held out"),
        ({"on": ("same:laps", "commonroad:laps")}, "are of 2 cars; allowed: of one car"),
        ({"method": "luck"}, "method is 'luck'; allowed: bayes, evolution, random"),
    ],
)
def test_what_cannot_be_held_out_is_named(tmp_path, changes, message):
    with pytest.raises(TwinError, match=message):
        tuning.tune(laps.EXPERIMENT, "til", tmp_path / "x.toml", evaluations=4, **changes)
    assert list(tmp_path.iterdir()) == []


def test_costs_of_sideslip_and_mass_are_those_of_their_formulas(monkeypatch):
    one = figures(sideslip__rmse=0.2, mass__rmse_last_60s=31.1858, mass__rmse_last_10s=7.0)
    monkeypatch.setattr(tuning, "score", lambda run: (one, ()))
    robust, paper = (
        tuning.RunCost(laps.EXPERIMENT, "til", name)({}) for name in laps.EXPERIMENT.costs
    )
    assert robust == pytest.approx(0.2 / 0.1 + 2.0)  # 31.2 kg are 2 % of 1559.29 kg
    assert paper == pytest.approx(10.0 * 0.2 + 7.0)
