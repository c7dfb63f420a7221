import numpy as np
import pytest

from estimators.joint.noise import noise_of_record
from scenarios.experiment.reproduction import Making
from scenarios.papers import honesty
from scenarios.plants.random_car import random_car
from twin import OUTPUTS


def test_noise_of_a_record_is_that_of_its_channels():
    rng = np.random.default_rng(0)
    t = np.arange(5000) * 1e-3
    sd = np.array([0.2, 0.5, 1.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4])
    motion = np.sin(2.0 * np.pi * 3.0 * t)[:, None] * sd * 20.0
    found = noise_of_record(motion + rng.normal(size=(t.size, len(OUTPUTS))) * sd)
    assert found == pytest.approx(sd, rel=0.05)


def test_noise_of_a_perfect_record_is_not_nothing():
    found = noise_of_record(np.zeros((100, len(OUTPUTS))))
    assert found[OUTPUTS.index("ax")] == 0.05
    assert (found > 0.0).all()


def test_table_counts_what_is_covered_valid_and_off():
    error = np.array([[1.0] * 7, [10.0] * 7])
    sd = np.array([[1.0] * 7, [2.0] * 7])
    valid = np.array([[True] * 7, [True] * 6 + [False]])
    rows = {(r.quantity, r.metric): r.median for r in honesty._rows("x", error, sd, valid)}
    assert rows["mass", "coverage"] == 0.5
    assert rows["Jzz", "coverage"] == 1.0
    assert rows["mass", "valid_and_off"] == 0.5
    assert rows["Jzz", "valid_and_off"] == 0.0
    assert rows["all", "share_valid"] == pytest.approx(13 / 14)
    assert rows["all", "coverage_all"] == 0.5


def test_no_estimator_is_told_what_a_car_does_not_have():
    drive = honesty._case("mixed", random_car(7)).noisy_drive(0, 1.0)
    assert "noise_sd" not in drive.settings
    assert not drive.inputs[:, 9:13].any()  # of the road


def test_study_runs_on_a_few_seconds(tmp_path, monkeypatch):
    cases = honesty._cases([0])
    monkeypatch.setattr(honesty, "_cases", lambda seeds: {"mixed": cases["mixed"]})
    result = honesty.honesty(Making(seeds=(0,), jobs=1, out=tmp_path, duration=3.0))
    assert {row.metric for row in result.rows} >= {"coverage", "valid_and_off", "claimed_sd_pct"}
    assert next(r for r in result.rows if r.metric == "share_valid").median == 0.0
    assert (tmp_path / "honesty.png").exists()
