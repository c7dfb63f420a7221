from dataclasses import replace

import numpy as np
import pytest

from estimators.entry import Given
from estimators.registry import ESTIMATORS, make
from estimators.til.scheduled import ScheduledObserver
from estimators.til.scheduled_kernel import LARGEST_SLIP, Noise, _predict, _update
from scenarios.driving.manoeuvres import swept_steer
from scenarios.driving.record import record
from twin import OUTPUTS, Drive, Twin, TwinError, Vehicle

CAR = "ferrari_250lm"


def log_of(vehicle, seconds=12.0, amplitude=0.045, noise=True):
    """A drive of another car as a log has it: noisy, without torques, v_x measured."""
    manoeuvre = swept_steer(0.002, seconds, speed=25.0, amplitude=amplitude, highest=0.8)
    drive = record(vehicle, manoeuvre)
    rng, n = np.random.default_rng(0), len(drive)
    measurements = np.full((n, len(OUTPUTS) + 1), np.nan)
    for name, sd in (("ax", 0.2), ("ay", 0.3), ("yaw_rate", 0.005)):
        values = drive.channel(name) + noise * sd * rng.standard_normal(n)
        measurements[:, OUTPUTS.index(name)] = values
    measurements[:, -1] = drive.truth["vx"] + noise * 0.03 * rng.standard_normal(n)
    names = ("steering_wheel_angle", *(name for name in drive.input_names if "road" in name))
    return Drive(
        time=drive.time,
        inputs=np.column_stack([drive.channel(name) for name in names]),
        input_names=names,
        measurements=measurements,
        output_names=(*OUTPUTS, "vx"),
        truth={"sideslip": drive.truth["sideslip"]},
    )


@pytest.fixture(scope="module")
def other():
    """A car with less grip behind and softer tyres in front than the twin's files say."""
    return log_of(Vehicle.load(CAR).scaled(rear_cornering_stiffness=0.85, tyre_friction=0.95))


def observed(drive, vehicle=None, noise=None, **settings):
    observer = ScheduledObserver(Twin(vehicle or Vehicle.load(CAR)), None, noise, **settings)
    observer.reset(float(drive.channel("vx")[0]))
    return observer.run(drive)


def error_deg(estimate, drive):
    error = np.degrees(estimate.sideslip - drive.truth["sideslip"])
    return float(np.sqrt(np.mean(error[1000:] ** 2)))


def blind(drive):
    """The same without what corrects the lateral motion."""
    measurements = drive.measurements.copy()
    measurements[:, [OUTPUTS.index("ay"), OUTPUTS.index("yaw_rate")]] = np.nan
    return drive.replace(measurements=measurements)


def test_corrections_take_a_third_off_the_error_of_a_free_twin(other):
    free, corrected = observed(blind(other)), observed(other)
    assert error_deg(corrected, other) < 0.65 * error_deg(free, other)
    assert np.isfinite(corrected.states).all()
    assert len(corrected.sideslip) == len(other)


def test_covariance_of_a_model_that_grows_stays_positive():
    """As of a car that brakes at its limit: rounding errors must not become negative variances."""
    transition = np.eye(4)
    transition[:2, :2] = [[1.02, -0.5], [0.002, 1.01]]
    transition[:2, 2:] = [[1e-5, 1e-5], [1e-5, -1e-5]]
    p, noise = np.zeros((6, 6)), Noise(vy=0.1, rear=0.01)
    p[np.arange(4), np.arange(4)] = [0.25, 0.01, 2.4e5, 2.4e5]
    of_ay = np.array([-2.0, 0.1, 1e-3, 1e-3, 1.0, 0.0])
    of_yaw_rate = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    for _ in range(3000):
        _predict(p, transition, noise, 982.0, 0.1, 1.0, 0.01)
        _update(p, np.zeros(6), of_ay, 0.0, noise.ay**2 / 0.01)
        _update(p, np.zeros(6), of_yaw_rate, 0.0, noise.measured_yaw_rate**2 / 0.01)
        assert (p == p.T).all()
        assert (np.diag(p)[:4] > 0.0).all()
        scaled = p[:4, :4] / np.sqrt(np.outer(np.diag(p)[:4], np.diag(p)[:4]))
        assert np.linalg.eigvalsh(scaled)[0] > 0.0


def test_sensor_noise_does_not_spoil_a_twin_of_the_same_car():
    drive = log_of(Vehicle.load(CAR))
    assert error_deg(observed(drive), drive) < 0.25


def test_start_in_a_bend_knows_the_sideslip(other):
    """Of a drive that begins in a bend, the first second is not worse than the same one later."""
    ay = np.abs(other.channel("ay"))
    k = int(np.argmax(np.convolve(ay, np.full(500, 1.0 / 500), "valid")))
    rest = other[k:]
    whole, started = observed(other), observed(rest)
    truth = np.degrees(rest.truth["sideslip"])[:500]
    assert np.abs(truth).max() > 1.0
    of_whole = np.degrees(whole.sideslip)[k : k + 500] - truth
    of_started = np.degrees(started.sideslip)[:500] - truth
    assert np.sqrt(np.mean(of_started**2)) < np.sqrt(np.mean(of_whole**2)) + 0.2


def test_band_holds_most_errors(other):
    estimate = observed(other)
    error = np.abs(estimate.sideslip - other.truth["sideslip"])[1000:]
    assert np.mean(error < 2.0 * estimate.sideslip_sd[1000:]) > 0.85
    assert np.degrees(estimate.sideslip_sd[1000:].mean()) < 2.0


def test_too_little_grip_does_not_spin_the_twin():
    """A car that corners at more than a twin of friction 1.0 (.65 of its files) can."""
    drive = log_of(Vehicle.load(CAR), amplitude=0.07)
    assert np.abs(drive.channel("ay")).max() > 9.0
    estimate = observed(drive, Vehicle.load(CAR).scaled(tyre_friction=0.65))
    error = np.degrees(np.abs(estimate.sideslip - drive.truth["sideslip"]))
    assert error[estimate.trustworthy].max() < 4.0
    assert error.max() < 8.0
    held = ~estimate.trustworthy
    assert held.any()
    assert np.mean(error[held] < 2.0 * np.degrees(estimate.sideslip_sd[held])) > 0.9
    assert np.abs(estimate["roll"]).max() < 0.5
    for wheel in ("fl", "fr", "rl", "rr"):
        assert np.abs(estimate[f"slip_ratio_{wheel}"]).max() < 3.0 * LARGEST_SLIP


def test_missing_speed_is_bridged(other):
    holed = other.measurements.copy()
    holed[3000:3500, -1] = np.nan
    estimate = observed(other.replace(measurements=holed))
    assert error_deg(estimate, other) < 1.3 * error_deg(observed(other), other) + 0.05


def test_steering_of_the_wrong_sign_is_not_trusted(other):
    turned = other.inputs.copy()
    turned[:, 0] *= -1.0
    estimate, right = observed(other.replace(inputs=turned)), observed(other)
    assert right.trustworthy.mean() > 0.8
    assert estimate.trustworthy.mean() < 0.5
    assert "yaw rate" in estimate.reasons[2]


def test_levelled_acceleration_is_compared_with_a_levelled_one():
    """Gravity through roll taken out of the log: saying so brings the strapdown's estimate back."""
    drive = log_of(Vehicle.load(CAR), noise=False)
    roll = record(
        Vehicle.load(CAR), swept_steer(0.002, 12.0, speed=25.0, amplitude=0.045, highest=0.8)
    ).truth["roll"]
    ay = OUTPUTS.index("ay")
    levelled = drive.measurements.copy()
    levelled[:, ay] = levelled[:, ay] * np.cos(roll) - 9.81 * np.sin(roll)
    flat = drive.replace(measurements=levelled)
    strict = Noise(ay=0.01)
    wrong, right = observed(flat, noise=strict), observed(flat, noise=strict, levelled=True)
    assert error_deg(right, drive) < 0.5 * error_deg(wrong, drive)


def test_registry_makes_it_and_it_refuses_what_it_cannot_follow(other):
    assert ESTIMATORS["til-scheduled"].sd
    observer = make("til-scheduled", Given(vehicle=Vehicle.load(CAR)))
    with pytest.raises(TwinError, match="reset"):
        observer.run(other)
    observer.reset(25.0)
    slow = replace(other, time=other.time * 2.0)
    with pytest.raises(TwinError, match="twin steps"):
        observer.run(slow)
