"""A Twin-in-the-Loop observer with gains from a covariance, and lateral forces as states.

The law is TiL Eq. (4) with a gain that follows speed and lateral acceleration, from the twin's own
linearisation (`estimators.til.linear_schedule`); the extended variables, lateral forces on the
axles (Eqs. 2-3), take what the twin's tyres do not account for. The measured speed corrects the
twin's directly; torques, where a log has none, are made from the longitudinal acceleration. No
wheel slips more than a bound. A twin that leaves the measured world is reset, and a note says so.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate
from estimators.drive_channels import check_measurements
from estimators.entry import Entry, Given
from estimators.speed_follower import TORQUES, SpeedFollower
from estimators.til.gains import place_of
from estimators.til.linear_schedule import NO_SCHEDULE, VY, YAW_RATE, linear_schedule
from estimators.til.scheduled_kernel import (
    ANGLE,
    BLOWN_UP,
    LAG,
    MOVING,
    ROLL,
    SLOWEST,
    SOUND,
    Fixed,
    History,
    Memory,
    Noise,
    doubt_anew,
    new_memory,
    observe,
    renew,
)
from twin import FORCES, STATES, WHEELS, Drive, Twin, TwinError, check_inputs

Array = NDArray[np.float64]

CORRECTED_EVERY = 0.01  # [s]
TOO_OFTEN = 50  # resets of a twin, after which the drive is refused
LARGEST_SQUARE = 6.0  # of the mean squared innovations in their variances, to be trusted; chosen
_WHY = {
    ROLL: "its roll angle",
    ANGLE: "its sideslip",
    LAG: "its speed",
    BLOWN_UP: "its simulation",
}
_REASONS = (
    "",
    "the measured lateral acceleration does not agree with the twin",
    "the measured yaw rate does not agree with the twin",
    "an axle would need a lateral force that its tyres do not account for",
    "a measurement that corrects the twin is missing",
    "the twin's lateral speed left what a_y and yaw rate allow, and was held",
)
_MISSING, _HELD = 4, 5
LONGEST_GAP = 0.5  # [s] of a measurement, beyond which the estimate is not trusted; chosen
STEADY, FIRST = 20.0, 0.1  # [s] that a bend lasts before a start, that its yaw rate is the mean of
_YAW_RATE = STATES.index("yaw_rate")
_RADIUS_SPEED = 10.0  # [m/s] at which rolling radii are taken


@dataclass(frozen=True, slots=True, kw_only=True)
class ScheduledEstimate(Estimate):
    """An estimate with the standard deviation of the tyres' forces.

    Attributes:
        axle_force_sd: (N, 2) of the lateral forces of the tyres of each axle [N].
    """

    axle_force_sd: Array


class ScheduledObserver:
    """The observer of a twin.

    Args:
        twin: the black box; the observer owns it from now on.
        follower: how unknown torques are made; its gain is not used, the speed corrects directly.
        noise: what the covariance is driven by.
        levelled: whether the measured a_y has gravity through roll taken out.
    """

    def __init__(
        self,
        twin: Twin,
        follower: SpeedFollower | None = None,
        noise: Noise | None = None,
        *,
        levelled: bool = False,
    ) -> None:
        self.twin = twin
        self._radius = _rolling_radii(twin)
        follower = follower or follower_of(twin)
        noise = Noise(*(float(value) for value in noise or Noise()))
        every = max(round(CORRECTED_EVERY / twin.dt), 1)
        car = twin.car
        self._fixed = Fixed(
            follower=SpeedFollower(*(float(v) for v in follower._replace(gain=0.0))),
            schedule=NO_SCHEDULE,
            noise=noise,
            every=every,
            mass=float(car.nominal[0] + car.other_mass[0]),
            half_track=0.5 * float(car.track),
            torqueless=True,
            levelled=levelled,
        )
        self._memory: Memory | None = None
        self._road: ArrayLike = (0.0, 0.0, 0.0, 0.0)

    def reset(
        self,
        speed: float,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """Starts anew: the twin settles at a speed under some load, and is linearised.

        Args:
            speed: [m/s].
            parameters: deltas from the nominal chassis by name; zero where not given.
            road: (4,) height under each wheel [m]; zero if not given.
        """
        p = np.zeros(len(self.twin.parameters))
        for name, value in (parameters or {}).items():
            p[place_of(name, self.twin.parameters, "parameter")] = value
        p = self.twin.set_parameters(p)
        schedule = linear_schedule(self.twin, self._fixed.every * self.twin.dt)
        self._fixed = self._fixed._replace(schedule=schedule)
        self._memory = new_memory(self._fixed.noise, p, self._radius, speed)
        self._road = (0.0, 0.0, 0.0, 0.0) if road is None else road
        self._settle(speed)

    def _settle(self, speed: float) -> None:
        assert self._memory is not None
        renew(self._memory, self._fixed.mass, speed)
        self.twin.set_parameters(self._memory.parameters)
        self.twin.reset(max(speed, 0.0), self._road)

    def run(self, drive: Drive) -> ScheduledEstimate:
        """Observes a drive, from the state that the observer is in.

        Raises:
            TwinError: the drive has another sample time or other inputs than the twin, or the twin
                had to be set anew too often.
        """
        memory, twin = self._memory, self.twin
        if memory is None:
            raise TwinError("scheduled observer: was not reset; allowed: reset(speed) before run")
        inputs, measurements, speeds, torqueless = _given(drive, twin)
        fixed = self._fixed._replace(torqueless=torqueless)
        n = len(drive)
        history = _history(n, twin)
        notes, k = [], 0
        self._take_bend(inputs, measurements, 0)
        while True:
            k, fault = observe(twin.car, fixed, memory, inputs, measurements, speeds, k, history)
            if fault == SOUND:
                break
            notes.append(
                f"The twin was reset at {drive.time[k]:.2f} s: {_WHY[fault]} had left the range of "
                "the measurements."
            )
            if len(notes) > TOO_OFTEN:
                raise TwinError(
                    f"drive: the twin had to be reset {TOO_OFTEN} times until t = "
                    f"{drive.time[k]:.3f} s; this is another car, or its steering or speed is wrong"
                )
            self._settle(float(memory.speed[0]))
            self._take_bend(inputs, measurements, k)
            memory.consistency[:] = 2.0 * LARGEST_SQUARE
            k += 1
        return _observed(drive, history, notes, twin, _missing(measurements, twin))

    def _take_bend(self, inputs: Array, measurements: Array, k: int) -> None:
        """Brings a twin that has just settled into the bend that it is to start in, at sample k.

        Steering, speed and yaw rate of the drive are held for `STEADY`, as if the car had always
        driven so, and the observer corrects the twin as ever. The twin then starts with its roll,
        its tyres' slip and the axle forces that such a bend asks for.
        """
        memory, twin, names = self._memory, self.twin, self.twin.outputs
        assert memory is not None
        first = measurements[k : k + max(round(FIRST / twin.dt), 1), names.index("yaw_rate")]
        speed = float(memory.speed[0])
        if not np.isfinite(first).any() or twin.read_states()[_YAW_RATE] != 0.0:
            return
        yaw_rate = float(np.nanmean(first))
        here = twin.snapshot()
        _turn(twin, yaw_rate)
        if speed < MOVING:
            return
        n = round(STEADY / twin.dt)
        held = np.full((n, len(names)), np.nan)
        held[:, names.index("ay")], held[:, names.index("yaw_rate")] = speed * yaw_rate, yaw_rate
        held[:, names.index("ay")] += memory.offsets[0]
        held[:, names.index("yaw_rate")] += memory.offsets[1]
        _, fault = observe(
            twin.car, self._fixed, memory, np.tile(inputs[k], (n, 1)), held, np.full(n, speed), 0,
            _history(n, twin),
        )  # fmt: skip
        memory.consistency[:] = 1.0
        doubt_anew(memory, self._fixed.mass, speed)
        if fault != SOUND:
            renew(memory, self._fixed.mass, speed)
            twin.set_parameters(memory.parameters)
            twin.restore(here)
            _turn(twin, yaw_rate)


def _turn(twin: Twin, yaw_rate: float) -> None:
    dx = np.zeros(len(STATES))
    dx[_YAW_RATE] = yaw_rate - twin.read_states()[_YAW_RATE]
    twin.correct(dx)


def _history(n: int, twin: Twin) -> History:
    return History(
        states=np.zeros((n, len(twin.states))),
        parameters=np.zeros((n, len(twin.parameters))),
        outputs=np.zeros((n, len(twin.outputs))),
        extended=np.zeros((n, len(twin.extended))),
        held=np.zeros(n),
        sd=np.zeros((n, 6)),
        consistency=np.ones((n, 3)),
    )


def _given(drive: Drive, twin: Twin) -> tuple[Array, Array, Array, bool]:
    """Inputs, measurements and speed in the twin's order, and whether torques are unknown."""
    if abs(drive.dt - twin.dt) > 1e-9:
        raise TwinError(f"drive: has samples every {drive.dt} s, the twin steps {twin.dt} s")
    torqueless = not set(TORQUES) & set(drive.input_names)
    wanted = tuple(n for n in twin.inputs if not (torqueless and n in TORQUES))
    ny = len(twin.outputs)
    if drive.input_names != wanted or drive.output_names[:ny] != twin.outputs:
        has = (*drive.input_names, *drive.output_names)
        raise TwinError(f"drive: has channels {has}, the twin needs {(*wanted, *twin.outputs)}")
    measured = "vx" in drive.output_names
    if torqueless and not (measured and np.isfinite(drive.channel("vx")).any()):
        raise TwinError("drive: has no torques and no measured vx; allowed: one of them")
    inputs = np.zeros((len(drive), len(twin.inputs)))
    inputs[:, [twin.inputs.index(name) for name in wanted]] = drive.inputs
    check_inputs(inputs, "drive")
    measurements = np.ascontiguousarray(drive.measurements[:, :ny])
    check_measurements(measurements, twin.outputs, "drive", infinite=False)
    speeds = drive.channel("vx") if measured else np.full(len(drive), np.nan)
    return inputs, measurements, np.ascontiguousarray(speeds), torqueless


def _missing(measurements: Array, twin: Twin) -> NDArray[np.bool_]:
    """(N,) where a_y or yaw rate, if the drive has them, have been missing for `LONGEST_GAP`."""
    longest = round(LONGEST_GAP / twin.dt)
    found = np.zeros(len(measurements), dtype=np.bool_)
    at = np.arange(len(measurements))
    for name in ("ay", "yaw_rate"):
        there = np.isfinite(measurements[:, twin.outputs.index(name)])
        if there.any():
            found |= at - np.maximum.accumulate(np.where(there, at, -1)) > longest
    return found


def _observed(
    drive: Drive, history: History, notes: list[str], twin: Twin, missing: NDArray[np.bool_]
) -> ScheduledEstimate:
    consistent = (history.consistency < LARGEST_SQUARE).all(axis=1)
    held = history.held > 0.0
    trustworthy = np.asarray(consistent & ~missing & ~held)
    doubt = np.where(consistent, 0, 1 + np.argmax(history.consistency, axis=1))
    doubt[held] = _HELD
    doubt[missing] = _MISSING
    states_sd = np.full(history.states.shape, np.nan)
    states_sd[:, [VY, YAW_RATE]] = history.sd[:, :2]
    speed = np.maximum(history.states[:, STATES.index("vx")], SLOWEST)
    return ScheduledEstimate(
        time=drive.time,
        states=history.states,
        parameters=history.parameters,
        outputs=history.outputs,
        extended=history.extended,
        nominal=twin.car.nominal.copy(),
        estimated=FORCES,
        sd=history.sd[:, 4:],
        states_sd=states_sd,
        trustworthy=trustworthy,
        trust_reason=doubt.astype(np.uint8),
        reasons=_REASONS,
        notes=tuple(notes),
        sideslip_sd=history.sd[:, 0] / speed,
        axle_force_sd=history.sd[:, 2:4],
    )


def _rolling_radii(twin: Twin) -> Array:
    twin.reset(_RADIUS_SPEED)
    states = twin.read_states()
    return np.array([_RADIUS_SPEED / states[STATES.index(f"wheel_speed_{w}")] for w in WHEELS])


def follower_of(twin: Twin) -> SpeedFollower:
    """How a car of which nothing is known but its files makes its torques: rear drive."""
    car, radius = twin.car, _rolling_radii(twin)
    return SpeedFollower(
        mass=float(car.nominal[0] + car.other_mass[0]),
        drag_area=float(car.drag_area),
        radius_front=float(radius[:2].mean()),
        radius_rear=float(radius[2:].mean()),
    )


def _made(given: Given) -> ScheduledObserver:
    vehicle = given.car()
    return ScheduledObserver(Twin(vehicle), given.follower, given.settings)


ENTRY = Entry(
    name="til-scheduled",
    words="states, sideslip and tyre forces with standard deviations, by gains that follow speed "
    "and lateral acceleration",
    make=_made,
    needs=frozenset(("twin",)),
    channels=("yaw_rate", "ay"),
    gives=("sideslip", "axle_force_front", "axle_force_rear"),
    sd=True,
)
