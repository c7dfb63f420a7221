from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import curve_fit

from estimators.identifiability.cramer_rao import (
    central_differences,
    cramer_rao,
    sensitivities,
)
from estimators.score import rms_pct
from scenarios import lane_change, laps, load_change, mass, truck
from scenarios.experiment.bounds import law_limit
from scenarios.experiment.engine import observe, runs
from scenarios.experiment.single import limit
from scenarios.report.limits import UNITS, limits_of
from twin import OUTPUTS, PARAMETER, PARAMETERS, Twin, TwinError, Vehicle, noise_sd

AX = OUTPUTS.index("ax")
CASE = mass.EXPERIMENT.cases[0]
LAWS = {name: recipe.laws[0] for name, recipe in mass.EXPERIMENT.estimators.items()}
SHORT = 16.0  # [s] of the drive through town: start, accelerate, hold, coast; no stop


def only(channel, sd):
    return np.where(np.arange(len(OUTPUTS)) == channel, sd, np.nan)


@cache
def short_sensitivity(parameter, share=1.0):
    return sensitivities(
        Twin(Vehicle.load("suv")),
        CASE.plant.clean(SHORT),
        [parameter],
        CASE.load(),
        speed=0.0,
        offsets={parameter: share * PARAMETER[parameter].step},
    )


# The bound from sensitivities


def test_one_parameter_has_the_bound_of_a_proportional_fit():
    x = np.linspace(-1.0, 2.0, 50)
    bound = cramer_rao(["slope"], x[None, :, None], np.array([0.3]))
    expected = 0.3 / np.sqrt(np.sum(x**2))
    assert bound.single == pytest.approx([expected])
    assert bound.joint == pytest.approx([expected])
    assert bound.correlation == pytest.approx(np.ones((1, 1)))
    assert bound.information == pytest.approx(np.array([[expected**-2]]))


def test_two_parameters_have_the_bounds_of_a_straight_line_s_fit():
    t, sd = np.linspace(1.0, 4.0, 40), 0.2
    bound = cramer_rao(["level", "slope"], np.array([np.ones(40), t])[:, :, None], np.array([sd]))
    spread = np.sum((t - t.mean()) ** 2)
    assert bound.single == pytest.approx([sd / np.sqrt(40), sd / np.sqrt(np.sum(t**2))])
    assert bound.joint == pytest.approx(
        [sd * np.sqrt(np.mean(t**2) / spread), sd / np.sqrt(spread)]
    )
    assert bound.correlation[0, 1] == pytest.approx(-t.mean() / np.sqrt(np.mean(t**2)))
    assert bound.unidentifiable == ()


def test_free_offset_costs_as_much_as_a_parameter_for_it():
    x = np.random.default_rng(0).normal(1.0, 1.0, (2, 30, 2))
    sd = np.array([0.1, 0.5])
    offsets = np.zeros((2, 30, 2))
    offsets[0, :, 0] = offsets[1, :, 1] = 1.0
    free = cramer_rao(["a", "b"], x, sd, free_offsets=True)
    explicit = cramer_rao(["a", "b", "bias 1", "bias 2"], np.concatenate([x, offsets]), sd)
    assert free.joint == pytest.approx(explicit.joint[:2])
    assert free.correlation == pytest.approx(explicit.correlation[:2, :2])
    assert (free.single > cramer_rao(["a", "b"], x, sd).single).all()


def test_information_of_channels_adds_up_and_that_of_an_unused_one_is_missing():
    x = np.random.default_rng(1).normal(size=(1, 20, 2))
    first, second, both = (
        cramer_rao(["p"], x, np.array(sd)).information[0, 0]
        for sd in ([0.1, np.nan], [np.nan, 0.4], [0.1, 0.4])
    )
    assert both == pytest.approx(first + second)
    assert second == pytest.approx(np.sum(x[..., 1] ** 2) / 0.16)


def test_bounds_follow_the_unit_of_the_parameter():
    x = np.random.default_rng(2).normal(size=(3, 20, 1))
    unit = np.array([1.0, 1e-6, 1e5])
    before = cramer_rao("abc", x, np.array([0.1]))
    after = cramer_rao("abc", x / unit[:, None, None], np.array([0.1]))
    assert after.single == pytest.approx(before.single * unit)
    assert after.joint == pytest.approx(before.joint * unit)
    assert after.correlation == pytest.approx(before.correlation)


def test_parameters_that_look_alike_are_not_told_apart():
    x, z = np.random.default_rng(3).normal(size=(2, 200))
    bound = cramer_rao(["mass", "drag", "bias"], np.array([x, -3.0 * x, z])[..., None], np.ones(1))
    assert np.isfinite(bound.single).all()
    assert bound.unidentifiable == ("mass", "drag")
    alone = cramer_rao(["mass", "bias"], np.array([x, z])[..., None], np.ones(1))
    # the combination of both that is told still stands in the way of the third
    assert bound.joint[2] == pytest.approx(alone.joint[1])
    assert np.isnan(bound.correlation[:2]).all()
    assert bound.correlation[2, 2] == pytest.approx(1.0)


def test_parameters_that_look_almost_alike_are_told_apart():
    x, z = np.random.default_rng(4).normal(size=(2, 200))
    bound = cramer_rao(["a", "b"], np.array([x, x + 1e-3 * z])[..., None], np.ones(1))
    assert bound.unidentifiable == ()
    assert bound.correlation[0, 1] == pytest.approx(-1.0, abs=1e-5)
    assert (bound.joint > 500.0 * bound.single).all()


@pytest.mark.parametrize("sensitivity", [np.zeros((2, 9, 1)), np.zeros((2, 0, 1))])
def test_parameters_that_nothing_tells_of_have_no_finite_bound(sensitivity):
    bound = cramer_rao(["a", "b"], sensitivity, np.ones(1), free_offsets=True)
    assert (bound.single == np.inf).all()
    assert bound.unidentifiable == ("a", "b")


def test_channels_that_are_all_unused_tell_nothing():
    bound = cramer_rao(["a"], np.ones((1, 9, 2)), np.full(2, np.nan))
    assert bound.single[0] == np.inf


@pytest.mark.parametrize(
    ("shape", "sd", "message"),
    [
        ((1, 9, 2), [0.1, 0.0], "more than 0"),
        ((1, 9, 2), [0.1, -1.0], "more than 0"),
        ((1, 9, 2), [0.1, np.inf], "more than 0"),
        ((1, 9, 2), [0.1], "1 parameters, samples, 1 channels"),
        ((2, 9, 2), [0.1, 0.1], "1 parameters, samples, 2 channels"),
        ((9, 2), [0.1, 0.1], "1 parameters, samples, 2 channels"),
    ],
)
def test_noise_or_shape_that_cannot_be_is_refused(shape, sd, message):
    with pytest.raises(TwinError, match=message):
        cramer_rao(["a"], np.ones(shape), np.array(sd))


def test_sensitivity_that_is_not_finite_is_refused():
    with pytest.raises(TwinError, match="not finite"):
        cramer_rao(["a"], np.full((1, 9, 1), np.nan), np.ones(1))


# The sensitivities of a black box


def decay(t, size, rate):
    return size * np.exp(-rate * t)


def test_differences_of_a_black_box_agree_with_its_derivatives():
    t = np.linspace(0.0, 3.0, 30)
    found = central_differences(
        lambda p: decay(t, p["size"], p["rate"])[:, None],
        ["size", "rate"],
        {"size": 2.0, "rate": 0.7},
        {"size": 0.1, "rate": 1e-4},
    )
    expected = np.array([np.exp(-0.7 * t), -2.0 * t * np.exp(-0.7 * t)])
    assert found[..., 0] == pytest.approx(expected, abs=1e-6)


def test_least_squares_on_simulated_noise_reach_the_bound():
    t, truth, sd, draws = np.linspace(0.0, 3.0, 60), (2.0, 0.7), 0.02, 2000
    sensitivity = central_differences(
        lambda p: decay(t, p["size"], p["rate"])[:, None],
        ["size", "rate"],
        dict(zip(["size", "rate"], truth, strict=True)),
        {"size": 1e-3, "rate": 1e-3},
    )
    bound = cramer_rao(["size", "rate"], sensitivity, np.array([sd]))
    rng = np.random.default_rng(5)
    fits = np.array(
        [
            curve_fit(decay, t, decay(t, *truth) + sd * rng.standard_normal(t.size), truth)[0]
            for _ in range(draws)
        ]
    )
    sampling = 1.0 / np.sqrt(2.0 * draws)  # of a standard deviation, relatively
    assert fits.std(axis=0) == pytest.approx(bound.joint, rel=4.0 * sampling)
    assert np.corrcoef(fits.T)[0, 1] == pytest.approx(bound.correlation[0, 1], abs=0.05)


# The short drive does neither brake nor steer.
UNSEEN = ("brake_torque", "front_brake_torque", "steering_ratio", "steering_delay")


@pytest.mark.parametrize("parameter", [n for n in PARAMETERS if n not in UNSEEN])
def test_half_the_offset_changes_no_sensitivity(parameter):
    drive = CASE.plant.clean(SHORT)
    sd = noise_sd(drive.measurements, 10.0)
    whole, half = (short_sensitivity(parameter, share) / sd for share in (1.0, 0.5))
    assert np.linalg.norm(whole - half) < 0.01 * np.linalg.norm(half)


def test_mass_bound_from_acceleration_is_that_of_force_over_mass():
    drive = CASE.plant.clean(SHORT)
    bound = cramer_rao(["mass"], short_sensitivity("mass"), only(AX, 0.5))
    total = Twin(Vehicle.load("suv_loaded")).model.body_mass.sum()
    expected = total * 0.5 / np.sqrt(np.sum(drive.channel("ax") ** 2))  # d(F/M)/dM = -a/M
    assert bound.single[0] == pytest.approx(expected, rel=0.1)


def test_sensitivities_hang_on_neither_the_twin_s_past_nor_the_other_parameters():
    twin = Twin(Vehicle.load("suv"))
    twin.set_parameters(np.array([100.0, *np.zeros(len(PARAMETERS) - 1)]))
    twin.reset(30.0)
    drive = CASE.plant.clean(SHORT)
    both = sensitivities(twin, drive, ["cm_x", "mass"], CASE.load(), speed=0.0)
    assert both.shape == (2, len(drive), len(OUTPUTS))
    assert (both[1] == short_sensitivity("mass")[0]).all()


@pytest.mark.parametrize(
    ("parameters", "at", "message"),
    [
        (["weight"], {}, "parameter 'weight' is unknown; allowed: mass"),
        (["mass"], {"Jzz": 9000.0}, "allowed: of a rigid body"),
    ],
)
def test_parameter_that_cannot_be_set_is_refused(parameters, at, message):
    with pytest.raises(TwinError, match=message):
        sensitivities(
            Twin(Vehicle.load("suv")),
            CASE.plant.clean(SHORT),
            parameters,
            at,
            speed=0.0,
        )


# Scenarios


def test_law_that_uses_all_of_its_channel_has_that_channel_s_bound():
    drive = CASE.plant.clean(SHORT)
    sensitivity, sd = short_sensitivity("mass"), noise_sd(drive.measurements, 10.0)
    paper, default = (
        law_limit(LAWS[name], sensitivity, drive, sd) for name in ("til-paper", "til")
    )
    assert paper == cramer_rao(["mass"], sensitivity, only(AX, sd[AX])).single[0]
    assert default > paper  # it rests at a standstill and fits an offset


def test_default_mass_law_comes_close_to_its_limit():
    errors, duration = [], 10.0
    for run in runs(mass.EXPERIMENT, range(20), duration, estimators=["til"]):
        _, drive, estimate = observe(run)
        errors.append(rms_pct(estimate["mass"], CASE.load()["mass"], drive.dt))
    rms = np.sqrt(np.mean(np.square(errors)))
    bound = limit(mass.EXPERIMENT, CASE, duration)["mass", "rms_pct"]
    assert rms == pytest.approx(bound, rel=0.5)  # 3 sd of 20 seeds


@pytest.mark.parametrize(
    "changes",
    [
        {"snr": np.inf},
        {"knows": ("mass",)},
        {"road_noise": 0.1},
        {"noise_on": "accelerations"},
    ],
    ids=["noiseless", "wrong CM", "noisy road", "coloured noise"],
)
def test_case_that_the_bound_does_not_fit_has_no_limit(changes):
    assert limit(mass.EXPERIMENT, replace(CASE, **changes), SHORT) == {}


@pytest.fixture(scope="module")
def mass_limits():
    return limits_of(mass.EXPERIMENT, duration=8.0)


@pytest.mark.parametrize("experiment", [laps.EXPERIMENT, lane_change.EXPERIMENT])
def test_limits_of_a_car_with_a_wrong_mass_are_in_percent_of_what_is_missing(experiment):
    result, text = limits_of(experiment, duration=4.0)
    rows = {(r.case, r.quantity, r.metric): r.median for r in result.rows}
    assert 0.0 < rows["all channels", "mass", "limit_single"] < 100.0
    assert np.isnan(rows["all channels", "Jzz", "limit_single"])  # nothing of it is missing
    assert ["mass", "kg", "350"] in [line.split()[:3] for line in text.splitlines()]


@pytest.mark.parametrize(
    ("experiment", "message"),
    [
        (truck.EXPERIMENT, "limits: truck has none; allowed: a simulated car"),
        (load_change.EXPERIMENT, "allowed: a car with a constant load"),
    ],
)
def test_drive_without_limits_is_named(experiment, message):
    with pytest.raises(TwinError, match=message):
        limits_of(experiment, duration=20.0)


def test_rows_are_in_percent_of_the_variation(mass_limits):
    rows = {(r.case, r.quantity, r.metric): r for r in mass_limits[0].rows}
    row = rows["ax alone, moving", "mass", "limit_single"]
    assert (row.estimator, row.unit, row.seeds) == ("cramer-rao", "%", 1)
    drive = CASE.plant.clean(8.0)
    moving = drive.truth["wheel_speed_fl"] >= 3.0
    sd = noise_sd(drive.measurements, 10.0)[AX]
    total = Twin(Vehicle.load("suv_loaded")).model.body_mass.sum()
    expected = total * sd / np.sqrt(np.sum(drive.channel("ax")[moving] ** 2))
    assert row.median == pytest.approx(100.0 * expected / 355.0, rel=0.1)


def test_more_channels_and_more_knowledge_make_bounds_smaller(mass_limits):
    rows = {(r.case, r.metric, r.quantity): r.median for r in mass_limits[0].rows}
    for name in UNITS:
        for case in ("all channels", "IMU"):
            single, joint = (rows[case, f"limit_{kind}", name] for kind in ("single", "joint"))
            assert single <= joint * (1.0 + 1e-9)
        for kind in ("limit_single", "limit_joint"):
            assert rows["all channels", kind, name] <= rows["IMU", kind, name] * (1.0 + 1e-9)
        assert rows["IMU", "limit_single", name] <= rows["ax alone, moving", "limit_single", name]


def test_text_shows_units_and_a_correlation_of_one_with_itself(mass_limits):
    lines = [line.split() for line in mass_limits[1].splitlines()]
    assert ["mass", "kg", "355"] in [line[:3] for line in lines]
    heading = lines.index(["all", "channels:", "correlation", "of", "the", "joint", "errors"]) + 1
    assert lines[heading] == list(UNITS)
    for i, name in enumerate(UNITS, 1):
        row = lines[heading + i]
        assert (row[0], len(row), row[i]) == (name, 8, "1.00")
