"""What to drive, by the table and by the computation behind it."""

import numpy as np
import pytest

from estimators.base import Estimate
from scenarios.planning import advice
from scenarios.planning.advice_table import MANOEUVRES, seconds_of
from twin import LOAD, SCALES


def test_table_has_every_parameter_and_only_manoeuvres_with_words():
    assert set(advice.table()) == {*LOAD, *SCALES}
    used = {manoeuvre for row in advice.table().values() for manoeuvre in row}
    assert used <= set(advice.WORDS) == set(MANOEUVRES)


@pytest.mark.slow
def test_table_is_what_the_observer_gains_today():
    computed = seconds_of("step steer", 16.0)
    for name in ("cm_x", "Jyy", "Jzz"):
        assert advice.table()[name]["step steer"] == pytest.approx(computed[name], rel=0.05)


def test_sentences_name_the_quickest_manoeuvre_and_one_for_all(monkeypatch):
    rows = {"mass": {"urban": 19.0, "slalom": 37.0}, "Jzz": {"slalom": 132.0}}
    monkeypatch.setattr(advice, "table", lambda: rows)
    mass, jzz, together, last = advice.what_to_drive(("mass", "Jzz"))
    assert mass == f"Not known yet: the mass. 20 s of {advice.WORDS['urban']} would tell."
    assert f"2.5 min of {advice.WORDS['slalom']}" in jzz
    assert together == f"All of these: 2.5 min of {advice.WORDS['slalom']}."
    assert "til plan" in last


def test_nothing_missing_says_nothing():
    assert advice.what_to_drive(()) == ()


def test_missing_is_what_is_not_valid_at_the_end():
    n = 3
    estimate = Estimate(
        time=np.arange(n), states=np.zeros((n, 0)), parameters=np.zeros((n, 2)),
        outputs=np.zeros((n, 0)), extended=np.zeros((n, 0)), nominal=np.zeros(2),
        parameter_names=("mass", "Jzz"), estimated=("mass", "Jzz"), sd=np.ones((n, 2)),
        valid=np.array([[True, False], [False, False], [True, False]]),
    )  # fmt: skip
    assert advice.missing(estimate, ("mass", "Jzz")) == ("Jzz",)
