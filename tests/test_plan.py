"""Planned manoeuvres: what is wanted and allowed, the prediction, and the command."""

import json

import numpy as np
import pytest

from estimators.joint.expected import (
    NO_MODEL_ERROR,
    REAL_CAR,
    Information,
    expected_sd,
    seconds_until,
)
from estimators.joint.observer import JointObserver
from scenarios.__main__ import main
from scenarios.planning import study
from scenarios.planning.design import FIRST, cycles, design_of, motion_of
from scenarios.planning.drive import course_for, driven
from scenarios.planning.fit import fitted
from scenarios.planning.limits import PlanLimits, area, speeds, strain
from scenarios.planning.plan import NOISE, Plan, Task, drawn, evaluate
from scenarios.planning.wanted import wanted_sd
from twin import CHANNEL, OUTPUTS, TwinError, Vehicle

CAR = Vehicle.load("suv")


def made_up(rate=1.0, prior=10.0, seconds=4.0):
    """Evidence of one parameter that one channel sees at a constant rate, and a second one."""
    time = 0.25 * np.arange(1, round(seconds / 0.25) + 1)
    gained = np.zeros((time.size, len(OUTPUTS), 2, 2))
    gained[:, 0, 0, 0] = rate * time
    return Information(
        estimated=("mass", "Jzz"), prior=np.array([prior, 5.0]), time=time, gained=gained,
        noise_sd=np.array(NOISE), segment=2.5,
    )  # fmt: skip


def test_expected_sd_of_a_constant_rate_is_that_of_prior_and_information():
    time = [1.0, 3.3, 50.0]
    sd = expected_sd(made_up(rate=0.7), time)
    assert sd[:, 0] == pytest.approx([(0.01 + 0.7 * t) ** -0.5 for t in time])
    assert sd[:, 1] == pytest.approx(5.0)  # of which nothing is seen


def test_wanted_sd_is_reached_when_the_information_says_so():
    seconds, missed = seconds_until(made_up(), {"mass": 0.1})
    assert seconds == pytest.approx(100.0 - 0.01, rel=1e-3)
    assert missed < 1.0
    never, missed = seconds_until(made_up(), {"mass": 0.1, "Jzz": 2.5})
    assert (never, missed) == (np.inf, pytest.approx(2.0))


def test_model_error_counts_as_noise_and_widens():
    seen = made_up(rate=1000.0)
    plain, wide = (expected_sd(seen, [4.0, 80.0], e)[:, 0] for e in (NO_MODEL_ERROR, REAL_CAR))
    noisier = (REAL_CAR.residual_sd[0] / CHANNEL["ax"].noise_floor) ** 2
    assert wide[0] == pytest.approx((38.0 / (0.01 + 4e3 / noisier)) ** 0.5)
    assert wide[1] / plain[1] == pytest.approx((38.0 * 2.0 * noisier) ** 0.5, rel=0.01)


def test_prediction_is_what_the_observer_claims_of_the_twins_own_car():
    task = Task("suv", {"Jzz": 100.0}, PlanLimits(width=20.0))
    option, _ = evaluate(task, FIRST, 11.0)
    drive = option.driven.drive
    observer = JointObserver(CAR, NOISE)
    observer.reset(float(drive.truth["vx"][0]))
    claimed = observer.run(drive)
    for name in ("mass", "Jzz", "cm_z"):
        k = claimed.estimated.index(name)
        expected = expected_sd(option.information, [drive.time[-1]])[0, k]
        assert expected == pytest.approx(claimed.sd[-1, k], rel=0.3), name


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("mass=20kg", {"mass": 20.0}),
        ("mass=0.02 t, cm_z=1cm", {"mass": 20.0, "cm_z": 0.01}),
        ("tyre_friction=5%", {"tyre_friction": 0.05}),
        ("Jzz=5%", {"Jzz": 0.05 * CAR.chassis().inertia[2, 2]}),
    ],
)
def test_wanted_is_read(text, found):
    assert wanted_sd(text, CAR) == pytest.approx(found)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--want", "foo=3"], "--want: parameter 'foo' is unknown; allowed: mass, cm_x"),
        (["--want", "mass=5m"], "allowed: a standard deviation above 0 in kg, t, %, as in mass="),
        (["--want", "mass=1.2.3"], "--want: mass is '1.2.3'; allowed"),
        (["--want", "cm_z=5%"], "in m, cm, mm, as in cm_z=10mm"),
        (["--want", "mass=400kg"], "allowed: less than the 300 kg that it is known to"),
        (["--want", "mass=9kg,mass=9kg"], "mass is given twice"),
        (["--want", "mass=9kg", "--area", "big"], "allowed: length x width in m, as in 200x30"),
        (["--want", "mass=9kg", "--area", "30x20"], "30 m long; allowed: 40 m or more"),
        (["--want", "mass=9kg", "--area", "300x2"], "2 m wide; allowed: 3.0 m or more"),
        (["--want", "mass=9kg", "--speed", "25..10"], "allowed: low..high between 3 and 80 m/s"),
        (["--want", "mass=9kg", "--max-ay", "nan"], "--max-ay: nan m/s2; allowed: 0.2 to 15"),
    ],
)
def test_a_mistake_is_one_line(arguments, message, capsys, tmp_path):
    assert main(["plan", "--vehicle", "suv", *arguments, "--out", str(tmp_path / "plan")]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_area_and_speeds_are_read():
    assert area("30 x 200") == (200.0, 30.0)
    assert speeds("15..25 m/s") == (15.0, 25.0)


@pytest.mark.parametrize("limits", [PlanLimits(width=6.0), PlanLimits(length=200.0, width=30.0)])
def test_a_fitted_design_stays_within_every_limit(limits):
    course = course_for(limits, CAR)
    motion = motion_of(design_of(FIRST, limits), CAR, limits, 10.0)
    _, run, used = fitted(CAR, motion, course, limits)
    assert max(used.values()) <= 1.0
    assert used == strain(run.drive, run.left, limits, CAR)
    assert np.ptp(run.drive.truth["x"]) <= limits.length


def test_a_pass_starts_and_ends_at_a_standstill():
    limits = PlanLimits(length=200.0, width=30.0)
    motion = motion_of(design_of(FIRST, limits), CAR, limits, 10.0)
    drive = driven(CAR, motion, course_for(limits, CAR), limits.width).drive
    assert motion.repeats
    assert drive.truth["vx"][0] == pytest.approx(0.0, abs=1e-6)
    assert drive.truth["vx"].max() > 12.0
    assert drive.truth["vx"][-1] < 0.5


def test_cycles_go_to_and_fro_between_the_speeds_of_the_design():
    design = design_of(FIRST, PlanLimits())
    speed, braking = cycles(design, 30.0)
    assert speed.min() == pytest.approx(design.slow, abs=0.01)
    assert speed.max() == pytest.approx(design.fast, abs=0.01)
    assert -np.gradient(speed, 0.001).min() == pytest.approx(design.braking, rel=0.02)
    assert (np.gradient(speed, 0.001)[braking > 0.1] < 1e-9).mean() > 0.95


def test_drawn_cars_differ_and_settle():
    task = Task("suv", {"Jzz": 100.0}, PlanLimits())
    cars = drawn(task, np.random.default_rng(0), 3)
    assert len(cars) == 3
    assert np.abs(cars[0] - cars[1]).max() > 1.0


@pytest.mark.slow
def test_the_command_plans_and_goes_on_with_its_search(tmp_path, capsys):
    out = tmp_path / "plan"
    arguments = ["plan", "--vehicle", "suv", "--want", "Jzz=200kgm2", "--evaluations", "4",
                 "--cars", "1", "--out", str(out), "--json", str(tmp_path / "a.json")]  # fmt: skip
    assert main(arguments) == 0
    assert {file.name for file in out.iterdir()} == {"plan.png", "plan.csv", "plan.txt"}
    assert "Keep the car in the middle" in (out / "plan.txt").read_text()
    rows = json.loads((tmp_path / "a.json").read_text())["rows"]
    seconds = {row["case"]: row["median"] for row in rows if row["quantity"] == "Jzz"}
    assert seconds["plan"] < min(seconds["swept steer"], seconds["step steer"])
    table = np.genfromtxt(out / "plan.csv", delimiter=",", names=True)
    assert np.diff(table["time"]) == pytest.approx(0.02, abs=1e-3)


def test_an_area_excludes_a_road(capsys):
    arguments = ["plan", "--vehicle", "suv", "--want", "mass=9kg", "--area", "200x30"]
    assert main([*arguments, "--road", "circuit"]) == 2
    assert "--area: excludes --road" in capsys.readouterr().err


def test_a_car_of_which_nothing_is_seen_is_told_so():
    with pytest.raises(TwinError, match=r"allowed: 0\.5 s or more"):
        evaluate(Task("suv", {"Jzz": 100.0}, PlanLimits()), FIRST, 0.3)


def test_errors_of_the_study_are_those_of_a_car_with_other_parameters():
    option, motion = evaluate(Task("suv", {"Jzz": 100.0}, PlanLimits(width=20.0)), FIRST, 6.0)
    task = Task("suv", {"Jzz": 100.0, "mass": 20.0}, PlanLimits(width=20.0))
    made = Plan(
        task=task, design=design_of(FIRST, task.limits), scale=1.0, motion=motion,
        planned=option, standard={}, cars=(), evaluations=0,
    )  # fmt: skip
    errors = np.array([study._errors((made, seed)) for seed in range(2)])
    assert errors.shape == (2, 2)
    assert np.abs(errors).max() < 8.0  # standard deviations
    assert np.abs(errors[0] - errors[1]).min() > 0.0
