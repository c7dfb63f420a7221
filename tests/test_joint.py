from dataclasses import replace

import numpy as np
import pytest

from estimators.identifiability.report import report
from estimators.joint.observer import JointObserver, JointSettings
from scenarios import load_change, mixed, straight
from scenarios.experiment import joint
from scenarios.experiment.engine import observe, run_experiment, runs, score
from scenarios.experiment.experiment import Trial
from scenarios.experiment.metrics import errors_at_end, true_deltas
from twin import LOAD, OUTPUTS, PARAMETERS, Ensemble, Twin, TwinError, Vehicle, noise_sd
from twin.kernel import read_states, step

SD = np.array([0.5] * 3 + [0.02] * 3 + [0.05] * 4)
SEVEN = LOAD[:7]
CASE = mixed.EXPERIMENT.cases[0]


@pytest.fixture(scope="module")
def drive():
    return CASE.plant.clean(12.0)


def observer(drive, *, at=None, **settings):
    made = JointObserver(Vehicle.load("suv"), SD, JointSettings(**settings))
    made.reset(float(drive.truth["vx"][0]), at, road=drive.inputs[0, 9:13])
    return made


def part(drive, samples):
    return drive.replace(
        time=drive.time[samples],
        inputs=drive.inputs[samples],
        measurements=drive.measurements[samples],
        truth={},
    )


def test_cars_of_an_ensemble_are_those_of_its_twins():
    ensemble, alone = Ensemble(Vehicle.load("suv"), 2), Twin(Vehicle.load("suv"))
    u, y, expected = np.zeros(13), np.empty(10), np.empty(10)
    for twin in (*ensemble.twins, alone):
        twin.reset(10.0)
    u[0] = 0.5
    for _ in range(100):
        step(ensemble.cars[1], u, y)
        step(alone.car, u, expected)
    np.testing.assert_array_equal(y, expected)
    np.testing.assert_array_equal(ensemble.twins[1].read_states(), alone.read_states())
    assert ensemble.twins[0].data.time == 0.0


def test_parameters_at_the_truth_stay_there(drive):
    run = observer(drive, at=CASE.load()).run(drive)
    truth = true_deltas(Trial(runs(mixed.EXPERIMENT, [0])[0], drive, run))
    for name in joint.NAMES:
        assert abs(run[name][-1] - truth[name][-1]) < 0.05 * run.sd_of(name)[-1], name


def test_the_load_is_found_without_noise(drive):
    run = observer(drive, parameters=LOAD, sensor_errors=()).run(drive)
    for name in SEVEN:
        assert run[name][-1] == pytest.approx(CASE.load()[name], rel=0.02), name


def test_shifted_states_are_those_of_a_twin_that_always_had_the_parameter(drive):
    """To first order: twice the step leaves four times as much."""
    masses = (0.0, 0.1, 40.0, 80.0)
    states, y = np.empty((len(masses), 28)), np.empty(10)
    for mass, x in zip(masses, states, strict=True):
        twin = Twin(Vehicle.load("suv"))
        p = np.zeros(len(PARAMETERS))
        p[0] = mass
        twin.set_parameters(p)
        twin.reset(float(drive.truth["vx"][0]))
        for u in drive.inputs[:4000]:
            step(twin.car, np.ascontiguousarray(u), y)
        read_states(twin.car, x)
    kept = [2, *range(6, 10), *range(14, 28)]  # no place, heading or wheel angle
    slope = (states[1] - states[0]) / masses[1]
    left = [
        np.linalg.norm((x - states[0] - m * slope)[kept])
        for m, x in zip(masses, states, strict=True)
    ]
    assert left[3] / left[2] == pytest.approx(4.0, rel=0.1)
    assert left[2] < 0.03 * np.linalg.norm((states[2] - states[0])[kept])


def test_one_sample_at_a_time_gives_the_run(drive):
    short = part(drive, slice(0, 1500))
    whole = observer(drive, parameters=("mass", "Jzz")).run(short)
    other = observer(drive, parameters=("mass", "Jzz"))
    for u, y in zip(short.inputs, short.measurements, strict=True):
        last = other.update(u, y)
    np.testing.assert_array_equal(last, whole.parameters[-1])


def test_run_from_a_snapshot_is_bit_exact(drive):
    first, second = part(drive, slice(0, 1505)), part(drive, slice(1505, 3000))
    made = observer(drive, parameters=("mass", "Jzz"))
    made.run(first)
    snapshot = made.snapshot()
    expected = made.run(second)
    made.restore(snapshot)
    again = made.run(second)
    np.testing.assert_array_equal(again.parameters, expected.parameters)
    np.testing.assert_array_equal(again.covariance, expected.covariance)


def test_missing_measurements_do_not_spoil_the_estimate(drive):
    y = drive.measurements.copy()
    y[3000:6000, 0] = np.nan
    y[5000:5500] = np.nan
    run = observer(drive, parameters=SEVEN, at=CASE.load()).run(drive.replace(measurements=y))
    assert np.isfinite(run.parameters).all()
    assert abs(run["mass"][-1] - CASE.load()["mass"]) < 3.0


def test_steady_straight_drive_changes_nothing_and_identifies_nothing():
    case = joint.case("straight", "imu-bias")
    _, _, estimate = observe(runs(straight.EXPERIMENT, [0], 6.0, cases=[case])[0])
    assert not estimate.parameters.any()
    speed = estimate.estimated.index("speed")  # which the twins follow
    assert not np.delete(estimate.valid, speed, axis=1).any()
    told = report(estimate)
    assert (
        "this drive does not identify the yaw inertia (100 % of the uncertainty is left): "
        in " ".join(told)
    )
    assert len(told) >= len(joint.NAMES)


def test_delay_and_bias_of_the_sensors_are_found(drive):
    sd = noise_sd(drive.measurements, 10.0)
    y = np.roll(drive.measurements, 20, axis=0)
    y[:20] = drive.measurements[0]
    y[:, OUTPUTS.index("ay")] += 0.1
    made = JointObserver(Vehicle.load("suv"), sd, JointSettings(parameters=("mass",)))
    made.reset(float(drive.truth["vx"][0]), CASE.load())
    run = made.run(drive.replace(measurements=y))
    assert run["delay"][-1] == pytest.approx(0.02, abs=2e-4)
    assert run["bias_ay"][-1] == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"parameters": ("mass", "colour")}, "parameters are mass, colour; allowed: each at most"),
        (
            {"sensor_errors": ("delay", "delay")},
            "sensor_errors are delay, delay; allowed: each at most once",
        ),
        ({"tracking_time": 0.0}, "tracking_time is 0.0; allowed: above 0, finite"),
        ({"slip_range": np.nan}, "slip_range is nan; allowed: above 0, finite"),
        ({"block": 0}, "block is 0; allowed: a whole number, 1 or more"),
        ({"block": 2.5}, "block is 2.5; allowed: a whole number, 1 or more"),
        ({"curvature": -1.0}, "curvature is -1.0; allowed: 0 or more, finite"),
        ({"prior_sd": {"mass": 0.0}}, "prior_sd of mass is 0.0; allowed: above 0"),
        ({"prior_sd": {"weight": 1.0}}, "prior_sd are weight; allowed: each at most once"),
    ],
)
def test_settings_that_cannot_be_are_refused(settings, message):
    with pytest.raises(TwinError, match=message):
        JointSettings(**settings)


def test_noise_of_nothing_is_refused():
    with pytest.raises(TwinError, match="allowed: 10 numbers above zero"):
        JointObserver(Vehicle.load("suv"), np.zeros(10), JointSettings(parameters=("mass",)))


def test_rows_hold_error_claim_and_validity_of_every_parameter():
    rows = run_experiment(mixed.EXPERIMENT, seeds=[0], duration=3.0).rows
    found = {(row.quantity, row.metric): row.median for row in rows}
    for name in joint.NAMES:
        error, sd = found[name, "pct"], found[name, "claimed_sd_pct"]
        assert found[name, "rmse_over_sd"] == pytest.approx(error / sd)
        assert found[name, "valid"] in (0.0, 1.0)


def test_coverage_is_the_share_of_errors_within_two_standard_deviations(drive):
    run = runs(mixed.EXPERIMENT, [0])[0]
    found = observer(drive).run(drive)
    truth = true_deltas(Trial(run, drive, found))
    sd = np.ones_like(found.sd)
    parameters = found.parameters.copy()
    for k, name in enumerate(joint.NAMES):  # every other one is off by three standard deviations
        parameters[-1, PARAMETERS.index(name)] = truth[name][-1] + (3.0 if k % 2 else 1.0)
    scores = errors_at_end(Trial(run, drive, replace(found, sd=sd, parameters=parameters)))
    coverage = next(s.value for s in scores if s.metric == "coverage")
    assert coverage == pytest.approx(np.mean([k % 2 == 0 for k in range(len(joint.NAMES))]))


@pytest.mark.slow
def test_change_of_load_is_found_and_nothing_else_thrown_off():
    scores, _ = score(runs(load_change.EXPERIMENT, [0])[0])
    found = {(s.quantity, s.metric): s.value for s in scores}
    assert found["load", "found_after"] < 20.0
    assert found["others", "worst_over_sd"] < 3.0
    assert found["mass", "pct"] < 3.0 / 355.0 * 100.0
