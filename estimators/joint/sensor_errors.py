"""What is estimated of the sensors besides the parameters: one record per name.

None of these nuisance parameters needs a twin. Biases come first, in the order of the channels.
"""

from collections import namedtuple
from collections.abc import Mapping
from dataclasses import dataclass

from twin import CHANNEL, IMU, OUTPUTS


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorError:
    """What is known of a sensor error by its name.

    Attributes:
        name: unique.
        unit: SI.
        prior_sd: standard deviation before the first sample.
        words: what it is, within a sentence.
        drift: standard deviation by which it changes [unit per root of a second]; None: the share
            of its prior sd that the settings allow everything.
    """

    name: str
    unit: str
    prior_sd: float
    words: str
    drift: float | None = None


# Biases of a cheap IMU; all chosen
_BIASES = tuple(
    SensorError(
        name=f"bias_{name}",
        unit=CHANNEL[name].unit,
        prior_sd=CHANNEL[name].bias_sd,
        words=f"the bias of {name}",
    )
    for name in OUTPUTS[IMU]
)
# The delay of all signals on a slow bus, and where the IMU sits beside the twin's
_DELAY = SensorError(name="delay", unit="s", prior_sd=0.01, words="the delay of the sensors")
_POSITION = tuple(
    SensorError(name=f"imu_{axis}", unit="m", prior_sd=0.07, words=f"the {axis} of the IMU")
    for axis in ("x", "y", "z")
)
# What the speeds of all twins have in common as an error
_SPEED = SensorError(name="speed", unit="m/s", prior_sd=0.1, words="the speed", drift=0.0003)

SENSOR_ERROR: Mapping[str, SensorError] = {
    error.name: error for error in (*_BIASES, _DELAY, *_POSITION, _SPEED)
}
SENSOR_ERRORS = tuple(SENSOR_ERROR)
# Indices by name, for compiled code
E = namedtuple("E", SENSOR_ERRORS)._make(range(len(SENSOR_ERRORS)))
