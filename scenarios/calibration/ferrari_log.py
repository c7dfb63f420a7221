"""The log of a Ferrari 250 LM on a race track as a `Drive`; the data are not shipped.

Stanford Revs Vehicle Dynamics Database (J. Kegelman, J. C. Gerdes; purl.stanford.edu/hd122pw0365),
session 20140222_01_01: `drive.parquet` with the columns t, vx, vy, yawRate, axCG, ayCG, delta and
beta_true, in SI units and ISO 8855 axes, at 100 Hz.
"""

import os
from pathlib import Path

from twin import Drive, TwinError

VARIABLE = "FERRARI_250LM"
FILE = "drive.parquet"
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


def part(drive: Drive, name: str) -> slice:
    """The samples of a part of `PARTS`."""
    start, stop = (round(share * len(drive)) for share in PARTS[name])
    return slice(start, stop)
