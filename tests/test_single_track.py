import numpy as np
import pytest

from estimators.benchmarks import single_track
from estimators.benchmarks.single_track import START, Geometry
from twin import Drive

CAR = Geometry(mass=1000.0, front=1.3, rear=1.1, yaw_inertia=1300.0)
DT = 0.005
OPEN = START._replace(yaw_gain=0.0)


def drive(yaw_rate):
    n = len(yaw_rate)
    return Drive(
        time=np.arange(n) * DT,
        inputs=np.zeros((n, 1)),
        input_names=("steering_wheel_angle",),
        measurements=np.asarray(yaw_rate)[:, None],
        output_names=("yaw_rate",),
    )


def unmeasured(n):
    return drive(np.full(n, np.nan))


def test_small_steady_steer_gives_the_closed_form():
    """beta = l_r r/v - m l_f v r/(L C_r), r = v delta/(L + m v^2 (l_r/C_f - l_f/C_r)/L)."""
    n, v, delta = 2000, 20.0, 0.002
    found = single_track.predict(OPEN, CAR, np.full(n, delta), unmeasured(n), np.full(n, v))
    wheelbase = CAR.front + CAR.rear
    weight = CAR.mass * single_track.GRAVITY / wheelbase
    front, rear = 20.0 * weight * CAR.rear, 25.0 * weight * CAR.front
    gradient = CAR.mass * (CAR.rear / front - CAR.front / rear) / wheelbase
    r = v * delta / (wheelbase + gradient * v**2)
    beta = CAR.rear * r / v - CAR.mass * CAR.front * v * r / (wheelbase * rear)
    assert found[-1] == pytest.approx(beta, rel=2e-3)


def test_left_and_right_mirror():
    t = np.arange(1000) * DT
    delta, speed = 0.05 * np.sin(3.0 * t), np.full(1000, 25.0)
    left = single_track.predict(OPEN, CAR, delta, unmeasured(1000), speed)
    right = single_track.predict(OPEN, CAR, -delta, unmeasured(1000), speed)
    np.testing.assert_allclose(right, -left, atol=1e-15)


def test_axle_force_stays_below_friction():
    n = 2000
    found = single_track.predict(
        OPEN._replace(front_friction=0.8), CAR, np.full(n, 0.1), unmeasured(n), np.full(n, 20.0)
    )
    curve = np.abs(np.diff(found)).max() / DT
    assert np.isfinite(found).all()
    assert curve < 1.3 * single_track.GRAVITY  # rad/s: no more than a_y over 10 m/s and a turn


def test_measured_yaw_rate_is_followed():
    """A car with a wrong front axle takes the measured yaw rate, and the slip that goes with it."""
    n, v = 3000, 20.0
    right = np.full(n, 0.02)
    truth = single_track.predict(OPEN, CAR, right, unmeasured(n), np.full(n, v))
    wrong = OPEN._replace(front_stiffness=15.0)
    rate = v * 0.02 / (CAR.front + CAR.rear + 0.0025 * v**2)
    free = single_track.predict(wrong, CAR, right, unmeasured(n), np.full(n, v))
    held = single_track.predict(
        wrong._replace(yaw_gain=30.0), CAR, right, drive(np.full(n, rate)), np.full(n, v)
    )
    assert abs(held[-1] - truth[-1]) < abs(free[-1] - truth[-1])


def test_fit_recovers_the_numbers_that_made_the_sideslip():
    t = np.arange(4000) * DT
    delta, speed = 0.035 * np.sin(1.5 * t + 0.1 * t**1.5), 22.0 + 3.0 * np.sin(0.4 * t)
    true = START._replace(
        front_stiffness=17.0, rear_stiffness=21.0, rear_friction=1.15, yaw_gain=0.0,
        relaxation=0.6, sideslip_offset=0.003,
    )  # fmt: skip
    sideslip = single_track.predict(true, CAR, delta, unmeasured(4000), speed)
    found = single_track.fit(CAR, delta, unmeasured(4000), speed, sideslip)
    for name in ("front_stiffness", "rear_stiffness", "rear_friction", "relaxation"):
        assert getattr(found, name) == pytest.approx(getattr(true, name), rel=0.03), name
    assert found.sideslip_offset == pytest.approx(0.003, abs=1e-4)
