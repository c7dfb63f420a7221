"""What is wrong with a log by its own numbers, and the line of the map that would mend it.

`til inspect` prints the findings; `til estimate` and `til calibrate` call a result not trustworthy
while there are any.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from scenarios.logs.checks import TORQUES, Check, checks_of, force_of
from scenarios.logs.force_balance import balances, contradictions
from scenarios.logs.hypotheses import best, mended, shown
from scenarios.logs.kinematic_balance import mismatches
from scenarios.logs.signals import (
    BRAKE_TORQUES,
    DRIVE_TORQUES,
    WHEEL_SPEEDS,
    CarFacts,
    Signals,
    facts_of,
    signals_of,
)
from twin import OUTPUTS, Drive, Vehicle

Array = NDArray[np.float64]

_MOST_CHANGES = 3  # of a map that are looked for one after the other
_LONGEST_LOG = 600.0  # [s] of a drive that are looked at, from its middle; chosen: enough
_FROZEN = 1.0  # [s] without any change of a sensor in motion
_OFFSETS = {"ax": 0.7, "ay": 0.7, "yaw_rate": 0.035, "steering_wheel_angle": 0.12}
_FORCE_OFFSET = 0.55  # [m/s2] of the torques; a slope of 3 degrees
_BALANCED = {
    "torques": (*DRIVE_TORQUES, *BRAKE_TORQUES),
    "ax": ("ax", *WHEEL_SPEEDS),
}
_MENDS = {
    "torques": "[channels.drive_torque_*] or [channels.brake_torque_*] factor",
    "ax": "[channels.ax] factor, or that of [channels.wheel_speed_*]",
}
_SLOWEST_RATE = 1.0  # [Hz] of a log
_FASTEST_RATE = 20_000.0
_LONGEST = 24.0 * 3600.0  # [s]
_SMOOTH = 4.0  # [s] over which hills are told from bumps
_SLOPE = 0.25  # [m/s2] that the torques see of hills and the accelerations do not


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Something wrong with a log.

    Attributes:
        channels: of ours that it concerns.
        words: what is wrong, a sentence without its end.
        mend: the line of the map that would mend it; empty if none does.
        severity: "fault" makes estimates not trustworthy; "note" does not.
    """

    channels: tuple[str, ...]
    words: str
    mend: str = ""
    severity: str = "fault"

    def __str__(self) -> str:
        """The finding as a sentence."""
        mend = f"; in the map: {self.mend}" if self.mend else ""
        return f"{self.words}{mend}."


def findings(drive: Drive, vehicle: Vehicle | None = None) -> list[Finding]:
    """All that is wrong with a drive, as far as its own numbers show.

    Args:
        drive: a log by its map, or a simulated drive; its truth is not looked at.
        vehicle: the car that drove; without it steering, torques and radii are not checked.

    Raises:
        TwinError: the drive's samples are not uniform, or the car's files are broken.
    """
    car = facts_of(vehicle) if vehicle is not None else None
    part = _middle(drive)
    signals = signals_of(part, car)
    found = [*_of_time(drive), *_frozen(part, signals)]
    checked = checks_of(signals, car)
    found += _of_checks(signals, car, checked)
    if not any(finding.severity == "fault" for finding in found):
        found += [
            Finding(channels=wrong.channels, words=wrong.words[:1].upper() + wrong.words[1:])
            for wrong in mismatches(signals, car)
        ]
        found += _offsets(signals, car, checked)
        if car is not None:
            known = any("ax" in finding.channels for finding in found)
            found += [*_of_forces(signals, car, checked, known), *_axles(signals, car)]
    return found


def hills(drive: Drive, vehicle: Vehicle) -> float:
    """How hilly a drive is: what gravity adds to a_x, as a standard deviation [m/s2]; 0 if unseen.

    Raises:
        TwinError: as `findings`.
    """
    car = facts_of(vehicle)
    signals = signals_of(_middle(drive), car)
    if not signals.has("ax", "speed"):
        return 0.0
    good = signals.where("ax", "speed")
    if good.sum() * signals.dt < 4.0 * _SMOOTH:
        return 0.0
    rate = signals.rate("speed")
    a, b = signals.known["ax"][good], rate[good]
    # the body pitches: ax is some percent more than the change of speed
    pitching = float(a @ b / max(float(b @ b), 1e-9))
    rest = signals.known["ax"] - min(max(pitching, 1.0), 1.1) * rate
    return float(uniform_filter1d(rest, round(_SMOOTH / signals.dt))[good].std())


def _middle(drive: Drive) -> Drive:
    drive = drive.replace(truth={})
    n = round(_LONGEST_LOG / drive.dt)
    if len(drive) <= n:
        return drive
    start = (len(drive) - n) // 2
    return drive[start : start + n]


def _of_time(drive: Drive) -> Iterator[Finding]:
    """A unit of time that is wrong by orders of magnitude."""
    rate = drive.settings.get("log", {}).get("rate", 1.0 / drive.dt)
    if not _SLOWEST_RATE <= rate <= _FASTEST_RATE:
        yield Finding(
            channels=("time",),
            words=f"The log has {rate:.3g} samples a second: is its unit of time right?",
            mend="[time] unit",
        )
    if drive.duration > _LONGEST:
        yield Finding(
            channels=("time",),
            words=f"The log lasts {drive.duration / 3600:.4g} hours: is its unit of time right?",
            mend="[time] unit",
        )


def _frozen(drive: Drive, signals: Signals) -> Iterator[Finding]:
    """Sensors that stand still while the car moves."""
    moving = np.interp(drive.time, signals.time, signals.moving.astype(float)) > 0.5
    if not moving.any():
        return
    for name in drive.output_names:
        if name not in OUTPUTS:
            continue
        values = drive.channel(name)
        still = np.concatenate([[False], np.diff(values) == 0.0]) & moving
        if still[moving].mean() > 0.9:
            steps = still.size
        else:
            edges = np.flatnonzero(np.diff(np.concatenate([[0], still.view(np.int8), [0]])))
            steps = int((edges[1::2] - edges[::2]).max()) if edges.size else 0
        if steps * drive.dt >= _FROZEN:
            seconds = min(steps, int(still.sum())) * drive.dt
            yield Finding(
                channels=(name,),
                words=f"{name} is frozen for {seconds:.3g} s while the car moves",
                mend=f"leave [channels.{name}] out",
            )


def _of_checks(signals: Signals, car: CarFacts | None, checked: list[Check]) -> list[Finding]:
    """Changes of the map that mend the checks that fail, and what none of them mends."""
    found: list[Finding] = []
    failing = [check for check in checked if check.fault]
    for _ in range(_MOST_CHANGES):
        if not failing:
            break
        gravity = next((check for check in failing if check.fault == "gravity"), None)
        if gravity is not None:
            found.append(
                Finding(
                    channels=("ax", "ay", "az"),
                    words="az is about zero: the accelerations are free of gravity",
                    mend="free_of_gravity = true",
                )
            )
            failing.remove(gravity)
            continue
        mending = best(signals, car, failing)
        if mending is None:
            break
        chosen, failing = mending
        names = tuple(dict.fromkeys(name for h in chosen for name in h.channels))
        words = " or ".join(dict.fromkeys(f"{shown(h.channels)} {h.words}" for h in chosen[:3]))
        mend = " or ".join(dict.fromkeys(h.mend for h in chosen[:3]))
        found.append(Finding(channels=names, words=words, mend=mend))
        signals = mended(signals, chosen[0], car)
    return found + [_unmended(check, car) for check in failing]


def _unmended(check: Check, car: CarFacts | None) -> Finding:
    if check.name.startswith(TORQUES) and check.fault == "scale" and car is not None:
        return Finding(
            channels=(*DRIVE_TORQUES, *BRAKE_TORQUES),
            words=(
                f"The torques belong to a car of {check.slope * car.mass:.0f} kg, which one of "
                f"{car.mass:.0f} kg cannot be under any load: a wrong scale, or axle"
            ),
            mend="[channels.drive_torque_*] and [channels.brake_torque_*] factor",
        )
    return Finding(channels=check.channels, words=f"{check.name}: {check.verdict}")


def _offsets(signals: Signals, car: CarFacts | None, checked: Sequence[Check]) -> Iterator[Finding]:
    """What a sensor shows at zero, each by one equation; one that is found excuses the next."""
    made = {check.name: check.fit for check in checked if check.fit is not None}
    offsets: dict[str, float] = {}
    for name, fit in made.items():
        if name.startswith(("ax =", "ay =")):
            offsets[name[:2]] = fit.intercept
        elif name.startswith("rear wheels' difference ~ yaw_rate") and fit.both_signs:
            offsets["yaw_rate"] = -fit.intercept / fit.slope
    for name, fit in made.items():
        yaw = abs(offsets.get("yaw_rate", 0.0)) > _OFFSETS["yaw_rate"]
        if name.startswith("yaw_rate ~") and fit.both_signs and not yaw:
            # the angle at which the yaw rate is zero, at the mean speed
            speed = signals.known["speed"][signals.moving].mean()
            turns = car.wheelbase * car.steering_ratio if car else 1.0
            offsets["steering_wheel_angle"] = -fit.intercept / (fit.slope * speed) * turns
    for name, offset in offsets.items():
        if abs(offset) > _OFFSETS[name]:
            yield Finding(
                channels=(name,),
                words=f"{name} is off by {offset:.3g} {_SI[name]} at zero",
                mend=f"[channels.{name}] offset = {offset:.3g} (in {_SI[name]})",
            )


_SI = {"ax": "m/s2", "ay": "m/s2", "yaw_rate": "rad/s", "steering_wheel_angle": "rad"}


def _of_forces(
    signals: Signals, car: CarFacts, checked: Sequence[Check], ax_is_off: bool
) -> Iterator[Finding]:
    """Torques that do not fit each other, and accelerations that do not know of hills."""
    force = force_of(signals, car)
    check = next((c for c in checked if c.name.startswith(TORQUES) and c.fit), None)
    if force is None or check is None or check.fit is None or not signals.has("ax"):
        return
    if abs(check.fit.intercept) > _FORCE_OFFSET and not ax_is_off:
        yield Finding(
            channels=(*DRIVE_TORQUES, *BRAKE_TORQUES, "ax"),
            words=(
                f"Torques and ax differ by {check.fit.intercept:.2g} m/s2 throughout: an offset of "
                "one of them"
            ),
            mend="[channels.ax] offset, or that of the torques",
        )
    good = signals.where("ax", "speed")
    ax = signals.known["ax"]
    mass = car.mass + car.spin_mass
    for what, words in contradictions(balances(signals, car), mass):
        yield Finding(
            channels=_BALANCED[what], words=words[:1].upper() + words[1:], mend=_MENDS[what]
        )
    slow = round(_SMOOTH / signals.dt)
    by_torques = force / (mass * check.fit.slope) - ax
    by_speed = ax - signals.rate("speed")
    smooth = [uniform_filter1d(values, slow)[good].std() for values in (by_torques, by_speed)]
    if smooth[0] > _SLOPE and smooth[1] < 0.35 * smooth[0]:
        yield Finding(
            channels=("ax",),
            words=(
                f"The torques climb hills of {smooth[0]:.2g} m/s2 that ax knows nothing of: it is "
                "free of gravity, or the torques have an offset that changes"
            ),
            mend="free_of_gravity = true",
        )


def _axles(signals: Signals, car: CarFacts) -> Iterator[Finding]:
    """Front and rear exchanged."""
    if signals.has(*BRAKE_TORQUES):
        good = signals.moving
        front, rear = (
            float(np.sum([signals.known[name][good] for name in names]))
            for names in (BRAKE_TORQUES[:2], BRAKE_TORQUES[2:])
        )
        if rear > 1.3 * front and rear > 100.0 * good.sum():
            yield Finding(
                channels=BRAKE_TORQUES,
                words="The rear brakes take more than the front ones: front and rear are swapped",
                mend="names of [channels.brake_torque_f*] and [channels.brake_torque_r*] exchanged",
            )
    if not signals.has("yaw_rate", *WHEEL_SPEEDS):
        return
    calm = signals.where("yaw_rate", *WHEEL_SPEEDS)
    for name, most in (("ax", 1.5), ("ay", 5.0)):
        if signals.has(name):
            calm &= np.abs(signals.known[name]) < most
    if calm.sum() * signals.dt < 4.0:
        return
    speed = np.maximum(signals.known["speed"], 1.0)
    longer = 0.5 * (signals.known["yaw_rate"] * car.wheelbase / speed)[calm] ** 2
    front, rear = (
        0.5 * (signals.known[a] + signals.known[b])[calm]
        for a, b in (WHEEL_SPEEDS[:2], WHEEL_SPEEDS[2:])
    )
    faster = (front - rear) / signals.known["wheels"][calm]
    if longer.std() < 5e-4:
        return
    matrix = np.column_stack([longer, np.ones_like(longer)])
    slope = float(np.linalg.lstsq(matrix, faster, rcond=None)[0][0])
    correlation = float(np.corrcoef(longer, faster)[0, 1])
    if slope < -0.3 and correlation < -0.25:
        yield Finding(
            channels=WHEEL_SPEEDS,
            words="The rear wheels run faster in curves: front and rear wheel speeds are swapped",
            mend="names of [channels.wheel_speed_f*] and [channels.wheel_speed_r*] exchanged",
        )
