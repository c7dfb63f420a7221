import dataclasses

import numpy as np
import pytest

from estimators.til.observer import Observer
from scenarios import mass
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import record
from scenarios.experiment.experiment import CM
from twin import OUTPUTS, PARAMETERS, STATES, Twin, TwinError, Vehicle, with_noise

DURATION = 12.0
LAWS = {name: recipe.laws for name, recipe in mass.EXPERIMENT.estimators.items()}
(TIL,), (PAPER,) = LAWS.values()


@pytest.fixture(scope="module")
def clean():
    return record(Vehicle.load("suv_loaded"), urban(duration=DURATION))


@pytest.fixture(scope="module")
def drive(clean):
    return with_noise(clean, 10.0, np.random.default_rng(7))


def observer(*laws, gains=None):
    return Observer(Twin(Vehicle.load("suv")), laws, gains)


def known():
    return {name: mass.EXPERIMENT.cases[0].load()[name] for name in CM}


def test_twin_that_knows_the_load_repeats_the_vehicle(clean):
    open_loop = observer()
    open_loop.reset(0.0, mass.EXPERIMENT.cases[0].load())
    estimate = open_loop.run(clean)
    np.testing.assert_allclose(estimate.outputs, clean.measurements, atol=1e-9)
    truth = np.column_stack([clean.truth[name] for name in STATES])
    np.testing.assert_allclose(estimate.states, truth, atol=1e-9)


@pytest.mark.parametrize("law", list(LAWS))
def test_each_mass_law_converges_without_noise(clean, law):
    til = observer(LAWS[law][0])
    til.reset(0.0, known())
    error = til.run(clean)["mass"] - 355.0
    assert error[0] < -350.0
    assert abs(error[-1]) < {"til": 0.01, "til-paper": 0.6}[law] * 355.0


def test_gain_with_the_printed_sign_would_run_away(clean):
    """A law that adds a - a~ for a > 0, as in print, is ours with a negative gain."""
    til = observer(PAPER)
    til._laws["gain"] *= -1.0
    til.reset(0.0, {**known(), "mass": 200.0})
    assert til.run(clean)["mass"][-1] < 100.0


def test_mass_stays_where_the_twin_is_right(clean):
    til = observer(TIL)
    til.reset(0.0, mass.EXPERIMENT.cases[0].load())
    np.testing.assert_allclose(til.run(clean)["mass"], 355.0, atol=1e-6)


def test_measured_sign_is_biased_by_noise_and_the_twin_is_not(drive):
    """At a = a~ only noise is left: the paper's instrument turns it into a drift."""
    drift = {}
    for instrument in ("measured", "twin"):
        law = dataclasses.replace(PAPER, instrument=instrument, gain=20.0, least_wheel_speed=3.0)
        til = observer(law)
        til.reset(0.0, mass.EXPERIMENT.cases[0].load())
        drift[instrument] = til.run(drive)["mass"][-1] - 355.0
    assert abs(drift["measured"]) > 15.0
    assert abs(drift["twin"]) < 3.0


def test_one_sample_path_and_whole_drive_agree_to_the_bit(drive):
    gains = {("vx", "ax"): 0.1, ("yaw_rate", "yaw_rate"): 5.0}
    whole, single = (observer(TIL, gains=gains) for _ in range(2))
    whole.reset(0.0)
    single.reset(0.0)
    estimate = whole.run(drive)
    for k in range(len(drive)):
        p = single.update(drive.inputs[k], drive.measurements[k])
        if k % 1000 == 0:
            np.testing.assert_array_equal(p, estimate.parameters[k])
    np.testing.assert_array_equal(single.twin.read_states(), whole.twin.read_states())
    np.testing.assert_array_equal(p, estimate.parameters[-1])


def test_reset_forgets_the_drive_before(drive):
    til = observer(TIL)
    runs = []
    for _ in range(2):
        til.reset(0.0, {"mass": 100.0})
        runs.append(til.run(drive).parameters)
    np.testing.assert_array_equal(runs[0], runs[1])


def test_linear_law_pulls_a_state_to_its_measurement(clean):
    """A twin that starts 1 m/s too fast is pulled back by its wheel speeds."""
    slow = dataclasses.replace(TIL, prior_sd=1e-9, drift=0.0)
    gains = {(f"wheel_speed_{w}", f"wheel_speed_{w}"): 50.0 for w in ("fl", "fr", "rl", "rr")}
    error = {}
    for name, k in (("free", None), ("pulled", gains)):
        til = observer(slow, gains=k)
        til.reset(1.0, mass.EXPERIMENT.cases[0].load())
        error[name] = abs(til.run(clean)["vx"][-1] - clean.truth["vx"][-1])
    assert error["pulled"] < 0.2 * error["free"]


def test_gains_mean_the_same_at_half_the_step(tmp_path, clean):
    text = Vehicle.load("suv").source.read_text().replace('timestep="0.001"', 'timestep="0.0005"')
    (tmp_path / "half.xml").write_text(text)
    law = dataclasses.replace(PAPER, instrument="twin")
    ends = []
    for name, dt in (("suv", 0.001), (str(tmp_path / "half.xml"), 0.0005)):
        twin = Vehicle.load(name)
        loads = Vehicle.load("suv_loaded").source.read_text()
        (tmp_path / f"{dt}.xml").write_text(loads.replace('timestep="0.001"', f'timestep="{dt}"'))
        real = record(Vehicle.load(tmp_path / f"{dt}.xml"), urban(dt=dt, duration=6.0))
        til = Observer(Twin(twin), [law])
        til.reset(0.0, known())
        ends.append(til.run(real)["mass"][-1])
    assert abs(ends[0] - ends[1]) < 0.01 * abs(ends[0])


def test_law_rests_while_the_car_stands(drive):
    til = observer(TIL)
    til.reset(0.0)
    standing = drive.truth["vx"] < 0.5
    estimate = til.run(drive)["mass"]
    assert np.ptp(estimate[: np.flatnonzero(~standing)[0]]) == 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameter": "weight"}, "parameter is 'weight'"),
        ({"signal": "vx"}, "signal is 'vx'"),
        ({"instrument": "both"}, "instrument is 'both'"),
        ({"form": "cubic"}, "form is 'cubic'"),
        ({"gain": -1.0}, "gain is -1.0"),
        ({"noise_density": 0.0}, "noise_density is 0.0"),
        ({"drift": float("nan")}, "drift is nan"),
    ],
)
def test_law_refuses_what_it_cannot_use(change, message):
    with pytest.raises(TwinError, match=message):
        dataclasses.replace(TIL, **change)


@pytest.mark.parametrize(
    ("gains", "message"),
    [
        ({("speed", "ax"): 1.0}, "state 'speed' is unknown"),
        ({("vx", "vx"): 1.0}, "output 'vx' is unknown"),
        ({("vx", "ax"): float("inf")}, "gain ax -> vx is inf"),
    ],
)
def test_observer_refuses_gains_it_cannot_use(gains, message):
    with pytest.raises(TwinError, match=message):
        observer(gains=gains)


def test_measurement_that_is_no_number_is_named(drive):
    bad = drive.measurements.copy()
    bad[17, OUTPUTS.index("yaw_rate")] = np.inf
    til = observer(TIL)
    with pytest.raises(TwinError, match="drive: yaw_rate is inf in sample 17"):
        til.run(drive.replace(measurements=bad))
    with pytest.raises(TwinError, match="update: yaw_rate is inf"):
        til.update(drive.inputs[17], bad[17])


def test_measurement_that_is_missing_corrects_nothing(drive):
    bare = drive.measurements.copy()
    half = len(drive) // 2
    bare[:half, OUTPUTS.index("ax")] = np.nan
    til = observer(TIL, gains={("yaw_rate", "ax"): 1.0})
    found = til.run(drive.replace(measurements=bare))
    assert not found["mass"][:half].any()
    assert found["mass"][half:].any()
    alone = observer().run(drive).states
    np.testing.assert_allclose(found.states[:half], alone[:half], rtol=1e-9, atol=1e-9)


def test_channel_that_a_law_needs_and_a_log_lacks_is_named(drive):
    bare = drive.measurements.copy()
    bare[:, OUTPUTS.index("ax")] = np.nan
    with pytest.raises(TwinError, match="has no measurement of ax, which a law needs"):
        observer(TIL).run(drive.replace(measurements=bare))


def test_torque_beyond_any_car_is_named(drive):
    bad = drive.inputs.copy()
    bad[3, 1] = 1e9
    with pytest.raises(TwinError, match=r"drive_torque_fl is 1000000000\.0 in sample 3"):
        observer().run(drive.replace(inputs=bad))


def test_gain_that_diverges_is_one_clear_error(clean):
    til = observer(gains={("wheel_speed_fl", "wheel_speed_fl"): 5000.0})
    til.reset(0.0)
    with pytest.raises(TwinError, match="blew up at t ="):
        til.run(clean)


def test_drive_of_another_sample_time_is_refused(drive):
    with pytest.raises(TwinError, match=r"samples every 0\.002"):
        observer().run(drive.replace(time=2.0 * drive.time))


def test_estimate_names_what_it_has(drive):
    til = observer()
    til.reset(0.0)
    estimate = til.run(drive)
    assert estimate["vx"].shape == estimate["ax"].shape == estimate["Jzz"].shape == (len(drive),)
    assert estimate.nominal[PARAMETERS.index("mass")] == 2125.8
    with pytest.raises(TwinError, match="has no 'beta'"):
        estimate["beta"]


def test_corrections_at_every_tenth_sample_leave_the_others_alone(drive):
    til = Observer(Twin(Vehicle.load("suv")), [PAPER], {("yaw_rate", "yaw_rate"): 5.0}, every=10)
    til.reset(0.0, known())
    mass = til.run(drive)["mass"]
    changes = np.flatnonzero(np.diff(mass)) + 1
    assert changes.size > 500
    assert set(changes % 10) == {9}


def test_observer_that_never_corrects_is_refused():
    with pytest.raises(TwinError, match="every is 0; allowed: 1 or more"):
        Observer(Twin(Vehicle.load("suv")), [], every=0)
