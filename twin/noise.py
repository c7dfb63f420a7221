"""Sensor noise by signal-to-noise ratio, TiL Eq. (10)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.channels import CHANNEL, OUTPUTS
from twin.errors import TwinError
from twin.logs.drive import Drive


def noise_sd(
    measurements: NDArray[np.float64], snr_db: float, names: Sequence[str] = OUTPUTS
) -> NDArray[np.float64]:
    """Standard deviation of the white noise of each channel, TiL Eq. (10).

    sigma = rms * 10^(-snr/20), with the rms of the signal less its mean: gravity is no signal.
    Samples that are NaN do not count.

    Args:
        measurements: (N, ny) free of noise, [m/s2] and [rad/s].
        snr_db: signal-to-noise ratio [dB]; inf for no noise at all.
        names: ny names out of `twin.channels.OUTPUTS`, in the order of the columns.

    Returns:
        (ny,) standard deviations [m/s2], [rad/s].

    Raises:
        TwinError: the ratio is NaN or -inf, or a name has no noise model.
    """
    if not snr_db > -np.inf:
        raise TwinError(f"noise: snr_db is {snr_db}, must be a number of dB or inf")
    for name in names:
        if name not in OUTPUTS:
            raise TwinError(
                f"noise: channel {name!r} has no noise model, only {', '.join(OUTPUTS)}"
            )
    floors = np.array([CHANNEL[name].noise_floor for name in names])
    if snr_db == np.inf:
        return np.zeros(len(names))
    valid = ~np.isnan(measurements)
    samples = np.maximum(valid.sum(axis=0), 1)
    mean = np.where(valid, measurements, 0.0).sum(axis=0) / samples
    square = np.where(valid, measurements - mean, 0.0) ** 2
    sd = np.sqrt(square.sum(axis=0) / samples) * 10.0 ** (-snr_db / 20.0)
    by_snr = np.array([CHANNEL[name].noise_by_snr for name in names], dtype=bool)
    return np.where(by_snr, np.maximum(sd, floors), floors)


def with_noise(drive: Drive, snr_db: float, rng: np.random.Generator) -> Drive:
    """The drive with white noise on its measurements; inputs and truth stay as they are.

    The settings receive `snr` [dB] and `noise_sd`, by channel. One draw per channel and sample,
    whatever the ratio: two ratios of one seed differ in the size of the noise alone.

    Raises:
        TwinError: as `noise_sd`.
    """
    sd = noise_sd(drive.measurements, snr_db, drive.output_names)
    noise = sd * rng.standard_normal(drive.measurements.shape)
    noise_settings = {
        "snr": float(snr_db),
        "noise_sd": dict(zip(drive.output_names, sd.tolist(), strict=True)),
    }
    return drive.replace(
        measurements=drive.measurements + noise, settings=drive.settings | noise_settings
    )
