import tomllib
from dataclasses import replace

import numpy as np
import pytest

from estimators.speed_follower import TORQUES
from scenarios.__main__ import main
from scenarios.calibration import calibrate, plan
from scenarios.calibration.task import LARGEST, SIZES, Task, residuals
from scenarios.driving.manoeuvres import swept_steer
from scenarios.driving.record import record
from scenarios.logs.candidate import Candidate, candidate_of
from scenarios.logs.follower import driven
from scenarios.logs.free_parameters import BAND, FREE, GAINS, SIDESLIP_SD
from twin import OUTPUTS, TwinError, Vehicle

FACTORS = {"front_cornering_stiffness": 0.85, "rear_cornering_stiffness": 1.2}
SUV = Vehicle.load("suv")


@pytest.fixture(scope="module")
def log():
    """Eight seconds of a swept steer by a car whose tyres differ from its files."""
    return record(SUV.scaled(**FACTORS), swept_steer(duration=8.0, amplitude=0.6, highest=2.0))


@pytest.fixture(scope="module")
def torqueless(log):
    """The same log by somebody who measures speed but no torques."""
    keep = [i for i, name in enumerate(log.input_names) if name not in TORQUES]
    return log.replace(
        inputs=log.inputs[:, keep],
        input_names=tuple(log.input_names[i] for i in keep),
        measurements=np.column_stack([log.measurements, log.truth["vx"]]),
        output_names=(*OUTPUTS, "vx"),
    )


# nothing is believed beforehand
NOTHING = dict.fromkeys(FREE, np.inf)


def task(drive, free=tuple(FACTORS), signals=("ay", "yaw_rate"), **values):
    candidate = Candidate(vehicle=SUV, follower=driven(SUV), values=values)
    return Task(candidate=candidate, free=free, signals=signals, drives=(drive,), prior_sd=NOTHING)


def assert_found(found, tolerance):
    np.testing.assert_allclose(found.values, list(FACTORS.values()), atol=tolerance)
    assert found.rms_after < 0.1 * found.rms_before


def test_stiffnesses_are_found_from_a_log_with_torques(log):
    found = calibrate.calibrate(task(log), evaluations=8)
    assert_found(found, 2e-3)
    assert np.all(found.high - found.low < 0.05)


def test_stiffnesses_are_found_by_a_twin_that_follows_the_speed(torqueless):
    assert_found(calibrate.calibrate(task(torqueless), evaluations=8), 0.02)


def test_twin_follows_the_speed_whatever_its_mass(torqueless):
    speeds = [task(torqueless, mass=mass).candidate.run(torqueless)["vx"] for mass in (0.0, 300.0)]
    for speed in speeds:
        np.testing.assert_allclose(speed, torqueless.channel("vx"), atol=0.3)
    np.testing.assert_allclose(*speeds, atol=0.1)


def test_mass_is_not_free_where_the_speed_is_followed(torqueless):
    with pytest.raises(TwinError, match="mass is not observable then; allowed: do not free it"):
        calibrate.calibrate(task(torqueless, free=("mass",)))


def test_residuals_of_the_right_car_vanish(log):
    right = task(log, signals=("ay", "yaw_rate", "sideslip"))
    assert np.abs(residuals(right, np.array(list(FACTORS.values())))).max() < 1e-4


def test_offset_of_the_steering_and_of_the_sideslip_are_what_they_say(log):
    right = task(log, free=(*FACTORS, "sideslip_offset"), signals=("sideslip",))
    shifted = residuals(right, np.array([*FACTORS.values(), 0.01]))
    np.testing.assert_allclose(shifted * SIZES["sideslip"], 0.01, atol=1e-6)


def test_twin_that_cannot_drive_the_log_costs_the_largest_residuals(log):
    wild = task(log, free=("yaw_rate_to_vy",), yaw_rate_to_yaw_rate=20.0)
    wild = replace(wild, candidate=replace(wild.candidate, gains={("z", "az"): -1e4}))
    assert (residuals(wild, np.array([0.0])) == LARGEST).all()


def test_sample_without_measurement_says_nothing(log):
    measurements = log.measurements.copy()
    measurements[::2, OUTPUTS.index("ay")] = np.nan
    holes = log.replace(measurements=measurements)
    assert (residuals(task(holes, signals=("ay",)), np.array([0.7, 0.7])) == 0.0).any()
    assert np.isfinite(residuals(task(holes), np.array([0.7, 0.7]))).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"free": ()}, "nothing is free; allowed: .*tyre_friction"),
        ({"free": ("colour",)}, "'colour' is no parameter; allowed: "),
        ({"free": ("drag", "drag")}, "drag is freed twice"),
        ({"free": ("sideslip_offset",)}, "sideslip_offset is free; allowed: with sideslip"),
        ({"signals": ("noise",)}, "signal 'noise' is unknown; allowed: sideslip, ax"),
        ({"drag": 7.0, "free": ("drag",)}, "drag is 7; allowed: 0.3 to 3"),
    ],
)
def test_mistake_is_one_sentence(log, changes, message):
    with pytest.raises(TwinError, match=message):
        calibrate.calibrate(task(log, **changes))


def test_log_without_the_signal_is_refused(torqueless):
    with pytest.raises(TwinError, match="the log has no sideslip"):
        calibrate.calibrate(task(torqueless.replace(truth={}), signals=("sideslip",)))


def test_command_writes_values_intervals_and_where_they_come_from(log, tmp_path, capsys):
    file, out = tmp_path / "log.parquet", tmp_path / "car.toml"
    log.save(file)
    command = ["calibrate", str(file), "--vehicle", "suv", "--free", "front_cornering_stiffness"]
    status = main([*command, "--to", "5", "--evaluations", "3", "--out", str(out)])
    assert status == 0
    assert "front_cornering_stiffness" in capsys.readouterr().out
    content = tomllib.loads(out.read_text())
    value = content["values"]["front_cornering_stiffness"]
    assert value["low_95"] < value["value"] < value["high_95"]
    assert value["unit"] == "1"
    assert (content["vehicle"], content["logs"]) == ("suv", ["log.parquet"])
    assert [len(hash_) for hash_ in content["log_sha256"]] == [64]
    assert content["to_s"] == pytest.approx([5.0], abs=0.01)
    assert list(content["values"]) == ["front_cornering_stiffness"]
    assert sorted(tmp_path.iterdir()) == [out, file]


def test_factors_stay_what_was_found_beside_a_freed_inertia(log, tmp_path):
    """A running twin has parameters of the same names, which are not those of its files."""
    file, out = tmp_path / "log.parquet", tmp_path / "car.toml"
    log.save(file)
    free = "front_cornering_stiffness,Jzz"
    command = ["calibrate", str(file), "--vehicle", "suv", "--free", free, "--evaluations", "3"]
    assert main([*command, "--out", str(out)]) == 0
    found = tomllib.loads(out.read_text())["values"]["front_cornering_stiffness"]
    assert 0.6 < found["value"] < 1.1
    assert Vehicle.load(out).compile() is not None


def test_command_leaves_nothing_after_a_mistake(log, tmp_path, capsys):
    file, out = tmp_path / "log.parquet", tmp_path / "car.toml"
    log.save(file)
    command = ["calibrate", str(file), "--vehicle", "suv", "--free", "colour", "--out", str(out)]
    assert main(command) == 2
    assert "til: calibrate: 'colour' is no parameter" in capsys.readouterr().err
    assert not out.exists()


def test_what_a_log_shows_is_fitted_and_freed_unless_somebody_says_else(torqueless, tmp_path):
    assert plan.default_signals([torqueless], follows=True) == ("sideslip",)
    blind = [torqueless.replace(truth={})]
    assert plan.default_signals(blind, follows=True) == ("ay", "yaw_rate")
    assert plan.default_signals([torqueless], follows=False) == ("ay", "yaw_rate")
    assert "sideslip_offset" in plan.default_free(("sideslip",))
    assert set(plan.default_free(("ay",))) < set(plan.default_free(("sideslip",)))
    assert set(plan.default_free(("sideslip",))) < set(FREE)
    file = tmp_path / "log.parquet"
    torqueless.save(file)
    whole, nothing, _ = plan.plan_of([file], None, "suv", (), (), held_out=0.0)
    most, kept, both = plan.plan_of([file], None, "suv", (), (), held_out=0.5)
    assert [len(drive) for drive in both] == [len(drive) for drive in whole.drives]
    assert (whole.signals, nothing) == (("sideslip",), ())
    assert len(most.drives[0]) == pytest.approx(0.5 * len(whole.drives[0]), abs=1)
    assert len(kept[0]) == pytest.approx(len(most.drives[0]), abs=1)


def test_band_is_as_wide_as_the_errors_ask_for(torqueless):
    """Another drive shows another sideslip: half of what it asks for counts."""
    candidate = Candidate(vehicle=SUV, follower=driven(SUV), scheduled=True)
    fitted = Task(candidate=candidate, free=("drag",), signals=("sideslip",), drives=(torqueless,))
    off = torqueless.replace(
        truth={**torqueless.truth, "sideslip": torqueless.truth["sideslip"] + 0.05}
    )
    found = fitted.at(np.ones(1))
    own, unseen = (calibrate.band(found, (drive,)) for drive in (torqueless, off))
    assert unseen > own + 1.0
    wider = calibrate.with_band(fitted, np.ones(1), unseen).candidate.values[BAND]
    assert wider == pytest.approx(np.log(0.5 * (own + unseen)))
    alone = calibrate.with_band(fitted, np.ones(1)).candidate
    held = alone.run(torqueless)
    error = np.abs(alone.sideslip(held) - torqueless.truth["sideslip"])
    assert np.mean(error < 1.97 * held.sideslip_sd) == pytest.approx(0.95, abs=0.01)


def test_gains_that_are_freed_are_those_that_estimate_uses(torqueless, tmp_path):
    """With the band that the errors ask for, over what was fitted and what was not."""
    file, out = tmp_path / "log.parquet", tmp_path / "car.toml"
    torqueless.save(file)
    free = "front_cornering_stiffness,yaw_rate_to_yaw_rate"
    command = ["calibrate", str(file), "--vehicle", "suv", "--free", free, "--evaluations", "2"]
    assert main([*command, "--out", str(out)]) == 0
    found = tomllib.loads(out.read_text())
    assert list(found["values"]) == free.split(",")
    assert list(found["fixed"]) == [SIDESLIP_SD]
    car = Vehicle.load(out)
    assert candidate_of(car).scheduled is False
    estimate = candidate_of(car).observe(torqueless)
    error = estimate.sideslip - torqueless.truth["sideslip"]
    np.testing.assert_array_equal(estimate.sideslip_sd, found["fixed"][SIDESLIP_SD])
    assert np.mean(np.abs(error) < 2.0 * estimate.sideslip_sd) >= 0.95
    assert main(["estimate", str(file), "--vehicle", str(out), "--out", str(tmp_path)]) == 0
    again = plan.plan_of([file], None, str(out), (), ()).task.candidate
    assert again.scheduled
    assert not set(again.values) & {*GAINS, SIDESLIP_SD}


def test_follower_of_a_car_knows_its_mass_and_wheels():
    follower = driven(SUV)
    assert follower.mass == pytest.approx(2125.8 + 4 * 53.0)
    assert 0.33 < follower.radius_front < 0.369  # loaded, below the tyre's free radius
