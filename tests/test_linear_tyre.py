"""The linear tyre against closed forms."""

import numpy as np
import pytest
from cars import inputs, run

import models
from twin import Twin, TwinError, Vehicle
from twin.tyre.files import read_tyre_file
from twin.tyre.interface import forces, relaxation, stiffness
from twin.tyre.magic_formula import magic_formula
from twin.tyre.radius import effective_radius

LINEAR = read_tyre_file(models.path("tyres/linear.toml"))
TEXT = models.path("tyres/linear.toml").read_text()


def at(fz, *, kappa=0.0, alpha=0.0, gamma=0.0, vx=20.0, side=1.0, tyre=LINEAR):
    return np.array(forces(tyre, fz, kappa, alpha, gamma, vx, side))


def changed(**values):
    tyre = np.array(LINEAR)
    for name, value in values.items():
        tyre[name] = value
    return tyre[()]


@pytest.mark.parametrize("fz", [500.0, 3000.0, 9000.0])
def test_forces_below_the_limit_are_stiffness_times_slip(fz):
    out = at(fz, kappa=0.01, alpha=-0.02)
    assert out[0] == pytest.approx(20.0 * fz * 0.01, rel=1e-12)
    assert out[1] == pytest.approx(15.2 * fz * 0.02, rel=1e-12)
    assert out[4] == pytest.approx(-0.035 * out[1], rel=1e-12)
    assert stiffness(LINEAR, fz, 0.0) == pytest.approx((20.0 * fz, 15.2 * fz))


def test_force_beyond_the_limit_lies_on_the_friction_circle():
    for kappa, alpha in ((0.3, 0.0), (0.0, -0.4), (0.2, 0.3), (-1e6, 1.5)):
        fx, fy = at(4000.0, kappa=kappa, alpha=alpha)[:2]
        assert np.hypot(fx, fy) == pytest.approx(4000.0, rel=1e-12)
        assert fy * 20.0 * kappa == pytest.approx(-fx * 15.2 * alpha, rel=1e-9, abs=1e-6)


def test_factors_of_a_tyre_file_scale_it():
    slippery = changed(lmux=0.5, lmuy=0.5)
    assert np.hypot(*at(4000.0, kappa=0.3, alpha=0.1, tyre=slippery)[:2]) == pytest.approx(2000.0)
    soft = changed(lky=0.7, lkx=1.2)
    assert stiffness(soft, 1000.0, 0.0) == pytest.approx((24e3, 0.7 * 15.2e3))
    late = changed(lsgkp=2.0, lsgal=3.0)
    assert relaxation(late, 1000.0, 0.0) == pytest.approx((0.4, 3 * 0.47))


def test_rolling_resistance_opposes_the_motion():
    assert at(4000.0, vx=10.0)[3] == pytest.approx(-0.01 * 4000.0 * 0.369)
    assert at(4000.0, vx=-10.0)[3] == pytest.approx(0.01 * 4000.0 * 0.369)


def test_rolling_radius_lacks_a_third_of_the_deflection():
    assert effective_radius(LINEAR, 5200.0) == pytest.approx(0.369 - 0.02 / 3.0)


def test_wheel_without_load_has_no_force():
    assert np.all(at(0.0, kappa=0.1, alpha=0.2) == 0.0)
    assert np.all(at(-10.0, kappa=0.1, alpha=0.2) == 0.0)


@pytest.fixture
def car(tmp_path):
    """A function that loads the SUV on these tyres."""

    def load(front, rear):
        text = f"[tyre.front]\nfile = '{front}'\n[tyre.rear]\nfile = '{rear}'\n"
        (tmp_path / "car.toml").write_text(text)
        return Vehicle.load(tmp_path / "car.toml")

    return load


def test_car_on_linear_tyres_turns_like_the_single_track_model(car):
    """Stiffness in proportion to load makes it neutral: the path has the wheels' radius."""
    twin = Twin(car("tyres/linear.toml", "tyres/linear.toml"))
    twin.reset(15.0)
    made = run(twin, inputs(3.0, steering=0.16))
    speed, yaw_rate = made.states[-1, 14], made.states[-1, 19]
    assert yaw_rate == pytest.approx(speed * 0.16 / 16.0 / 2.9, rel=0.03)


def test_car_may_have_a_tyre_of_each_model(car):
    vehicle = car("tyres/linear.toml", "tyres/suv.tir")
    twin = Twin(vehicle)
    twin.reset(20.0)
    made = run(twin, inputs(1.0, steering=0.5))
    speed, models_ = made.states[-1, 14], (forces, forces, magic_formula, magic_formula)
    for wheel, (tyre, side, model) in enumerate(
        zip(vehicle.tyres(), (1.0, -1.0, 1.0, -1.0), models_, strict=True)
    ):
        fx, fy, fz, *_, kappa, alpha, camber = made.tyres[-1, wheel]
        alone = model(tyre, fz, kappa, alpha, camber, speed, side)
        np.testing.assert_allclose((fx, fy), alone[:2], rtol=1e-9, atol=1e-6)


def test_car_on_linear_tyres_comes_to_rest(car):
    twin = Twin(car("tyres/linear.toml", "tyres/linear.toml"))
    twin.reset(8.0)
    made = run(twin, inputs(5.0, brake=600.0))
    assert np.abs(made.states[-1, 14:17]).max() < 1e-3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "model is missing; allowed: linear"),
        (TEXT.replace('"linear"', '"brush"'), "model is 'brush'; allowed: linear"),
        (TEXT.replace("friction = 1.0", ""), "friction is missing; allowed: a number from 0.01"),
        (TEXT.replace("slip = 20.0", "slip = -20.0"), "slip is -20.0; allowed: a number from 1"),
        (TEXT + "camber = 1\n", "camber is unknown; allowed: model, unloaded_radius"),
    ],
)
def test_fault_of_a_tyre_is_one_line_that_names_it(tmp_path, text, message):
    path = tmp_path / "tyre.toml"
    path.write_text(text)
    with pytest.raises(TwinError) as caught:
        read_tyre_file(path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_figures_beside_a_tyre_that_is_no_tir_file_are_refused(tmp_path):
    path = tmp_path / "car.toml"
    path.write_text('[tyre.front]\nfile = "tyres/linear.toml"\nfriction = 0.9\n')
    with pytest.raises(TwinError, match=r"tyre\.front\.friction does not apply"):
        Vehicle.load(path)
