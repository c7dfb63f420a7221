from dataclasses import replace

import numpy as np
import pytest

from scenarios import mass, pitch, roll_yaw
from scenarios.experiment.progress import parallel
from scenarios.experiment.study import (
    INFINITE,
    MASS,
    TWIN,
    Case,
    limit,
    noisy_drive,
    real_drive,
    rows,
    runs,
    score,
    variation,
)
from twin import Twin, Vehicle

DURATION = 5.0
STUDIES = [mass.STUDY, roll_yaw.STUDY, pitch.STUDY]
RATES = ["roll_rate", "pitch_rate", "yaw_rate"]
ACCELERATIONS = ["ax", "ay", "az"]
WHEEL_SPEEDS = ["wheel_speed_fl", "wheel_speed_fr", "wheel_speed_rl", "wheel_speed_rr"]
# What `with_noise` gives a sensor at least
FLOORS = dict.fromkeys(ACCELERATIONS, 0.05) | dict.fromkeys(RATES, 0.003)


@pytest.fixture(scope="module")
def clean():
    return real_drive("scenarios.pitch:STUDY", DURATION)


def noise(clean, case, seed=0):
    noisy = noisy_drive(clean, case, seed)
    return {name: noisy.channel(name) - clean.channel(name) for name in clean.output_names}


def autocorrelation(values):
    """Of neighbouring samples; the standard deviation by chance of white noise's is 1/sqrt(n)."""
    return np.corrcoef(values[1:], values[:-1])[0, 1]


def test_runs_in_parallel_give_the_numbers_of_one_process_to_the_bit():
    todo = runs(mass.STUDY, mass.STUDY.cases, range(2), DURATION)
    assert len(todo) == 10  # two estimators; one noiseless and two noisy cases
    serial = parallel(score, todo, 1, "serial")
    assert parallel(score, todo, 2, "parallel") == serial
    backwards = parallel(score, todo[::-1], 1, "backwards")
    assert backwards[::-1] == serial


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_run_twice_gives_the_same_numbers_and_another_seed_others(study):
    case = next(case for case in study.cases if case.is_random)
    one, other = runs(study, [case], range(2), DURATION)[:2]
    first = score(one)
    real_drive.cache_clear()
    assert score(one) == first
    assert score(other) != first


@pytest.mark.parametrize("snr", [5.0, 20.0])
def test_sensors_have_the_ratio_of_signal_to_noise(clean, snr):
    noises = noise(clean, Case(name="noisy", snr=snr))
    for name, floor in FLOORS.items():
        ratio = 20.0 * np.log10(clean.channel(name).std() / noises[name].std())
        most = 20.0 * np.log10(max(clean.channel(name).std(), 1e-12) / floor)
        assert ratio == pytest.approx(min(snr, most), abs=0.4)
        assert abs(autocorrelation(noises[name])) < 4.0 / np.sqrt(len(clean))
    assert clean.channel("pitch_rate").std() > FLOORS["pitch_rate"] * 10.0 ** (5.0 / 20.0)
    for name in WHEEL_SPEEDS:
        assert noises[name].std() == pytest.approx(0.05, rel=0.05)


def test_noise_on_accelerations_is_white_and_the_rates_are_its_integral(clean):
    noises = noise(clean, Case(name="noisy", snr=10.0, noise_on="accelerations"))
    for name in RATES:
        acceleration = np.diff(noises[name]) / clean.dt
        signal = np.gradient(clean.channel(name), clean.dt)
        assert acceleration.std() == pytest.approx(signal.std() / np.sqrt(10.0), rel=0.05)
        assert abs(autocorrelation(acceleration)) < 4.0 / np.sqrt(len(clean))
        assert autocorrelation(noises[name]) > 0.9


def test_noise_on_accelerations_leaves_the_other_sensors_as_they_are(clean):
    on_rates = noise(clean, Case(name="noisy", snr=10.0))
    on_accelerations = noise(clean, Case(name="noisy", snr=10.0, noise_on="accelerations"))
    for name in ACCELERATIONS + WHEEL_SPEEDS:
        np.testing.assert_array_equal(on_accelerations[name], on_rates[name])


def test_noise_on_the_road_changes_nothing_but_the_known_road(clean):
    noisy = noisy_drive(clean, Case(name="noisy road", snr=INFINITE, road_noise=0.1), seed=1)
    np.testing.assert_array_equal(noisy.measurements, clean.measurements)
    np.testing.assert_array_equal(noisy.inputs[:, :9], clean.inputs[:, :9])
    assert noisy.truth.keys() == clean.truth.keys()
    for name, values in clean.truth.items():
        np.testing.assert_array_equal(noisy.truth[name], values)


def test_noise_on_the_road_is_a_factor_that_the_rear_wheels_meet_later(clean):
    noisy = noisy_drive(clean, Case(name="noisy road", snr=INFINITE, road_noise=0.1), seed=1)
    with np.errstate(invalid="ignore"):  # zero road at the start
        factor = noisy.inputs[:, 9:13] / clean.inputs[:, 9:13]
    front_left, front_right, rear_left, rear_right = factor.T
    wheelbase = Twin(Vehicle.load(TWIN)).car.wheelbase
    lag = round(wheelbase / clean.truth["vx"][0] / clean.dt)
    late = slice(2 * lag, None)
    assert np.abs(factor[late] - 1.0).max() == pytest.approx(0.1, rel=0.01)
    assert factor[late].std() == pytest.approx(0.1 / np.sqrt(3.0), rel=0.05)
    np.testing.assert_allclose(front_left[late], front_right[late], rtol=1e-12)
    np.testing.assert_allclose(rear_left[late], rear_right[late], rtol=1e-12)
    np.testing.assert_allclose(rear_left[late], front_left[lag:-lag], rtol=1e-12)


def test_case_without_any_noise_leaves_the_drive_alone(clean):
    same = noisy_drive(clean, Case(name="noiseless", snr=INFINITE), seed=3)
    np.testing.assert_array_equal(same.measurements, clean.measurements)
    np.testing.assert_array_equal(same.inputs, clean.inputs)


def test_rows_name_case_parameter_and_estimator_beside_the_paper_and_the_bound():
    study, case = mass.STUDY, mass.STUDY.cases[1]
    found = [row for row in rows(study, [case], range(2), 1, DURATION) if row.metric == "rms_pct"]
    bound = limit(study, case, study.laws["til"][0], DURATION)
    assert bound is not None
    assert [(row.case, row.quantity, row.estimator, row.seeds) for row in found] == [
        ("noisy, correct CM", "mass", "til", 2),
        ("noisy, correct CM", "mass", "til-paper", 2),
    ]
    assert [(row.paper, row.limit, row.unit) for row in found] == [(1.61, bound, "%")] * 2


def test_rows_summarise_the_scores_of_their_runs():
    study, case = mass.STUDY, mass.STUDY.cases[1]
    found = rows(study, [case], range(3), 1, DURATION)
    for estimator in study.laws:
        todo = [
            run for run in runs(study, [case], range(3), DURATION) if run.estimator == estimator
        ]
        errors, times = zip(*(score(run)[0] for run in todo), strict=True)
        medians = {row.metric: row.median for row in found if row.estimator == estimator}
        assert medians["rms_pct"] == np.median(errors)
        assert medians["time_to_10pct"] == np.median(times)


def test_noiseless_case_needs_one_seed_only():
    found = rows(mass.STUDY, mass.STUDY.cases[:1], range(5), 1, DURATION)
    assert {row.seeds for row in found} == {1}


@pytest.mark.parametrize(
    "change",
    [
        {"snr": INFINITE},
        {"noise_on": "accelerations"},
        {"road_noise": 0.1},
        {"known": MASS},
        {"known": ()},
    ],
    ids=str,
)
def test_bound_is_left_out_where_it_says_nothing(change):
    case = replace(Case(name="noisy", snr=10.0), **change)
    assert limit(roll_yaw.STUDY, case, roll_yaw.STUDY.laws["til"][0], DURATION) is None


def test_bound_is_in_proportion_to_the_noise():
    law = mass.STUDY.laws["til"][0]
    low, high = (
        limit(mass.STUDY, Case(name="noisy", snr=snr), law, DURATION) for snr in (0.0, 6.0206)
    )
    assert low == pytest.approx(2.0 * high, rel=1e-3)


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_every_law_of_a_study_corrects_what_its_load_changes(study):
    for laws in study.laws.values():
        assert tuple(law.parameter for law in laws) == study.parameters
    assert all(abs(variation()[name]) > 0.0 for name in study.parameters)
    for case in study.cases:
        assert {name for name, _ in case.paper} <= set(study.parameters)
