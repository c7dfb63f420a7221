"""Sideslip and mass together: what TiL Section 5 promises, on short drives."""

import dataclasses
import math

import numpy as np
import pytest

from estimators.registry import make
from estimators.til import state_and_mass
from estimators.til.law import advance_law, compile_laws
from estimators.til.observer import Observer
from scenarios import laps
from scenarios.experiment import sideslip_and_mass
from scenarios.experiment.engine import given, observe, run_experiment, runs, score
from scenarios.experiment.experiment import Run
from scenarios.experiment.gains_file import of_run
from scenarios.experiment.metrics import mass_error
from scenarios.experiment.sideslip_and_mass import case, gains_of
from twin import FORCES, OUTPUTS, TwinError

INFINITE = math.inf
SECONDS = 16.0
EXPERIMENT = dataclasses.replace(
    laps.EXPERIMENT,
    estimators={**sideslip_and_mass.RECIPES, **sideslip_and_mass.AXLE_FORCES},
)


def quiet(vehicle, **changes):
    return dataclasses.replace(case(vehicle, "laps"), snr=INFINITE, **changes)


SAME = Run(experiment=EXPERIMENT, case=quiet("same"), estimator="til", duration=SECONDS)
MISMATCHED = dataclasses.replace(SAME, case=quiet("mismatched"))


def noisy_drive(run):
    return run.case.noisy_drive(run.seed, run.duration)


def make_observer(run, **changes):
    own = dataclasses.replace(given(run, noisy_drive(run)), **changes)
    return make("til", own)


def figure(run, quantity, metric):
    return next(s.value for s in score(run)[0] if (s.quantity, s.metric) == (quantity, metric))


def sideslip(run):
    return figure(run, "sideslip", "rmse")


def degrees(drive, estimate, part=slice(None)):
    error = np.degrees(estimate.sideslip - drive.truth["sideslip"])[part]
    return math.sqrt(np.mean(error**2))


def test_right_twin_finds_sideslip_and_mass():
    trial = observe(SAME)
    _, drive, estimate = trial
    mass = mass_error(trial)
    assert mass[0] == pytest.approx(-350.0, abs=1.0)
    late = slice(round(0.5 * len(drive)), None)
    assert degrees(drive, estimate, late) < 0.01
    assert abs(mass[-1]) < 1.0


def test_starts_on_either_side_end_together():
    ends = [
        mass_error(
            observe(
                dataclasses.replace(
                    MISMATCHED, case=quiet("mismatched", initial=(("mass", start),))
                )
            )
        )[-1]
        for start in (-350.0, 0.0, 350.0)
    ]
    assert np.ptp(ends) < 5.0
    assert abs(ends[0]) < 30.0


def test_corrections_at_100_hz_do_what_those_at_1_khz_do():
    drive = noisy_drive(MISMATCHED)
    found = []
    for every in (1, 10):
        observer = make_observer(MISMATCHED, every=every)
        observer.reset(float(drive.truth["vx"][0]), {"mass": -350.0})
        found.append(observer.run(drive))
    late = slice(round(0.5 * SECONDS / 1e-3), None)
    fast, slow = (degrees(drive, estimate, late) for estimate in found)
    assert slow == pytest.approx(fast, rel=0.1)
    fast, slow = (estimate["mass"][-1] for estimate in found)
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
    estimate = observe(SAME).estimate
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
    extended = dataclasses.replace(MISMATCHED, estimator="til-axle-forces")
    assert sideslip(extended) < 1.1 * sideslip(MISMATCHED)
    for axle in ("fy_front", "fy_rear"):
        forces, plain = (figure(run, axle, "rmse") for run in (extended, MISMATCHED))
        assert forces == pytest.approx(plain, rel=0.1)
        assert forces != plain


def test_double_track_and_open_loop_are_worse():
    others = [
        sideslip(dataclasses.replace(MISMATCHED, estimator=name))
        for name in ("zero", "double-track")
    ]
    assert sideslip(MISMATCHED) < min(others)


def test_static_map_is_worse_and_estimates_no_mass():
    run = dataclasses.replace(MISMATCHED, estimator="static-map")
    assert sideslip(run) > sideslip(MISMATCHED)
    assert {s.quantity for s in score(run)[0]} == {"sideslip"}


def test_unknown_estimator_is_named():
    with pytest.raises(TwinError, match="estimator is 'best'; allowed: til, til-paper"):
        observe(dataclasses.replace(SAME, estimator="best"))


def test_gains_of_a_file_are_used(tmp_path):
    path = tmp_path / "gains.toml"
    own = gains_of("sports_car", "til") | {"yaw_rate": 1.0}
    lines = "\n".join(f"{name} = {value}" for name, value in own.items())
    path.write_text(f'vehicle = "sports_car"\nestimator = "til"\n[gains]\n{lines}\n')
    gains = of_run(path, laps.EXPERIMENT)
    changed, plain = (
        run_experiment(laps.EXPERIMENT, seeds=[0], duration=3.0, estimators=["til"], gains=one)
        for one in (gains, None)
    )
    assert changed.rows[0].median != plain.rows[0].median


def test_gains_of_another_car_are_refused(tmp_path):
    path = tmp_path / "gains.toml"
    path.write_text('vehicle = "suv"\nestimator = "til"\n')
    with pytest.raises(TwinError, match="vehicle is 'suv'; allowed here: 'sports_car'"):
        of_run(path, laps.EXPERIMENT)


@pytest.mark.slow
@pytest.mark.parametrize(("drive", "limit"), [("laps", 0.08), ("lane-change", 0.06)])
def test_default_observer_holds_its_marks_on_the_mismatched_car(drive, limit):
    experiment = sideslip_and_mass.experiment(drive)

    def median(estimator, quantity, metric):
        todo = runs(experiment, range(3), estimators=[estimator])
        return np.median([figure(run, quantity, metric) for run in todo])

    ours = median("til", "sideslip", "rmse")
    assert ours < limit
    assert median("til", "mass", "rmse_last_60s") < 10.0
    for other in ("double-track", "static-map", "zero"):
        assert ours < median(other, "sideslip", "rmse")


@pytest.mark.slow
def test_default_observer_holds_its_marks_on_another_programs_car():
    for drive in ("laps", "lane-change"):
        run = Run(experiment=EXPERIMENT, case=case("commonroad", drive), estimator="til")
        assert sideslip(run) < 0.08
        assert figure(run, "mass", "rmse_last_60s") < 15.0
