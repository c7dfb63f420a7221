"""The joint observer's budget of model error."""

import numpy as np
import pytest

from estimators.joint import evidence
from estimators.joint.evidence import FULL, LENGTH, SEGMENTS, USED
from estimators.joint.model_error import DIFFERS, budget
from estimators.joint.observer import JointObserver, JointSettings
from estimators.joint.state import NY
from estimators.joint.validity import REASONS
from scenarios.driving.joint_drives import mixed
from scenarios.experiment.joint import case
from scenarios.plants.random_car import random_car
from scenarios.plants.real_record import record_real
from scenarios.plants.real_sensors import told
from twin import Vehicle, noise_sd

SD = np.array([0.5] * 3 + [0.02] * 3 + [0.05] * 4)
TWO = ("mass", "Jzz")


@pytest.fixture
def observer():
    return JointObserver(
        Vehicle.load("suv"), SD, JointSettings(parameters=TWO, sensor_errors=("bias_ax",))
    )


def feed(observer, blocks, noise, truth):
    """Gives linear measurements of three unknowns, of unit variance, to the observer's evidence."""
    rng = np.random.default_rng(0)
    config, state = observer._config, observer._state
    h = rng.normal(size=(blocks, NY, 3))
    m = h @ truth + noise
    for k in range(blocks):
        evidence.add_evidence(config, state, h[k], m[k] - h[k] @ state.z, np.ones(NY))
        evidence.merge_segments(state)
    return h, m


def weigh(observer, seconds=10.0):
    state, prior = observer._state, observer._prior
    return budget(state, prior, state.prior_mean, state.prior_covariance, None, seconds)


def test_white_noise_gives_least_squares_and_its_covariance(observer):
    truth = np.array([1.0, -2.0, 0.02])
    noise = np.random.default_rng(1).normal(size=(3000, NY))
    h, m = feed(observer, 3000, noise, truth)
    found = weigh(observer)
    assert found.noise_factor.max() < DIFFERS
    weights = 1.0 / found.noise_factor
    information = np.einsum("kja,j,kjb->ab", h, weights, h) + np.diag(observer._prior**-2.0)
    wanted = np.linalg.solve(information, np.einsum("kja,j,kj->a", h, weights, m))
    assert found.z == pytest.approx(wanted, rel=1e-9)
    assert found.covariance == pytest.approx(np.linalg.inv(information), rel=1e-9)
    assert np.abs(found.z - truth).max() < 4.0 * np.sqrt(np.diag(found.covariance).max())
    assert np.nanmax(found.whiteness) < DIFFERS


def test_noise_that_lasts_is_seen_on_the_scale_on_which_it_lasts(observer):
    rng = np.random.default_rng(2)
    noise = rng.normal(size=(3000, NY))
    noise[:, 3] += np.repeat(rng.normal(size=30), 100)  # a second each
    feed(observer, 3000, noise, np.zeros(3))
    found = weigh(observer)
    assert found.whiteness[2, 3] == pytest.approx(101.0, rel=0.7)
    assert np.delete(found.noise_factor, 3).max() < DIFFERS
    assert found.noise_factor[3] == found.whiteness[:, 3].max()


def test_parts_of_a_drive_that_disagree_widen_the_interval(observer):
    """The unknown changes from segment to segment by ten of its standard deviations."""
    rng = np.random.default_rng(3)
    length = int(observer._state.evidence[LENGTH])
    blocks = 8 * length
    h = rng.normal(size=(blocks, NY, 3))
    levels = np.repeat(rng.normal(size=8), length)
    for k in range(blocks):
        m = h[k] @ np.array([levels[k], 0.0, 0.0]) + rng.normal(size=NY)
        evidence.add_evidence(
            observer._config, observer._state, h[k], m - h[k] @ observer._state.z, np.ones(NY)
        )
    found = weigh(observer)
    sd = np.sqrt(found.widening * found.covariance[0, 0])
    assert sd == pytest.approx(np.std(levels) / np.sqrt(8), rel=1.0)
    assert abs(found.z[0] - levels.mean()) < 3.0 * sd


def test_memory_does_not_grow_and_nothing_is_lost(observer):
    length = int(observer._state.evidence[LENGTH])
    blocks = 40 * length
    feed(observer, blocks, np.zeros((blocks, NY)), np.array([1.0, -2.0, 0.01]))
    state = observer._state
    assert state.evidence[USED] == blocks
    assert SEGMENTS // 2 <= state.evidence[FULL] < SEGMENTS
    assert state.evidence[LENGTH] > length
    assert weigh(observer).z == pytest.approx([1.0, -2.0, 0.01], rel=1e-3)


@pytest.fixture(scope="module")
def clean():
    return case("mixed", "same").plant.clean(16.0)


def test_nothing_is_claimed_before_parts_of_the_drive_can_be_compared(clean):
    observer = JointObserver(Vehicle.load("suv"), SD, JointSettings(parameters=TWO))
    observer.reset(float(clean.truth["vx"][0]), road=clean.inputs[0, 9:13])
    assert "Nothing is known yet" in observer.notes()[0]
    found = observer.run(clean)
    mass = found.sd_of("mass")
    assert mass[0] == observer._prior[0]
    assert mass[-1] < 0.2 * mass[0]
    early = ~found.valid_of("mass")
    assert early[: round(8.0 / clean.dt)].all()
    assert found.reason_of("mass", 0) == REASONS[1]
    assert not early[-1]


def test_estimate_on_its_bound_is_not_valid(clean):
    observer = JointObserver(Vehicle.load("suv"), SD, JointSettings(parameters=("mass", "damper")))
    observer.reset(float(clean.truth["vx"][0]), road=clean.inputs[0, 9:13])
    found = observer.run(clean.between(clean.time[0], clean.time[0] + 1.0))
    assert found.reason_of("damper")  # too early
    assert not found.valid_of("damper").any()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [300, 301])
def test_car_that_differs_in_everything_is_never_trusted_and_wrong(seed):
    drive = told(
        record_real(Vehicle.load("suv_loaded"), random_car(seed), mixed(duration=40.0)),
        random_car(seed), 20.0, np.random.default_rng(seed), (),
    )  # fmt: skip
    sd = noise_sd(drive.measurements, 20.0)
    observer = JointObserver(Vehicle.load("suv"), sd)
    observer.reset(float(drive.truth["vx"][0]))
    found = observer.run(drive)
    assert any("differs from its twin" in note for note in found.notes)
    nominal = Vehicle.load("suv").chassis()
    truth = {"mass": drive.truth["mass"][-1] - nominal.mass}
    truth |= {f"cm_{a}": drive.truth[f"cm_{a}"][-1] - nominal.cm[i] for i, a in enumerate("xyz")}
    for name, value in truth.items():
        if found.valid_of(name)[-1]:
            assert abs(found[name][-1] - value) < 3.0 * found.sd_of(name)[-1], name
