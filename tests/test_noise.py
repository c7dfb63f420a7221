import numpy as np
import pytest

from twin.channels import OUTPUTS
from twin.errors import TwinError
from twin.logs.drive import Drive
from twin.noise import noise_sd, with_noise

SAMPLES = 20_000


def make_drive(measurements, names=OUTPUTS, **changes):
    content = {
        "time": np.arange(len(measurements)) * 1e-3,
        "inputs": np.zeros((len(measurements), 1)),
        "input_names": ("steering_wheel_angle",),
        "measurements": measurements,
        "output_names": names,
        "truth": {"vx": np.linspace(0.0, 1.0, len(measurements))},
        "settings": {"seed": 1},
    }
    return Drive(**(content | changes))


def sines(amplitudes):
    phase = 2.0 * np.pi * 5.0 * np.arange(SAMPLES) / SAMPLES
    return np.outer(np.sin(phase), amplitudes)


def test_sd_of_a_sine_is_its_rms_over_the_ratio():
    sd = noise_sd(sines(np.full(10, 2.0)), 20.0)
    np.testing.assert_allclose(sd[:6], 2.0 / np.sqrt(2.0) / 10.0, rtol=1e-12)


def test_gravity_is_no_signal():
    signal = sines(np.full(10, 2.0))
    np.testing.assert_allclose(noise_sd(signal + 9.81, 10.0), noise_sd(signal, 10.0), rtol=1e-9)


def test_channel_at_rest_keeps_the_floor():
    expected = [0.05] * 3 + [0.003] * 3 + [0.05] * 4
    np.testing.assert_array_equal(noise_sd(np.ones((100, 10)), 10.0), expected)


def test_wheel_speed_noise_does_not_follow_the_signal():
    np.testing.assert_array_equal(noise_sd(sines(np.full(10, 100.0)), 5.0)[6:], 0.05)


def test_infinite_ratio_means_no_noise_at_all():
    drive = make_drive(sines(np.ones(10)))
    np.testing.assert_array_equal(noise_sd(drive.measurements, np.inf), 0.0)
    noisy = with_noise(drive, np.inf, np.random.default_rng(0))
    np.testing.assert_array_equal(noisy.measurements, drive.measurements)


def test_channels_are_told_apart_by_name_in_any_order():
    names = ("wheel_speed_rr", "yaw_rate", "az")
    np.testing.assert_array_equal(noise_sd(np.zeros((9, 3)), 10.0, names), [0.05, 0.003, 0.05])
    signal = sines([4.0, 2.0])
    np.testing.assert_array_equal(
        noise_sd(signal, 10.0, ("yaw_rate", "ax")),
        noise_sd(signal[:, ::-1], 10.0, ("ax", "ay"))[::-1],
    )


def test_missing_samples_do_not_count_and_stay_missing():
    signal = sines(np.full(10, 2.0))
    gappy = np.vstack([signal, np.full((500, 10), np.nan)])
    np.testing.assert_allclose(noise_sd(gappy, 10.0), noise_sd(signal, 10.0), rtol=1e-12)
    noisy = with_noise(make_drive(gappy), 10.0, np.random.default_rng(0))
    np.testing.assert_array_equal(np.isnan(noisy.measurements), np.isnan(gappy))


def test_channel_that_nothing_provides_stays_missing():
    signal = sines(np.full(10, 2.0))
    signal[:, 1] = np.nan
    noisy = with_noise(make_drive(signal), 10.0, np.random.default_rng(0))
    assert np.isnan(noisy.channel("ay")).all()
    assert noisy.settings["noise_sd"]["ay"] == 0.05


def test_noise_is_white_normal_and_of_the_sd_in_the_settings():
    drive = make_drive(sines(np.full(10, 2.0)))
    noisy = with_noise(drive, 10.0, np.random.default_rng(0))
    noise = noisy.measurements - drive.measurements
    sd = np.array([noisy.settings["noise_sd"][name] for name in OUTPUTS])
    # Bounds are 5 standard errors.
    np.testing.assert_allclose(noise.std(axis=0), sd, rtol=5.0 / np.sqrt(2.0 * SAMPLES))
    np.testing.assert_array_less(np.abs(noise.mean(axis=0)), 5.0 * sd / np.sqrt(SAMPLES))
    lagged = (noise[1:] * noise[:-1]).mean(axis=0) / sd**2
    np.testing.assert_array_less(np.abs(lagged), 5.0 / np.sqrt(SAMPLES))
    across = np.corrcoef(noise.T) - np.eye(10)
    np.testing.assert_array_less(np.abs(across), 5.0 / np.sqrt(SAMPLES))


def test_noise_touches_measurements_and_settings_only():
    drive = make_drive(sines(np.ones(10)))
    noisy = with_noise(drive, 10.0, np.random.default_rng(0))
    np.testing.assert_array_equal(noisy.inputs, drive.inputs)
    np.testing.assert_array_equal(noisy.truth["vx"], drive.truth["vx"])
    assert noisy.settings["seed"] == 1
    assert noisy.settings["snr"] == 10.0


def test_one_seed_gives_one_noise_scaled_by_the_ratio():
    drive = make_drive(sines(np.full(10, 50.0)))
    noises = [
        with_noise(drive, snr, np.random.default_rng(4)).measurements - drive.measurements
        for snr in (10.0, 30.0)
    ]
    np.testing.assert_allclose(noises[0][:, :6], 10.0 * noises[1][:, :6], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("snr", [np.nan, -np.inf])
def test_ratio_that_is_none_is_an_error(snr):
    with pytest.raises(TwinError, match=r"snr_db is .*, must be a number of dB or inf"):
        noise_sd(np.zeros((9, 10)), snr)


def test_channel_without_noise_model_is_named():
    with pytest.raises(TwinError, match="channel 'gps_speed' has no noise model, only ax, ay"):
        noise_sd(np.zeros((9, 1)), 10.0, ("gps_speed",))
