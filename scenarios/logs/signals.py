"""A drive's channels as its checks compare them: slow, without gaps, where the car moves."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from estimators.til.observer import Observer
from estimators.til.stream import rolling_radius
from twin import WHEELS, Drive, Twin, Vehicle

Array = NDArray[np.float64]

CUTOFF = 2.0  # [Hz], of the low-pass filter; chosen: above the driver, below wheel hop and engine
STEP = 0.02  # [s] of what is compared; chosen: ten samples of the fastest that is left
MOVING = 3.0  # [m/s]; slower samples do not count: wheel speeds and slip angles mean little
TYPICAL_RADIUS = 0.33  # [m] of a car's wheel, where there is no car to ask
_AIR = 1.2  # [kg/m3], as in the twin

WHEEL_SPEEDS = tuple(f"wheel_speed_{wheel}" for wheel in WHEELS)
DRIVE_TORQUES = tuple(f"drive_torque_{wheel}" for wheel in WHEELS)
BRAKE_TORQUES = tuple(f"brake_torque_{wheel}" for wheel in WHEELS)


class CarFacts(NamedTuple):
    """What the checks take from a car.

    Attributes:
        mass: as it stands in its file [kg].
        radius: rolling, of its wheels [m].
        wheelbase, track: [m].
        steering_ratio: hand wheel over road wheels.
        drag: force over speed squared [N s2/m2].
        spin_mass: what its wheels add to the mass that is accelerated [kg].
    """

    mass: float
    radius: float
    wheelbase: float
    track: float
    steering_ratio: float
    drag: float
    spin_mass: float


def facts_of(vehicle: Vehicle) -> CarFacts:
    """What the checks need of a car.

    Raises:
        TwinError: its files are missing or broken.
    """
    twin = Twin(vehicle)
    car = twin.car
    radius = rolling_radius(Observer(twin, []))
    return CarFacts(
        mass=float(car.nominal[0] + car.other_mass[0]),
        radius=radius,
        wheelbase=float(car.wheelbase),
        track=float(car.track),
        steering_ratio=float(car.steering_ratio),
        drag=0.5 * _AIR * float(car.drag_area),
        spin_mass=float(np.sum(car.spin_inertia)) / radius**2,
    )


class Signals(NamedTuple):
    """Channels of a drive, filtered.

    Attributes:
        time: (N,) every `STEP` or every sample of a slower drive [s].
        dt: its step [s].
        known: (N,) by name, what is measured, given or, failing that, the truth; "wheels" is the
            mean wheel speed [rad/s], "speed" the best there is [m/s].
        seen: (N,) by name, where it is no filled gap.
        moving: (N,) where the car moves; all true if nothing says so.
        speed_name: "vx", "wheels" or "" of what "speed" is.
    """

    time: Array
    dt: float
    known: dict[str, Array]
    seen: dict[str, NDArray[np.bool_]]
    moving: NDArray[np.bool_]
    speed_name: str

    def has(self, *names: str) -> bool:
        """Whether all of these are known."""
        return all(name in self.known for name in names)

    def rate(self, name: str) -> Array:
        """(N,) time derivative of a channel."""
        return np.gradient(self.known[name], self.dt)

    def where(self, *names: str) -> NDArray[np.bool_]:
        """(N,) where the car moves and all of these are seen."""
        return np.all([self.moving, *(self.seen[name] for name in names)], axis=0)


def signals_of(drive: Drive, car: CarFacts | None = None) -> Signals:
    """The channels of a drive for its checks; those that never change to begin with are left out.

    Raises:
        TwinError: the drive's samples are not uniform.
    """
    raw = {name: drive.channel(name) for name in (*drive.input_names, *drive.output_names)}
    raw = {name: values for name, values in raw.items() if np.isfinite(values).any()}
    declared = drive.settings.get("log", {}).get("constants", ())
    raw = {name: values for name, values in raw.items() if name not in declared}
    raw = {**{k: v for k, v in drive.truth.items() if np.isfinite(v).any()}, **raw}
    stride = max(1, round(STEP / drive.dt))
    known, seen = {}, {}
    for name, values in raw.items():
        good = np.isfinite(values)
        known[name] = _low_pass(_filled(values, good), drive.dt)[::stride]
        seen[name] = good[::stride]
    speed_name = ""
    if all(name in known for name in WHEEL_SPEEDS):
        # the median of four: one that is wrong does not carry the others off
        known["wheels"] = np.median([known[name] for name in WHEEL_SPEEDS], axis=0)
        seen["wheels"] = np.all([seen[name] for name in WHEEL_SPEEDS], axis=0)
        radius = car.radius if car else TYPICAL_RADIUS
        known["speed"], seen["speed"] = radius * known["wheels"], seen["wheels"]
        speed_name = "wheels"
    if "vx" in known:
        known["speed"], seen["speed"], speed_name = known["vx"], seen["vx"], "vx"
    time = drive.time[::stride]
    moving = np.ones(time.size, dtype=bool)
    if "speed" in known:
        moving = known["speed"] > MOVING
    return Signals(time, drive.dt * stride, known, seen, moving, speed_name)


def _filled(values: Array, good: NDArray[np.bool_]) -> Array:
    if good.all():
        return values
    index = np.arange(values.size)
    return np.interp(index, index[good], values[good])


def _low_pass(values: Array, dt: float) -> Array:
    if CUTOFF * dt > 0.4 or values.size < 16:
        return values
    sos = signal.butter(2, CUTOFF, fs=1.0 / dt, output="sos")
    return signal.sosfiltfilt(sos, values, padlen=min(values.size - 1, round(0.5 / dt)))
