import numpy as np
import pytest

from scenarios.driving.manoeuvres import swept_steer
from scenarios.driving.record import record
from scenarios.plants.mismatch import MISMATCHES, real_drive, real_vehicle
from scenarios.plants.sensors import Sensors, measured
from twin import BRAKE_TORQUES, DRIVE_TORQUES, OUTPUTS, Drive, TwinError, Vehicle

INFINITE = float("inf")


@pytest.fixture(scope="module")
def clean():
    return record(Vehicle.load("suv"), swept_steer(duration=6.0))


def faulty(clean, snr=INFINITE, seed=0, **faults):
    return measured(clean, Sensors(**faults), snr, np.random.default_rng(seed))


def test_perfect_sensors_change_nothing(clean):
    assert np.array_equal(faulty(clean).measurements, clean.measurements)


def test_displaced_imu_measures_what_one_mounted_there_does(clean, tmp_path):
    r = np.array([0.3, -0.2, 0.1])
    seen = faulty(clean, position=tuple(r)).measurements
    # the free motion of a point of the body, from positions alone: x + R r, differentiated twice
    roll, pitch, yaw = (clean.truth[n] for n in ("roll", "pitch", "yaw"))
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    turn = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    moved = np.einsum("ijn,j->ni", turn, r)
    world = np.gradient(np.gradient(moved, clean.dt, axis=0), clean.dt, axis=0)
    body = np.einsum("jin,nj->ni", turn, world)
    got = seen[:, :3] - clean.measurements[:, :3]
    scale = np.abs(got).max()
    assert scale > 0.1
    np.testing.assert_allclose(got[100:-100], body[100:-100], atol=0.03 * scale)


def test_delay_shifts_measurements_and_nothing_else(clean):
    late = faulty(clean, delay=0.02)
    assert np.array_equal(late.measurements[20:], clean.measurements[:-20])
    assert np.array_equal(late.inputs, clean.inputs)


def test_coloured_noise_has_the_variance_of_white_and_its_correlation(clean):
    noise = faulty(clean, snr=10.0, correlation_time=0.02).measurements - clean.measurements
    white = faulty(clean, snr=10.0).measurements - clean.measurements
    ay = OUTPUTS.index("ay")
    assert noise[:, ay].std() == pytest.approx(white[:, ay].std(), rel=0.15)
    lagged = np.corrcoef(noise[20:, ay], noise[:-20, ay])[0, 1]
    assert lagged == pytest.approx(np.exp(-1.0), abs=0.15)


def test_bias_and_digits_are_those_named(clean):
    seen = faulty(
        clean, acceleration_bias=(0.0, 0.2, 0.0), rate_bias=(0.0, 0.0, 0.01), wheel_speed_step=0.5
    )
    change = (seen.measurements - clean.measurements)[:, :6].mean(axis=0)
    np.testing.assert_allclose(change, [0.0, 0.2, 0.0, 0.0, 0.0, 0.01], atol=1e-12)
    assert not np.any(seen.measurements[:, 6:] % 0.5)


def test_settings_name_the_noise(clean):
    noisy = faulty(clean, snr=10.0)
    assert noisy.settings["snr"] == 10.0
    assert set(noisy.settings["noise_sd"]) == set(OUTPUTS)


def test_drive_of_another_vehicle_is_refused():
    other = Drive(
        time=np.arange(5.0),
        inputs=np.zeros((5, 1)),
        input_names=("force",),
        measurements=np.zeros((5, 1)),
        output_names=("ax",),
    )
    with pytest.raises(TwinError, match="sensors: drive has"):
        faulty(other)


def test_torques_known_are_those_that_act_over_their_share(clean):
    rng = np.random.default_rng(0)
    told = real_drive(clean, MISMATCHES["drive-5"], INFINITE, rng)
    np.testing.assert_allclose(0.95 * told.inputs[:, DRIVE_TORQUES], clean.inputs[:, DRIVE_TORQUES])
    assert np.array_equal(told.inputs[:, BRAKE_TORQUES], clean.inputs[:, BRAKE_TORQUES])


def test_mismatched_vehicle_has_the_scales_named():
    real = real_vehicle(Vehicle.load("suv"), MISMATCHES["mismatched"])
    assert dict(real.scales)["tyre_friction"] == 0.92
    assert real_vehicle(real, MISMATCHES["same"]) == real
