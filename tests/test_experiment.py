from dataclasses import replace

import numpy as np
import pytest

from scenarios import mass, pitch, roll_yaw
from scenarios.experiment.engine import observe, rows, run_experiment, runs, score
from scenarios.experiment.experiment import INFINITE, MASS
from scenarios.experiment.progress import parallel
from scenarios.experiment.single import limit
from twin import Twin, TwinError, Vehicle

DURATION = 5.0
EXPERIMENTS = [module.EXPERIMENT for module in (mass, roll_yaw, pitch)]
CASE = pitch.EXPERIMENT.cases[0]
RATES = ["roll_rate", "pitch_rate", "yaw_rate"]
ACCELERATIONS = ["ax", "ay", "az"]
WHEEL_SPEEDS = ["wheel_speed_fl", "wheel_speed_fr", "wheel_speed_rl", "wheel_speed_rr"]
# What `with_noise` gives a sensor at least
FLOORS = dict.fromkeys(ACCELERATIONS, 0.05) | dict.fromkeys(RATES, 0.003)


@pytest.fixture(scope="module")
def clean():
    return CASE.plant.clean(DURATION)


def noisy(seed=0, **changes):
    return replace(CASE, **changes).noisy_drive(seed, DURATION)


def noise(clean, case, seed=0):
    drive = case.noisy_drive(seed, DURATION)
    return {name: drive.channel(name) - clean.channel(name) for name in clean.output_names}


def autocorrelation(values):
    """Of neighbouring samples; the standard deviation by chance of white noise's is 1/sqrt(n)."""
    return np.corrcoef(values[1:], values[:-1])[0, 1]


def test_runs_in_parallel_give_the_numbers_of_one_process_to_the_bit():
    todo = runs(mass.EXPERIMENT, range(2), DURATION, cases=mass.EXPERIMENT.table)
    assert len(todo) == 10  # two estimators; one noiseless and two noisy cases
    serial = parallel(score, todo, 1, "serial")
    assert parallel(score, todo, 2, "parallel") == serial
    backwards = parallel(score, todo[::-1], 1, "backwards")
    assert backwards[::-1] == serial


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda one: one.name)
def test_run_twice_gives_the_same_numbers_and_another_seed_others(experiment):
    one, other = runs(experiment, range(2), DURATION)[:2]
    first = score(one)
    assert score(one) == first
    assert score(other) != first


@pytest.mark.parametrize("snr", [5.0, 20.0])
def test_sensors_have_the_ratio_of_signal_to_noise(clean, snr):
    noises = noise(clean, replace(CASE, snr=snr))
    for name, floor in FLOORS.items():
        ratio = 20.0 * np.log10(clean.channel(name).std() / noises[name].std())
        most = 20.0 * np.log10(max(clean.channel(name).std(), 1e-12) / floor)
        assert ratio == pytest.approx(min(snr, most), abs=0.4)
        assert abs(autocorrelation(noises[name])) < 4.0 / np.sqrt(len(clean))
    assert clean.channel("pitch_rate").std() > FLOORS["pitch_rate"] * 10.0 ** (5.0 / 20.0)
    for name in WHEEL_SPEEDS:
        assert noises[name].std() == pytest.approx(0.05, rel=0.05)


def test_noise_on_accelerations_is_white_and_the_rates_are_its_integral(clean):
    noises = noise(clean, replace(CASE, noise_on="accelerations"))
    for name in RATES:
        acceleration = np.diff(noises[name]) / clean.dt
        signal = np.gradient(clean.channel(name), clean.dt)
        assert acceleration.std() == pytest.approx(signal.std() / np.sqrt(10.0), rel=0.05)
        assert abs(autocorrelation(acceleration)) < 4.0 / np.sqrt(len(clean))
        assert autocorrelation(noises[name]) > 0.9


def test_noise_on_accelerations_leaves_the_other_sensors_as_they_are(clean):
    on_rates = noise(clean, CASE)
    on_accelerations = noise(clean, replace(CASE, noise_on="accelerations"))
    for name in ACCELERATIONS + WHEEL_SPEEDS:
        np.testing.assert_array_equal(on_accelerations[name], on_rates[name])


def test_noise_on_the_road_changes_nothing_but_the_known_road(clean):
    drive = noisy(snr=INFINITE, road_noise=0.1, seed=1)
    np.testing.assert_array_equal(drive.measurements, clean.measurements)
    np.testing.assert_array_equal(drive.inputs[:, :9], clean.inputs[:, :9])
    assert drive.truth.keys() == clean.truth.keys()
    for name, values in clean.truth.items():
        np.testing.assert_array_equal(drive.truth[name], values)


def test_noise_on_the_road_is_a_factor_that_the_rear_wheels_meet_later(clean):
    drive = noisy(snr=INFINITE, road_noise=0.1, seed=1)
    with np.errstate(invalid="ignore"):  # zero road at the start
        factor = drive.inputs[:, 9:13] / clean.inputs[:, 9:13]
    front_left, front_right, rear_left, rear_right = factor.T
    wheelbase = Twin(Vehicle.load(CASE.twin)).car.wheelbase
    lag = round(wheelbase / clean.truth["vx"][0] / clean.dt)
    late = slice(2 * lag, None)
    assert np.abs(factor[late] - 1.0).max() == pytest.approx(0.1, rel=0.01)
    assert factor[late].std() == pytest.approx(0.1 / np.sqrt(3.0), rel=0.05)
    np.testing.assert_allclose(front_left[late], front_right[late], rtol=1e-12)
    np.testing.assert_allclose(rear_left[late], rear_right[late], rtol=1e-12)
    np.testing.assert_allclose(rear_left[late], front_left[lag:-lag], rtol=1e-12)


def test_case_without_any_noise_leaves_the_drive_alone(clean):
    same = noisy(snr=INFINITE, seed=3)
    np.testing.assert_array_equal(same.measurements, clean.measurements)
    np.testing.assert_array_equal(same.inputs, clean.inputs)


def test_rows_name_case_parameter_and_estimator_beside_the_paper_and_the_bound():
    found = rows(runs(mass.EXPERIMENT, range(2), DURATION), 1, "")
    found = [row for row in found if row.metric == "rms_pct"]
    bound = limit(mass.EXPERIMENT, mass.EXPERIMENT.cases[0], DURATION)["mass", "rms_pct"]
    assert [(row.case, row.quantity, row.estimator, row.seeds) for row in found] == [
        ("noisy, correct CM", "mass", "til", 2),
        ("noisy, correct CM", "mass", "til-paper", 2),
    ]
    assert [(row.paper, row.limit, row.unit) for row in found] == [(1.61, bound, "%")] * 2


def test_rows_summarise_the_scores_of_their_runs():
    todo = runs(mass.EXPERIMENT, range(3), DURATION)
    found = rows(todo, 1, "")
    for estimator in mass.EXPERIMENT.estimators:
        own = [score(run)[0] for run in todo if run.estimator == estimator]
        medians = {row.metric: row.median for row in found if row.estimator == estimator}
        for i, metric in enumerate(("rms_pct", "time_to_10pct")):
            assert medians[metric] == np.median([scores[i].value for scores in own])
        rms = np.sqrt(np.mean([scores[0].value ** 2 for scores in own]))
        bound = next(row.limit for row in found if row.limit)
        assert medians["rms_over_limit"] == pytest.approx(rms / bound)


def test_noiseless_case_needs_one_seed_only():
    todo = runs(mass.EXPERIMENT, range(5), DURATION, cases=mass.EXPERIMENT.table[:1])
    assert {row.seeds for row in rows(todo, 1, "")} == {1}


@pytest.mark.parametrize(
    ("snr", "name"),
    [
        (None, "noisy, correct CM"),
        (10.0, "noisy, correct CM"),
        (INFINITE, "noiseless, correct CM"),
        (5.0, "noisy, correct CM, SNR 5 dB"),
    ],
)
def test_case_at_another_noise_is_the_papers_where_it_has_one(snr, name):
    (case,) = mass.EXPERIMENT.at(snr)
    assert case.name == name
    assert case.snr == (snr or 10.0)
    assert bool(case.paper) == ("SNR" not in name)


def test_what_is_estimated_is_not_told():
    case = mass.EXPERIMENT.cases[0]
    assert "mass" in case.knows
    assert set(case.told(["mass"])) == set(case.knows) - {"mass"}
    _, _, estimate = observe(runs(mass.EXPERIMENT, [0], 1.0)[0])
    assert estimate["mass"][0] == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize(
    "change",
    [
        {"snr": INFINITE},
        {"noise_on": "accelerations"},
        {"road_noise": 0.1},
        {"knows": MASS},
        {"knows": ()},
    ],
    ids=str,
)
def test_bound_is_left_out_where_it_says_nothing(change):
    case = replace(roll_yaw.EXPERIMENT.cases[0], **change)
    assert limit(roll_yaw.EXPERIMENT, case, DURATION) == {}


def test_bound_is_in_proportion_to_the_noise():
    low, high = (
        limit(mass.EXPERIMENT, replace(mass.EXPERIMENT.cases[0], snr=snr), DURATION)
        for snr in (0.0, 6.0206)
    )
    key = "mass", "rms_pct"
    assert low[key] == pytest.approx(2.0 * high[key], rel=1e-3)


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda one: one.name)
def test_every_law_corrects_what_the_load_changes(experiment):
    for recipe in experiment.estimators.values():
        assert tuple(law.parameter for law in recipe.laws) == experiment.quantities
    for case in experiment.table:
        assert all(abs(case.load()[name]) > 0.0 for name in experiment.quantities)
        assert {name for name, _ in case.paper} <= set(experiment.quantities)


@pytest.mark.parametrize(
    ("experiment", "estimator", "message"),
    [
        (mass, "best", "mass: estimator is 'best'; allowed: til, til-paper, "),
        (mass, "kalman-bucy", "mass: has no measurement of .*, which kalman-bucy needs"),
        (mass, "static-map", "estimator static-map: lacks model"),
        (mass, "zero", "mass: zero estimates nothing that this scenario scores: mass"),
    ],
)
def test_estimator_that_a_scenario_does_not_suffice_for_is_told_why(experiment, estimator, message):
    with pytest.raises(TwinError, match=message):
        run_experiment(experiment.EXPERIMENT, seeds=[0], duration=1.0, estimators=[estimator])


@pytest.mark.parametrize("estimator", ["joint", "staged", "til", "til-paper", "unscented"])
def test_estimator_of_the_registry_runs_on_a_scenario_that_does_not_name_it(estimator):
    result = run_experiment(mass.EXPERIMENT, seeds=[0], duration=1.0, estimators=[estimator])
    assert {row.estimator for row in result.rows} == {estimator}
    assert "rms_pct" in {row.metric for row in result.rows}
