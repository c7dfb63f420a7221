import math

import numpy as np
import pytest

from estimators.benchmarks import bicycle_ekf
from estimators.benchmarks.bicycle_ekf import Bicycle, fit_filter, run
from twin import Drive, TwinError

CAR = Bicycle(mass=1200.0, front=1.3, rear=1.3, yaw_inertia=1700.0)
QUIET = CAR._replace(log_vy=math.log(0.03), log_side=math.log(0.1), log_turn=math.log(0.05))
DT, NAMES = 0.01, ("vx", "ax", "ay", "yaw_rate")


def drive_of(steering, measurements, sideslip):
    return Drive(
        time=np.arange(len(steering)) * DT,
        inputs=steering[:, None],
        input_names=("steering_wheel_angle",),
        measurements=measurements,
        output_names=NAMES,
        truth={"sideslip": sideslip},
    )


def simulated(car, seconds=40.0, seed=0, speed=20.0, steer=0.03):
    """A bicycle of this module's docstring, written anew, under its own noises."""
    rng, parts = np.random.default_rng(seed), 10
    n, h = round(seconds / DT), DT / 10
    t = np.arange(n) * DT
    steering = steer * np.sin(1.5 * t) + 0.5 * steer * np.sin(4.1 * t + 1.0)
    weight = car.mass * 9.81 / (car.front + car.rear)
    loads = weight * car.rear, weight * car.front
    density = np.exp([car.log_vy, car.log_yaw, car.log_side, car.log_turn])
    vy = r = d = w = 0.0
    rows, sideslip = np.empty((n, 4)), np.empty(n)
    for k in range(n):
        for i in range(parts + 1):
            slips = (
                steering[k] - math.atan((vy + car.front * r) / speed),
                -math.atan((vy - car.rear * r) / speed),
            )
            front, rear = (
                mu * load * math.sin(1.3 * math.atan(c / (1.3 * mu) * slip))
                for mu, load, c, slip in zip(
                    (car.front_friction, car.rear_friction),
                    loads,
                    (car.front_stiffness, car.rear_stiffness),
                    slips,
                    strict=True,
                )
            )
            front *= math.cos(steering[k])
            side = (front + rear) / car.mass + d
            if i == 0:
                rows[k] = speed, 0.0, side, r
                sideslip[k] = math.atan2(vy, speed)
                continue
            noise = rng.standard_normal(4) * density * math.sqrt(h)
            turn = (car.front * front - car.rear * rear) / car.yaw_inertia + w
            vy += h * (side - speed * r) + noise[0]
            r += h * turn + noise[1]
            d += -h * d / car.side_time + noise[2]
            w += -h * w / car.turn_time + noise[3]
    rows[:, 2] += rng.standard_normal(n) * math.exp(car.log_ay) / math.sqrt(DT)
    rows[:, 3] += rng.standard_normal(n) * car.yaw_rate_noise / math.sqrt(DT)
    return drive_of(steering, rows, sideslip)


def test_errors_are_as_large_as_the_filter_says():
    """On a car that is the model, under its noises: errors in standard deviations are normal."""
    scaled = []
    for seed in range(4):
        drive = simulated(CAR, seed=seed)
        found = run(CAR, drive)
        scaled.append((found.sideslip - drive.truth["sideslip"])[200:] / found.sd[200:])
    assert np.std(scaled) == pytest.approx(1.0, abs=0.25)
    assert np.mean(np.abs(scaled) < 2.0) == pytest.approx(0.95, abs=0.05)


def test_small_steady_steer_gives_the_closed_form():
    """beta = l_r r/v - m l_f v r/(L C_r), r = v delta/(L + m v^2 (l_r/C_f - l_f/C_r)/L)."""
    n, v, delta = 1500, 20.0, 0.002
    unmeasured = np.full((n, 4), np.nan)
    unmeasured[:, 0] = v
    found = run(CAR, drive_of(np.full(n, delta), unmeasured, np.zeros(n)))
    wheelbase = CAR.front + CAR.rear
    weight = CAR.mass * 9.81 / wheelbase
    front, rear = CAR.front_stiffness * weight * CAR.rear, CAR.rear_stiffness * weight * CAR.front
    gradient = CAR.mass * (CAR.rear / front - CAR.front / rear) / wheelbase
    r = v * delta / (wheelbase + gradient * v**2)
    beta = CAR.rear * r / v - CAR.mass * CAR.front * v * r / (wheelbase * rear)
    assert found.sideslip[-1] == pytest.approx(beta, rel=2e-3)


def test_corrections_beat_the_open_model_of_a_wrong_car():
    drive = simulated(CAR)
    wrong = CAR._replace(front_stiffness=15.0, rear_stiffness=18.0)
    blind = drive.replace(measurements=np.where([1, 1, 0, 0], drive.measurements, np.nan))
    errors = [
        np.sqrt(np.mean((run(wrong, d).sideslip - drive.truth["sideslip"]) ** 2))
        for d in (drive, blind)
    ]
    assert errors[0] < 0.85 * errors[1]


def test_missing_speed_is_bridged():
    drive = simulated(CAR, seconds=10.0)
    holed = drive.measurements.copy()
    holed[300:400, 0] = np.nan
    found = run(CAR, drive.replace(measurements=holed))
    np.testing.assert_allclose(found.sideslip, run(CAR, drive).sideslip, atol=1e-12)


def test_fit_finds_the_car_and_its_band():
    start = QUIET._replace(front_stiffness=26.0, rear_stiffness=19.0)
    free = ("front_stiffness", "rear_stiffness")

    fitted, found = fit_filter(start, [simulated(QUIET, 20.0, s) for s in (1, 2, 3)], free)
    assert abs(fitted.rear_stiffness - CAR.rear_stiffness) < 0.6 * (CAR.rear_stiffness - 19.0)
    assert (found.low < found.high).all()
    drive = simulated(QUIET, seed=5)
    estimate = run(fitted, drive)
    error = np.abs(estimate.sideslip - drive.truth["sideslip"])
    assert 0.75 < np.mean(error < 2.0 * estimate.sd) <= 1.0


def test_unknown_names_and_drives_without_speed_are_refused():
    drive = simulated(CAR, seconds=1.0)
    with pytest.raises(TwinError, match="front_stiffness"):
        fit_filter(CAR, [drive], ("stiffness",))
    without = drive.replace(
        measurements=drive.measurements[:, 1:].copy(), output_names=NAMES[1:], truth={}
    )
    with pytest.raises(TwinError, match="vx"):
        run(CAR, without)
    assert set(bicycle_ekf.FREE) <= set(Bicycle._fields)
