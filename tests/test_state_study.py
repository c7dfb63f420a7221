"""Sideslip and mass together: what the issue of TiL Section 5 promises, on short drives."""

import dataclasses
import math

import numpy as np
import pytest

from estimators.til import state_and_mass
from estimators.til.law import advance_law, compile_laws
from estimators.til.observer import Observer
from scenarios.cli.catalogue import Settings
from scenarios.experiment import state_study
from scenarios.experiment.state_study import (
    Run,
    gains_of,
    make_observer,
    noisy_drive,
    observe,
    score,
)
from scenarios.laps import LAPS
from twin import FORCES, OUTPUTS, TwinError

INFINITE = math.inf
SECONDS = 16.0
SAME = Run(case="same", drive="laps", estimator="til", snr=INFINITE, duration=SECONDS)
MISMATCHED = dataclasses.replace(SAME, case="mismatched")


def degrees(drive, belief, part=slice(None)):
    error = np.degrees(belief.sideslip - drive.truth["sideslip"])[part]
    return math.sqrt(np.mean(error**2))


def test_right_twin_finds_sideslip_and_mass():
    drive, belief = observe(SAME)
    assert belief.mass[0] == pytest.approx(-350.0, abs=1.0)
    late = slice(round(0.5 * len(drive)), None)
    assert degrees(drive, belief, late) < 0.01
    assert abs(belief.mass[-1]) < 1.0


def test_starts_on_either_side_end_together():
    ends = [
        observe(dataclasses.replace(MISMATCHED, start=start))[1].mass[-1]
        for start in (-350.0, 0.0, 350.0)
    ]
    assert np.ptp(ends) < 5.0
    assert abs(ends[0]) < 30.0


def test_corrections_at_100_hz_do_what_those_at_1_khz_do():
    found = [observe(dataclasses.replace(MISMATCHED, every=every)) for every in (1, 10)]
    late = slice(round(0.5 * SECONDS / 1e-3), None)
    fast, slow = (degrees(drive, belief, late) for drive, belief in found)
    assert slow == pytest.approx(fast, rel=0.1)
    fast, slow = (belief.mass[-1] for _, belief in found)
    assert slow == pytest.approx(fast, abs=0.01 * 350.0)


@pytest.mark.parametrize(
    ("entry", "name"), [(("vx", "ax"), "ax -> vx"), (("vy", "ay"), "ay -> vy")]
)
def test_feed_through_beyond_one_is_refused(entry, name):
    observer = make_observer(SAME)
    with pytest.raises(TwinError, match=f"gain {name} is 1.2; allowed: less than 1"):
        Observer(observer.twin, [], {entry: 1.2})
    Observer(observer.twin, [], {entry: 0.98})


def test_feed_through_beyond_one_would_diverge():
    """The tyres' restoring force enters v_y with 1 - c: past 1 it drives v_y away."""
    errors = {}
    for c in (0.98, 1.2):
        values = {**gains_of("sports_car", "til"), "ay_vy": 0.5, "yaw_rate_vy": 0.0}
        observer = make_observer(dataclasses.replace(SAME, gains=tuple(values.items())))
        observer._gains.gain[observer._gains.gain == 0.5] = c
        drive = noisy_drive(MISMATCHED)
        observer.reset(float(drive.truth["vx"][0]))
        try:
            estimate = observer.run(drive)
        except TwinError:
            errors[c] = INFINITE
            continue
        error = np.arctan2(estimate["vy"], estimate["vx"]) - drive.truth["sideslip"]
        errors[c] = np.degrees(np.abs(error).max())
    assert errors[0.98] < 5.0
    assert errors[1.2] > 20.0


def test_compensation_brings_back_the_mass_that_wheel_speeds_hide():
    """Wheel speeds that are held let a~ = a whatever the mass."""
    drive = noisy_drive(SAME)
    values = {**gains_of("sports_car", "til"), "wheel_speed": 100.0}
    found = {}
    for name, share in (("hidden", 0.0), ("found", None)):
        observer = make_observer(dataclasses.replace(SAME, gains=tuple(values.items())))
        if share is not None:
            observer._laws["compensation"] = share
        observer.reset(float(drive.truth["vx"][0]), {"mass": -350.0})
        found[name] = abs(observer.run(drive)["mass"][-1])
    assert found["found"] < 2.0
    assert found["hidden"] > 10.0 * found["found"]


def test_mass_law_rests_in_bends_and_while_nothing_pushes():
    estimate = observe(SAME)[1].estimate
    drive = noisy_drive(SAME)
    moved = np.abs(np.diff(estimate["mass"])) > 0.0
    turning = np.abs(drive.channel("yaw_rate"))[1:] > state_and_mass.LARGEST_YAW_RATE
    idle = np.abs(drive.channel("ax"))[1:] < 0.5 * state_and_mass.LEAST_ACCELERATION
    assert turning.any()
    assert idle.any()
    assert not moved[turning].any()
    late = np.arange(len(moved)) > len(moved) // 2
    assert not moved[idle & late].any()


def test_log_without_wheel_speeds_is_bridged():
    drive = noisy_drive(SAME)
    bare = drive.measurements.copy()
    bare[:, OUTPUTS.index("wheel_speed_fl") :] = np.nan
    observer = make_observer(SAME)
    observer.reset(float(drive.truth["vx"][0]), {"mass": -350.0})
    estimate = observer.run(drive.replace(measurements=bare))
    assert abs(estimate["mass"][-1]) < 20.0
    error = np.arctan2(estimate["vy"], estimate["vx"]) - drive.truth["sideslip"]
    assert np.degrees(np.sqrt(np.mean(error**2))) < 0.3


def test_axle_forces_take_over_a_share_of_what_each_axle_lacks():
    """On a rigid car: a_y and the yaw rate's innovation tell force and moment, those the axles."""
    mass, inertia, axles, hold = 1500.0, 2300.0, (1.5, -1.1), 50.0
    laws = state_and_mass.axle_force_laws({"yaw_rate": hold}, 2.0, 8.0, mass, inertia, axles)
    compiled, memory = compile_laws(laws, 1e-3)
    lacking, found = np.array([800.0, -300.0]), np.zeros(2)
    for _ in range(2000):
        rest = lacking - found
        y = np.zeros(len(OUTPUTS))
        y[OUTPUTS.index("ay")] = rest.sum() / mass
        y[OUTPUTS.index("yaw_rate")] = rest @ axles / (inertia * hold)
        for k, law in enumerate(laws):
            added = advance_law(compiled[k], memory[k], y, np.zeros(len(OUTPUTS)), 1e-3)
            found[laws.index(law) // 2] += added
    np.testing.assert_allclose(found, 0.2 * lacking, rtol=1e-3)
    assert [law.parameter for law in laws[::2]] == list(FORCES)


def test_observer_with_axle_forces_runs_and_stays_with_the_vehicle():
    extended = score(dataclasses.replace(MISMATCHED, estimator=state_study.WITH_FORCES))
    plain = score(MISMATCHED)
    assert extended.sideslip < 1.1 * plain.sideslip
    assert extended.axle_force == pytest.approx(plain.axle_force, rel=0.1)
    assert extended.axle_force != plain.axle_force


def test_static_map_and_open_loop_are_worse():
    ours = score(MISMATCHED).sideslip
    others = [
        score(dataclasses.replace(MISMATCHED, estimator=name)).sideslip
        for name in ("zero", "double-track")
    ]
    assert ours < min(others)


def test_unknown_estimator_is_named():
    with pytest.raises(TwinError, match="estimator is 'best'; allowed: til, til-paper"):
        observe(dataclasses.replace(SAME, estimator="best"))


def test_gains_of_another_car_are_refused(tmp_path):
    path = tmp_path / "gains.toml"
    path.write_text('vehicle = "suv"\nestimator = "til"\n')
    settings = Settings(snr=20.0, seeds=(0,), jobs=1, duration=1.0, gains=path)
    with pytest.raises(TwinError, match="vehicle is 'suv'; allowed here: 'sports_car'"):
        LAPS.run(settings)


@pytest.mark.slow
@pytest.mark.parametrize(("drive", "sideslip"), [("laps", 0.08), ("lane-change", 0.06)])
def test_default_observer_holds_its_marks_on_the_mismatched_car(drive, sideslip):
    def median(estimator, field):
        todo = [
            Run(case="mismatched", drive=drive, estimator=estimator, seed=seed) for seed in range(3)
        ]
        return np.median([getattr(score(run), field) for run in todo])

    ours = median("til", "sideslip")
    assert ours < sideslip
    assert median("til", "mass") < 10.0
    for other in ("double-track", "static-map", "zero"):
        assert ours < median(other, "sideslip")


@pytest.mark.slow
def test_default_observer_holds_its_marks_on_another_programs_car():
    for drive in state_study.DRIVES:
        found = score(Run(case=state_study.COMMONROAD, drive=drive, estimator="til"))
        assert found.sideslip < 0.08
        assert found.mass < 15.0
