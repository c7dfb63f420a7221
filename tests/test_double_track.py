import math

import numpy as np
import pytest

from estimators.benchmarks import double_track
from estimators.benchmarks.double_track import Gains, MagicFormula, _axle, friction, slips
from scenarios.driving.manoeuvres import Manoeuvre
from scenarios.driving.record import record
from scenarios.experiment import double_track_fit
from twin import OUTPUTS, TwinError, Vehicle

NONE = Gains(0.0, 0.0, 0.0, 0.0)
CAR = double_track.load(double_track_fit.path("sports_car"))
SPEED = 25.0


def turn(seconds=6.0, angle=0.25):
    n = round(seconds / 1e-3)
    ramp = angle * np.clip(np.arange(n) * 1e-3, 0.0, 1.0)
    manoeuvre = Manoeuvre(
        name="turn", dt=1e-3, speed=np.full(n, SPEED), steering=ramp, road=np.zeros((n, 4))
    )
    return record(Vehicle.load("sports_car"), manoeuvre)


@pytest.fixture(scope="module")
def drive():
    return turn()


def run(drive, gains=NONE, mass=0.0):
    return of_car(CAR, drive, gains, mass)


def of_car(car, drive, gains=NONE, mass=0.0):
    observer = double_track.DoubleTrackObserver(car, gains)
    observer.reset(SPEED, {"mass": mass})
    return observer.run(drive)


def test_magic_formula_has_slope_bcd_and_peak_d():
    curve = MagicFormula(10.0, 1.4, 1.2, 0.0)
    assert friction(curve, 1e-6) / 1e-6 == pytest.approx(10.0 * 1.4 * 1.2, rel=1e-6)
    peak = max(friction(curve, s) for s in np.linspace(0.0, 1.0, 1000))
    assert peak == pytest.approx(1.2, rel=1e-4)
    assert friction(curve, -0.05) == -friction(curve, 0.05)


def test_wheel_that_slides_to_the_right_is_pushed_to_the_left():
    _, alpha = slips(0.0, 0.0, 0.34, 0.0, math.nan, 20.0, -1.0, 0.0)
    assert alpha == pytest.approx(math.atan(1.0 / 20.0))
    # in the wheel's own frame: steered into its direction of travel it has no slip angle
    ratio, alpha = slips(1.5, 0.0, 0.34, 0.1, math.nan, 20.0, 20.0 * math.tan(0.1), 0.0)
    assert alpha == pytest.approx(0.0, abs=1e-12)
    assert ratio == 0.0


def test_slip_ratio_is_positive_under_drive_and_negative_under_brakes():
    fast, _ = slips(1.5, 0.8, 0.34, 0.0, 1.1 * 20.0 / 0.34, 20.0, 0.0, 0.0)
    slow, _ = slips(1.5, 0.8, 0.34, 0.0, 0.9 * 20.0 / 0.34, 20.0, 0.0, 0.0)
    assert fast == pytest.approx(0.1 / 1.1)
    assert slow == pytest.approx(-0.1)


def test_wheels_of_both_axles_carry_the_weight():
    """Loads show as longitudinal forces under one slip: four wheels at mu = constant."""
    flat = MagicFormula(1e6, 1.0, 1.0, 0.0)  # mu = 1 at any slip
    axles = [axle._replace(along=flat, lift_area=0.0) for axle in (CAR.front, CAR.rear)]
    state = np.array([20.0, 0.0, 0.0])
    for ax, ay in ((0.0, 0.0), (5.0, 0.0), (-8.0, 6.0)):
        total = 0.0
        for axle, other in (axles, axles[::-1]):
            spins = np.full(2, 1.2 * 20.0 / axle.radius)
            total += _axle(CAR, axle, other, 0.0, spins, state, CAR.mass, ax, ay)[0]
        assert total == pytest.approx(CAR.mass * double_track.GRAVITY, rel=1e-4)


def test_yaw_moment_is_that_of_the_forces_at_the_hubs():
    """TiL Eq. (28) with l_f in its fourth term, against the sum of x F_y - y F_x."""
    state, spins, angle = np.array([20.0, 0.6, 0.2]), np.array([60.0, 61.0]), 0.07
    axle = CAR.front._replace(roll_share=0.0)
    fx, fy, moment = _axle(CAR, axle, CAR.rear, angle, spins, state, CAR.mass, 1.0, 5.0)
    pressure = 0.5 * double_track.AIR_DENSITY * 20.0**2
    wheelbase = CAR.front.x - CAR.rear.x
    load = 0.5 * CAR.mass * (-double_track.GRAVITY * CAR.rear.x - CAR.height) / wheelbase
    load += 0.5 * pressure * axle.lift_area
    t, forces = 0.5 * axle.track, []
    for y, spin in ((t, spins[0]), (-t, spins[1])):
        ratio, alpha = slips(axle.x, y, axle.radius, angle, spin, *state)
        forces.append((load * friction(axle.along, ratio), load * friction(axle.across, alpha)))
    (x_l, y_l), (x_r, y_r) = forces
    c, s = math.cos(angle), math.sin(angle)
    printed = axle.x * (y_l + y_r) * c + t * (y_l - y_r) * s - t * (x_l - x_r) * c
    assert moment == pytest.approx(printed + axle.x * (x_l + x_r) * s)
    assert fx == pytest.approx((x_l + x_r) * c - (y_l + y_r) * s)
    assert fy == pytest.approx((x_l + x_r) * s + (y_l + y_r) * c)


def test_open_loop_follows_the_twin_through_a_turn(drive):
    found = run(drive)
    late = slice(-1000, None)
    for name in ("yaw_rate", "ay"):
        assert np.mean(found[name][late]) == pytest.approx(
            np.mean(drive.truth[name][late]), rel=0.1
        )
    own = np.degrees(np.arctan2(found["vy"], found["vx"])[late].mean())
    assert own == pytest.approx(np.degrees(drive.truth["sideslip"][late].mean()), abs=0.3)


def test_accelerations_do_not_depend_on_the_mass(drive):
    """Loads in proportion to the mass make forces in proportion to it: nothing to estimate from."""
    no_air = CAR._replace(
        drag_area=0.0,
        front=CAR.front._replace(lift_area=0.0),
        rear=CAR.rear._replace(lift_area=0.0),
    )
    light, heavy = (
        of_car(
            no_air._replace(yaw_inertia=CAR.yaw_inertia * (1.0 + mass / CAR.mass)), drive, mass=mass
        )
        for mass in (-300.0, 300.0)
    )
    np.testing.assert_allclose(light.outputs, heavy.outputs, atol=1e-9)
    with_air = [run(drive, mass=mass)["ax"] for mass in (-300.0, 300.0)]
    assert np.abs(with_air[0] - with_air[1]).max() > 1e-3  # drag keeps a trace


def test_missing_measurements_correct_nothing(drive):
    bare = drive.replace(measurements=np.where(np.arange(10) == 5, np.nan, drive.measurements))
    np.testing.assert_array_equal(run(bare, NONE._replace(yaw_rate=20.0)).states, run(drive).states)
    nothing = drive.replace(measurements=np.full_like(drive.measurements, np.nan))
    assert np.isfinite(run(nothing).states).all()


def test_gains_that_blow_it_up_are_one_error(drive):
    with pytest.raises(TwinError, match="the double track blew up at t ="):
        run(drive, NONE._replace(yaw_rate=3000.0))


def test_drive_of_something_else_is_refused(drive):
    with pytest.raises(TwinError, match="the double track needs"):
        run(drive.replace(measurements=drive.measurements[:, :9], output_names=OUTPUTS[:9]))


def test_file_that_is_no_double_track_is_named(tmp_path):
    (tmp_path / "car.toml").write_text("mass = 3.0\n")
    with pytest.raises(TwinError, match=r"car\.toml: describes no double track"):
        double_track.load(tmp_path / "car.toml")
