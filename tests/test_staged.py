import numpy as np
import pytest
from cars import drive_of_other_car
from scipy.signal import lfilter

from estimators.ensemble.staged import CM, Stage, StagedObserver, StagedSettings
from scenarios import mass
from scenarios.driving.joint_drives import mixed
from scenarios.driving.record import record
from scenarios.experiment.laws import ALL_LAWS as STAGED_LAWS
from twin import PARAMETER, TwinError, Vehicle, noise_sd, with_noise

# Short stages for a short drive
SETTINGS = StagedSettings(mass_seconds=1.5, pitch_seconds=1.0, cm_seconds=4.0)


def observe(observer, drive, speed):
    observer.reset(speed, road=drive.inputs[0, 9:13])
    return observer.run(drive)


def staged(*arguments, speed, drive):
    return observe(StagedObserver(Vehicle.load("suv"), *arguments), drive, speed)


@pytest.fixture(scope="module")
def rich():
    clean = record(Vehicle.load("suv_loaded"), mixed(duration=16.0))
    sd = noise_sd(clean.measurements, 10.0)
    return with_noise(clean, 10.0, np.random.default_rng(0)), sd


@pytest.fixture(scope="module")
def staged_run(rich):
    noisy, sd = rich
    speed = float(noisy.truth["vx"][0])
    return staged(sd, STAGED_LAWS, SETTINGS, speed=speed, drive=noisy)


def test_stages_follow_each_other_in_the_order_of_figure_12(staged_run):
    found = staged_run.stage
    assert list(dict.fromkeys(found.tolist())) == list(Stage)
    assert (np.diff(found) >= 0).all()


def test_each_parameter_moves_in_its_own_stage_alone(staged_run):
    own = {
        Stage.MASS: ("mass",),
        Stage.PITCH: ("Jyy",),
        Stage.CM: CM,
        Stage.ROLL_YAW: ("Jxx", "Jzz"),
    }
    before = staged_run.stage[1:]
    for stage, names in own.items():
        for name in names:
            moves = np.diff(staged_run[name]) != 0.0
            assert moves.any()
            # a stage may end within a block
            assert set(before[moves]) == {stage}


def test_staged_observer_finds_mass_and_cm_of_the_load(staged_run):
    variation = mass.EXPERIMENT.cases[0].load()
    # seconds for each, on a car that is wrong in all the rest
    assert staged_run["mass"][-1] == pytest.approx(variation["mass"], rel=0.15)
    for name in CM:
        assert abs(staged_run[name][-1] - variation[name]) < 0.5 * PARAMETER[name].prior_sd
    assert (staged_run.sd[-1] < staged_run.sd[0]).all()


def test_cm_is_found_exactly_where_nothing_else_is_wrong():
    load = {"cm_x": -0.06, "cm_y": 0.02, "cm_z": 0.04}
    noisy, sd, speed = drive_of_other_car(load, seconds=14.0, snr=float("inf"))
    early = StagedSettings(mass_seconds=0.02, pitch_seconds=0.02, cm_seconds=8.0)
    found = staged(sd, STAGED_LAWS, early, speed=speed, drive=noisy)
    for name, value in load.items():
        assert found[name][-1] == pytest.approx(value, rel=0.1)


def test_clock_of_the_first_stage_counts_straight_driving_alone(staged_run, rich):
    noisy, _ = rich
    share = noisy.dt / (0.1 + noisy.dt)
    yaw_rate = lfilter([share], [1.0, share - 1.0], noisy.channel("yaw_rate"))
    straight = np.abs(yaw_rate) < SETTINGS.straight
    counted = straight[staged_run.stage == Stage.MASS].sum() * noisy.dt
    assert counted == pytest.approx(SETTINGS.mass_seconds, abs=0.002)
    assert not straight[staged_run.stage == Stage.MASS].all()


def test_missing_or_doubled_law_is_refused(rich):
    _, sd = rich
    with pytest.raises(TwinError, match="laws are of mass, Jyy, Jxx; allowed: mass, Jxx, Jyy, Jzz"):
        StagedObserver(Vehicle.load("suv"), sd, STAGED_LAWS[:-1])


def test_stage_without_time_is_refused():
    with pytest.raises(TwinError, match=r"staged: cm_seconds is 0.0; allowed: more than 0"):
        StagedSettings(cm_seconds=0.0)
