import tomllib

import numpy as np
import pytest

from scenarios import mass, roll_yaw, tune
from twin import TwinError


def test_gains_are_put_where_they_belong():
    laws = roll_yaw.STUDY.laws["til-paper"]
    gains = tune.gains_of(laws)
    changed = tune.with_gains(laws, gains, [7.0, 11.0])
    assert [law.gain for law in changed] == [7.0, 11.0]
    assert [law.parameter for law in changed] == ["Jxx", "Jzz"]


def test_cases_that_count_are_those_of_a_right_twin():
    assert [case.name for case in tune.cases_of(mass.STUDY)] == [
        "noiseless, correct CM",
        "noisy, correct CM",
    ]
    assert all("wrong" not in case.name for case in tune.cases_of(roll_yaw.STUDY))


def test_no_reported_seed_tunes():
    assert min(tune.SEEDS) >= 1000


def test_result_is_the_best_point_tried_and_repeatable(tmp_path, monkeypatch):
    """On a bowl in the plane of the gains' logarithms, instead of drives."""

    def bowl(study, estimator, gains, point, jobs):
        return float(np.sum((np.array(point) - 2.0) ** 2) + 0.5)

    monkeypatch.setattr(tune, "_cost", bowl)
    results = []
    for name in ("a.toml", "b.toml"):
        result = tune.run(roll_yaw.STUDY, "til-paper", 20, 1, tmp_path / name)
        results.append([(row.case, row.quantity, row.median) for row in result.rows])
    assert results[0] == results[1]
    written = tomllib.loads((tmp_path / "a.toml").read_text())
    assert written["study"] == "roll-yaw"
    assert written["geometric_mean_rms_pct"] < 0.6
    assert written["predicted"]["Jxx"]["gain"] == pytest.approx(100.0, rel=0.5)
    assert sorted(tmp_path.iterdir()) == [tmp_path / "a.toml", tmp_path / "b.toml"]


def test_gains_that_blow_the_twin_up_cost_the_worst(monkeypatch):
    def explode(run, laws):
        raise TwinError("blew up")

    monkeypatch.setattr(tune, "score", explode)
    costs = tune._Scored(mass.STUDY.laws["til"])(None)
    assert costs.tolist() == [tune.WORST]


def test_unknown_estimator_is_named(tmp_path):
    with pytest.raises(TwinError, match="estimator is 'best'; allowed: til, til-paper"):
        tune.run(mass.STUDY, "best", 4, 1, tmp_path / "x.toml")
    assert list(tmp_path.iterdir()) == []
