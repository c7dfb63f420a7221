from dataclasses import replace

import numpy as np
import pytest

from estimators.benchmarks.kalman_bucy import (
    CHANNELS,
    DEFLECTIONS,
    RATES,
    KalmanBucy,
    KalmanBucySettings,
    detecting,
    matched,
)
from twin import Drive, TruckParameters, TwinError
from twin.road import iso8608_road
from twin.truck import model
from twin.truck.model import LoadStage, Truck
from twin.truck.parameters import SprungMass

DT = 1e-3
NOMINAL = TruckParameters().nominal.parameters
SENSORS = (1e-3, 1e-4, 1e-4)
PARAMETRISATIONS = ("p", "1/p", "log p")


def record(seconds=3.0, seed=0, stages=(), gravity=0.0):
    distance = 15 * DT * np.arange(round(seconds / DT))
    road = iso8608_road(np.random.default_rng(seed), length=150, coherence_decay=np.inf)
    heights = road.wheel_heights(distance, TruckParameters().wheelbase)
    return Truck(gravity=gravity).record(heights, stages)


def measured(run, seed=0):
    return run.rates + np.array(SENSORS) * np.random.default_rng(seed).normal(size=run.rates.shape)


def as_drive(run, rates, deflections=None, every=slice(None)):
    """What the filter sees of a run."""
    seen = run.deflections if deflections is None else deflections
    return Drive(
        time=run.time[every],
        inputs=np.zeros((len(run.time[every]), 1)),
        input_names=("none",),
        measurements=np.hstack([rates, seen])[every],
        output_names=CHANNELS,
    )


def run_filter(run, rates, settings=None, dt=DT):
    every = slice(None, None, round(dt / DT))
    return KalmanBucy(TruckParameters(), dt, settings).run(as_drive(run, rates, every=every))


def absolute(found):
    return found.nominal + found.parameters


@pytest.fixture(scope="module")
def drive():
    return record(stages=[LoadStage(2.0, SprungMass().scaled(1.5))])


@pytest.mark.parametrize("parametrisation", PARAMETRISATIONS)
def test_every_parametrisation_finds_the_load_before_and_after_a_step(drive, parametrisation):
    settings = replace(matched(SENSORS, DT), parametrisation=parametrisation)
    found = run_filter(drive, measured(drive), settings)
    for k in (1999, 2999):
        np.testing.assert_allclose(absolute(found)[k], drive.parameters[k], rtol=0.05)


@pytest.mark.parametrize(
    "settings",
    [
        KalmanBucySettings(),
        detecting(matched(SENSORS, DT)),
        replace(matched(SENSORS, DT), parametrisation="log p"),
    ],
)
def test_sample_by_sample_equals_the_whole_drive_to_the_bit(drive, settings):
    rates = measured(drive)
    seen = as_drive(drive, rates)
    run = KalmanBucy(TruckParameters(), DT, settings).run(seen)
    streaming = KalmanBucy(TruckParameters(), DT, settings)
    for k in range(500):
        one = streaming.update(seen.inputs[k], seen.measurements[k])
        np.testing.assert_allclose(one, run.parameters[k], rtol=1e-12, atol=1e-9)
        np.testing.assert_array_equal(streaming.state.mean[:, 0], run.states[k])


def test_reset_and_a_second_run_forget_the_first(drive):
    observer = KalmanBucy(TruckParameters(), DT, detecting(matched(SENSORS, DT)))
    seen = as_drive(drive, measured(drive))
    first = observer.run(seen)
    again = observer.run(seen)
    np.testing.assert_array_equal(first.parameters, again.parameters)
    observer.reset()
    np.testing.assert_array_equal(observer.update(seen.inputs[0], seen.measurements[0]), NOMINAL)
    observer.reset(parameters={"mass": 100.0})
    fresh = observer.update(seen.inputs[0], seen.measurements[0])
    np.testing.assert_allclose(fresh, [100.0, 0.0, 0.0], atol=1e-9)


def test_channels_are_those_of_the_truck():
    assert (RATES, DEFLECTIONS) == (model.RATES, model.DEFLECTIONS)


def textbook_filter(run, rates, settings):
    """The linear Kalman filter of v' = F s, in matrices and as the textbooks write it."""
    force = run.deflections @ TruckParameters().excitation().T / NOMINAL
    out = np.empty(rates.shape)
    for axis in range(3):
        r = settings.measurement_density[axis] / DT
        q_v, q = settings.velocity_density, settings.parameter_density
        x, p = np.array([rates[0, axis], 0.5]), np.diag([r, 0.25])
        out[0, axis] = x[1]
        for k in range(1, len(rates)):
            h = (force[k - 1, axis] + force[k, axis]) / 2
            phi = np.array([[1, h * DT], [0, 1]])
            noise = np.array(
                [[q_v * DT + h**2 * q * DT**3 / 3, h * q * DT**2 / 2], [h * q * DT**2 / 2, q * DT]]
            )
            x, p = phi @ x, phi @ p @ phi.T + noise
            gain = p[:, 0] / (p[0, 0] + r)
            x = x + gain * (rates[k, axis] - x[0])
            p = p - np.outer(gain, p[0])
            out[k, axis] = x[1]
    return NOMINAL / out


@pytest.mark.parametrize("settings", [KalmanBucySettings(), matched(SENSORS, DT)])
def test_inverse_mass_filter_is_the_textbook_kalman_filter(drive, settings):
    rates = measured(drive)
    found = run_filter(drive, rates, settings)
    expected = textbook_filter(drive, rates, settings)
    np.testing.assert_allclose(absolute(found), expected, rtol=1e-6)


def drifting_load(rng, q, seconds, hold):
    """Stages whose 1/p walks as the filter believes: each axis on its own."""
    count = round(seconds / hold)
    inverse = 1 + np.cumsum(np.sqrt(q * hold) * rng.normal(size=(count, 3)), axis=0)
    stages = []
    for k, (m, jx, jy) in enumerate(NOMINAL / inverse):
        load = SprungMass(mass=m, roll_inertia=jx, pitch_inertia=jy)
        stages.append(LoadStage(k * hold, load))
    return stages


def test_covariance_is_honest_about_a_load_that_drifts_as_assumed():
    q, squares = 1e-3, []
    for seed in range(6):
        stages = drifting_load(np.random.default_rng(seed), q, 4.0, 0.02)
        run = record(4.0, seed, stages)
        settings = replace(matched(SENSORS, DT, parameter_density=q), velocity_density=1e-9)
        found = run_filter(run, measured(run, seed), settings)
        error = (absolute(found) - run.parameters) / found.sd
        rate_error = (found.states - run.rates) / found.states_sd
        squares.append(np.concatenate([error[1000:], rate_error[1000:]], axis=1) ** 2)
    nees = np.mean(squares, axis=(0, 1))
    assert nees.min() > 0.6
    assert nees.max() < 1.6


def test_a_constant_load_is_estimated_better_than_the_drift_allowed_for():
    run = record(3.0)
    found = run_filter(run, measured(run), matched(SENSORS, DT))
    error = np.abs(absolute(found) - run.parameters) / found.sd
    assert (error[1000:] < 3).mean() > 0.99


def test_gravity_aware_filter_weighs_the_load():
    run = record(4.0, stages=[LoadStage(2.0, SprungMass().scaled(1.5))], gravity=9.81)
    found = run_filter(run, measured(run), KalmanBucySettings(gravity=9.81))
    error = np.abs(absolute(found) / run.parameters - 1)[:, 0]
    assert error.mean() < 0.01
    assert error[2015:].max() < 0.1
    unaware = run_filter(run, measured(run))
    assert np.abs(absolute(unaware) / run.parameters - 1)[3000:, 0].mean() > 0.5


def test_detection_finds_a_load_change_sooner(drive):
    slow = matched(SENSORS, DT, parameter_density=1e-5)
    late = {}
    for name, settings in (("plain", slow), ("sharp", detecting(slow, robust=False))):
        found = run_filter(drive, measured(drive), settings)
        wrong = np.abs(absolute(found) / drive.parameters - 1)[2000:] > 0.1
        late[name] = wrong.sum(axis=0) * DT
    assert (late["sharp"] < 0.1).all()
    assert (late["plain"] > 2 * late["sharp"]).all()


def test_filter_stays_sound_at_ten_milliseconds(drive):
    every = slice(0, 2000, 10)
    found = KalmanBucy(TruckParameters(), 0.01).run(as_drive(drive, measured(drive), every=every))
    np.testing.assert_allclose(absolute(found)[-50:].mean(axis=0), NOMINAL, rtol=0.1)


def test_estimates_stay_within_the_bounds(drive):
    noise = np.random.default_rng(0).normal(size=drive.rates.shape)
    found = run_filter(drive, noise)
    assert (absolute(found) >= 0.05 * NOMINAL * (1 - 1e-12)).all()
    assert (absolute(found) <= 20 * NOMINAL * (1 + 1e-12)).all()


def test_a_missing_channel_is_named(drive):
    observer = KalmanBucy(TruckParameters(), DT)
    seen = as_drive(drive, drive.rates)
    with pytest.raises(TwinError, match="deflection_rate_rr"):
        observer.run(
            seen.replace(measurements=seen.measurements[:, :-1], output_names=CHANNELS[:-1])
        )
    with pytest.raises(TwinError, match=r"measurements: shape \(10,\), must be \(11,\)"):
        observer.update(seen.inputs[0], seen.measurements[0, :-1])


def test_a_value_that_is_not_finite_is_located(drive):
    spoilt = drive.deflections.copy()
    spoilt[7, 2] = np.nan
    observer = KalmanBucy(TruckParameters(), DT)
    with pytest.raises(TwinError, match="deflection_rl: nan in sample 7"):
        observer.run(as_drive(drive, drive.rates, spoilt))
    with pytest.raises(TwinError, match="vz: inf, must be finite"):
        observer.update([0.0], [np.inf, *np.zeros(10)])


def test_a_missing_sample_is_located(drive):
    keep = np.delete(np.arange(3000), 1234)
    with pytest.raises(TwinError, match=r"1.235 s follows 1.233 s"):
        KalmanBucy(TruckParameters(), DT).run(as_drive(drive, drive.rates, every=keep))


@pytest.mark.parametrize("sample_time", [0.0, -1e-3, 0.05, np.nan])
def test_an_impossible_sample_time_is_refused(sample_time):
    with pytest.raises(TwinError, match="sample_time"):
        KalmanBucy(TruckParameters(), sample_time)


@pytest.mark.parametrize(
    "bad",
    [
        {"parametrisation": "p^2"},
        {"measurement_density": (0.0, 1.0, 1.0)},
        {"velocity_density": -1.0},
        {"parameter_density": np.nan},
        {"start": (0.01, 1, 1)},
        {"start_deviation": 0.0},
        {"bounds": (2.0, 1.0)},
        {"gate": 0.0},
        {"window": 0},
        {"gravity": -9.81},
    ],
)
def test_impossible_settings_are_refused_by_name(bad):
    with pytest.raises(TwinError, match=next(iter(bad))):
        KalmanBucySettings(**bad)
