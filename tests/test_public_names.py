import doctest
from importlib import import_module

import numpy as np
import pyarrow.csv as pv
import pytest
from test_answer import found_of

import estimators
from estimators import JointObserver, ParameterLaw, joint_observer, til_observer
from estimators.til import default_observer
from twin import OUTPUTS, TwinError, Vehicle

pd = pytest.importorskip("pandas")


@pytest.fixture(scope="module")
def estimate():
    n = 500
    return found_of(
        sd={"mass": 6.0, "cm_x": 0.002, "tyre_friction": 0.01},
        trusted=np.arange(n) > 50, sideslip_sd=np.full(n, 0.01),
    ).estimate  # fmt: skip


def test_every_public_name_is_there_and_listed():
    assert set(estimators.__all__) <= set(dir(estimators))
    assert all(getattr(estimators, name) is not None for name in estimators.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = estimators.nothing


@pytest.mark.parametrize("name", ["estimators", "estimators.til.default_observer"])
def test_examples_of_docstrings_run(name):
    result = doctest.testmod(import_module(name))
    assert result.attempted > 0
    assert result.failed == 0


def test_til_observer_is_the_one_of_logs():
    car = Vehicle.load("suv")
    plain = default_observer.default_observer(car, set(OUTPUTS)).observer
    assert til_observer("suv").settings() == til_observer(car).settings() == plain.settings()


def test_joint_observer_takes_the_noise_of_the_drive():
    found = found_of()
    noise = np.random.default_rng(0).normal(size=found.drive.measurements.shape)
    assert isinstance(joint_observer("suv", found.drive.replace(measurements=noise)), JointObserver)


@pytest.mark.parametrize("name", ["prior_sd", "noise_density"])
def test_law_demands_what_has_no_sensible_default(name):
    given = {"prior_sd": 400.0, "noise_density": 0.03} | {name: np.nan}
    with pytest.raises(TwinError, match=f"{name} is nan; allowed: more than 0"):
        ParameterLaw(parameter="mass", signal="ax", **given)


def test_frame_has_estimates_and_their_sd(estimate):
    frame = estimate.to_frame()
    assert frame.index.name == "time"
    assert frame["mass"].iloc[-1] == 355.0
    assert frame["mass_sd"].iloc[-1] == 6.0
    assert frame["sideslip"].iloc[-1] == pytest.approx(np.arctan2(-1.0, 20.0))
    assert frame["trustworthy"].dtype == bool
    assert estimate.mass[-1] == pytest.approx(Vehicle.load("suv").chassis().mass + 355.0)


def test_saved_columns_come_back(estimate, tmp_path):
    estimate.save(tmp_path / "e.csv")
    estimate.save(str(tmp_path / "e.parquet"))
    table = pv.read_csv(tmp_path / "e.csv")
    assert table.column_names == list(estimate.columns())
    assert pd.read_parquet(tmp_path / "e.parquet")["mass"].iloc[0] == 355.0
    with pytest.raises(TwinError, match=r"ends in '\.xls'; allowed: \.parquet, \.csv"):
        estimate.save(tmp_path / "e.xls")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["e.csv", "e.parquet"]


def test_plot_has_an_axis_for_each_estimate_and_the_sideslip(estimate):
    labels = [axis.get_ylabel() for axis in estimate.plot().axes]
    assert labels == ["mass", "cm_x", "tyre_friction", "sideslip [deg]"]
    assert len(estimate.plot("mass", "vx").axes) == 2
    with pytest.raises(TwinError, match="has no 'nothing'"):
        estimate.plot("nothing")
