"""The log of a Ferrari 250 LM on a race track as a `Drive`; the data are not shipped.

Stanford Revs Vehicle Dynamics Database (J. Kegelman, J. C. Gerdes; purl.stanford.edu/hd122pw0365),
session 20140222_01_01: `drive.parquet` with the columns t, vx, vy, yawRate, axCG, ayCG, delta and
beta_true, in SI units and ISO 8855 axes, at 100 Hz.
"""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from twin import INPUTS, OUTPUTS, Drive, TwinError

Array = NDArray[np.float64]

VARIABLE = "FERRARI_250LM"
FILE = "drive.parquet"
COLUMNS = ("t", "vx", "vy", "yawRate", "axCG", "ayCG", "delta", "beta_true")
RATE = 500.0  # [Hz], of the drive: the step of models/ferrari_250lm.xml
SPIKE = 0.2  # [rad]; the road wheels stay below 0.14 rad
MEDIAN = 5  # samples; a live observer would be 20 ms late for it
PARTS = {"first two thirds": (0.0, 2.0 / 3.0), "last third": (2.0 / 3.0, 1.0)}


def data_file() -> Path:
    """The log's file.

    Raises:
        TwinError: the environment does not say where it is, or it is not there.
    """
    folder = os.environ.get(VARIABLE)
    if not folder:
        raise TwinError(
            f"ferrari: the log is not shipped; set {VARIABLE} to the folder that has {FILE} "
            "(Stanford Revs database, session 20140222_01_01)"
        )
    path = Path(folder, FILE)
    if not path.is_file():
        raise TwinError(f"ferrari: {path} is not there; {VARIABLE} must be the folder of {FILE}")
    return path


def load(path: Path) -> Drive:
    """The log at 500 Hz, time from zero, without torques: a twin has to follow its speed.

    Steering loses its spikes; the longitudinal acceleration, which only feeds the torques forward,
    passes a low-pass of 5 Hz.

    Raises:
        TwinError: the file is no such log.
    """
    columns = _columns(path)
    steering = columns["delta"].copy()
    good = np.abs(steering) < SPIKE
    index = np.arange(steering.size)
    steering = np.interp(index, index[good], steering[good])
    steering = signal.medfilt(steering, MEDIAN)
    ax = signal.sosfilt(
        section := signal.butter(1, 5.0, fs=100.0, output="sos"),
        columns["axCG"],
        zi=signal.sosfilt_zi(section) * columns["axCG"][0],
    )[0]
    before = columns["t"] - columns["t"][0]
    time = np.arange(round(before[-1] * RATE) + 1) / RATE

    def now(values: Array) -> Array:
        return np.interp(time, before, values)

    roads = tuple(name for name in INPUTS if name.startswith("road_height"))
    names = (*OUTPUTS, "vx")
    measurements = np.full((time.size, len(names)), np.nan)
    for name, values in (
        ("ax", ax), ("ay", columns["ayCG"]), ("yaw_rate", columns["yawRate"]), ("vx", columns["vx"])
    ):  # fmt: skip
        measurements[:, names.index(name)] = now(values)
    return Drive(
        time=time,
        inputs=np.column_stack([now(steering), np.zeros((time.size, len(roads)))]),
        input_names=("steering_wheel_angle", *roads),
        measurements=measurements,
        output_names=names,
        truth={"vy": now(columns["vy"]), "sideslip": now(columns["beta_true"])},
        settings={"log": path.name, "session": "20140222_01_01"},
    )


def part(drive: Drive, name: str) -> slice:
    """The samples of a part of `PARTS`."""
    start, stop = (round(share * len(drive)) for share in PARTS[name])
    return slice(start, stop)


def _columns(path: Path) -> dict[str, Array]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise TwinError(
            f"{path}: cannot be read as Parquet: {str(error).splitlines()[0]}"
        ) from error
    missing = [name for name in COLUMNS if name not in table.column_names]
    if missing:
        raise TwinError(
            f"{path}: has no column {missing[0]}; allowed: a table with {', '.join(COLUMNS)}"
        )
    columns = {name: table[name].to_numpy().astype(np.float64) for name in COLUMNS}
    for name, values in columns.items():
        if values.size < 100 or not np.isfinite(values).all():
            raise TwinError(f"{path}: {name} must be 100 finite numbers at least")
    return columns
