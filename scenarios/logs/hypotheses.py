"""What may be wrong with a map: single changes that would make a drive's checks good again.

When checks fail, each change is tried on the signals: a sign, a unit, two channels that are
swapped, an IMU that is turned, a delay, a clock. The one with which the fewest checks fail names
the line of the map that would mend it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.logs.checks import TORQUES, Check, checks_of
from scenarios.logs.signals import (
    BRAKE_TORQUES,
    DRIVE_TORQUES,
    MOVING,
    TYPICAL_RADIUS,
    WHEEL_SPEEDS,
    CarFacts,
    Signals,
)
from twin.logs.units import GRAVITY, kind_of

Array = NDArray[np.float64]

# Units that are taken for ours by mistake, by kind: name, and ours per one of it
_MISTAKEN = {
    "acceleration": (("g", GRAVITY),),
    "angular rate": (("deg/s", np.pi / 180.0), ("rpm", np.pi / 30.0)),
    "angle": (("deg", np.pi / 180.0),),
    "speed": (("km/h", 1.0 / 3.6), ("mph", 0.44704)),
    "torque": (("kN m", 1e3),),
}
_TRUE_TO_MISTAKEN = {"acceleration": "m/s2", "angular rate": "rad/s", "angle": "rad"}
_SHORTEST = 0.08  # [s] of a delay that is worth a line
_WORTH = 0.3  # of a check, that a change must mend to be worth a line; chosen
_AS_GOOD = 0.02  # of a check; changes that close are named together
_NATURAL = 0.05  # of a check, for each factor of e by which a slope is not 1
_LESS_ALIKE = 0.03  # of a correlation; a change that costs so much is none


class Hypothesis(NamedTuple):
    """A change of the map.

    Attributes:
        channels: what is wrong.
        words: how it is wrong.
        mend: the line of the map.
        change: of the known channels, in place.
    """

    channels: tuple[str, ...]
    words: str
    mend: str
    change: Callable[[dict[str, Array], Array], None]


def mended(signals: Signals, hypothesis: Hypothesis, car: CarFacts | None) -> Signals:
    """The signals as the mended map would have them."""
    known = dict(signals.known)
    hypothesis.change(known, signals.time)
    if all(name in known for name in WHEEL_SPEEDS):
        known["wheels"] = np.median([known[name] for name in WHEEL_SPEEDS], axis=0)
        if signals.speed_name == "wheels":
            known["speed"] = (car.radius if car else TYPICAL_RADIUS) * known["wheels"]
    if signals.speed_name == "vx":
        known["speed"] = known["vx"]
    moving = known["speed"] > MOVING if "speed" in known else signals.moving
    return signals._replace(known=known, moving=moving)


def best(
    signals: Signals, car: CarFacts | None, failing: Sequence[Check]
) -> tuple[list[Hypothesis], list[Check]] | None:
    """The changes that mend most, equally good ones beside each other, and what fails still.

    Args:
        signals: as the map has them.
        car: that drove.
        failing: checks that fail.

    Returns:
        None if no change mends anything.
    """
    before = {check.name: check for check in checks_of(signals, car)}
    start = sum(_badness(check, before) for check in before.values())
    found: list[tuple[float, Hypothesis, list[Check]]] = []
    for hypothesis in hypotheses(signals, car, failing):
        after = checks_of(mended(signals, hypothesis, car), car, lags="late" in hypothesis.words)
        if sum(_badness(check, before) for check in after) > start - _WORTH:
            continue
        after = checks_of(mended(signals, hypothesis, car), car)
        badness = sum(_badness(check, before) for check in after)
        if badness < start - _WORTH:
            found.append((badness, hypothesis, [check for check in after if check.fault]))
    if not found:
        return None
    least = min(badness for badness, _, _ in found)
    chosen = sorted((e for e in found if e[0] < least + _AS_GOOD), key=lambda entry: entry[0])
    distinct = {hypothesis.channels: hypothesis for _, hypothesis, _ in reversed(chosen)}
    return list(reversed(distinct.values())), chosen[0][2]


def _badness(check: Check, before: Mapping[str, Check]) -> float:
    """How much a check fails: one that cannot be made any more, or less alike, fails as well."""
    earlier = before.get(check.name)
    if check.fit is None:
        lost = earlier is not None and earlier.fit is not None
        return 1.5 if lost else float(bool(check.fault))
    badness = float(bool(check.fault)) + (1.0 - min(abs(check.fit.correlation), 1.0))
    if check.unit == "1" and check.fit.slope > 0.0:  # of changes that fit the most natural
        badness += _NATURAL * min(abs(np.log(check.fit.slope)), 3.0)
    if earlier is not None and earlier.fit is not None:
        badness += float(abs(check.fit.at_lag) < abs(earlier.fit.at_lag) - _LESS_ALIKE)
    return badness


def hypotheses(
    signals: Signals, car: CarFacts | None, failing: Sequence[Check]
) -> Iterator[Hypothesis]:
    """All changes that concern a failing check."""
    blamed = {name for check in failing for name in check.channels}
    yield from _signs(signals, blamed)
    yield from _units(signals, blamed, car)
    if car is not None and TORQUES in blamed:
        yield from _brakes(signals, car)
    yield from _swaps(signals, blamed)
    yield from _delays(signals, failing)
    yield from _clocks(signals, failing)


def _signs(signals: Signals, blamed: set[str]) -> Iterator[Hypothesis]:
    for names, what in (
        (("steering_wheel_angle", "ay", "az", "pitch_rate", "yaw_rate"), 'axes = "SAE"'),
        (("steering_wheel_angle", "ay", "pitch_rate", "yaw_rate"), ""),
        (("steering_wheel_angle", "ay", "yaw_rate"), ""),
    ):
        members = tuple(name for name in names if name in signals.known)
        if len(members) > 2:
            yield Hypothesis(
                members,
                "have the wrong sign: their y axis points to the right",
                what or _lines(members, "sign = -1"),
                _scaling(members, -1.0),
            )
    for name in sorted(blamed):
        members = _members(name, signals)
        if members and name not in WHEEL_SPEEDS:
            yield Hypothesis(
                members, "has the wrong sign", _lines(members, "sign = -1"), _scaling(members, -1.0)
            )
    if TORQUES in blamed:
        for kind, members in (("drive", DRIVE_TORQUES), ("brake", BRAKE_TORQUES)):
            if signals.has(*members):
                yield Hypothesis(
                    members,
                    f"of the {kind} have the wrong sign",
                    _lines(members, "sign = -1"),
                    _scaling(members, -1.0),
                )
    if any(name in blamed for name in WHEEL_SPEEDS) and signals.has(*WHEEL_SPEEDS):
        yield Hypothesis(
            WHEEL_SPEEDS,
            "have the wrong sign",
            _lines(WHEEL_SPEEDS, "sign = -1"),
            _scaling(WHEEL_SPEEDS, -1.0),
        )


def _units(signals: Signals, blamed: set[str], car: CarFacts | None) -> Iterator[Hypothesis]:
    groups = [_members(name, signals) for name in sorted(blamed) if name not in WHEEL_SPEEDS]
    for several in (("ax", "ay", "az"), ("ax", "ay"), ("roll_rate", "pitch_rate", "yaw_rate")):
        if signals.has(*several) and not blamed.isdisjoint(several):
            groups.append(several)
    if any(name in blamed for name in WHEEL_SPEEDS) and signals.has(*WHEEL_SPEEDS):
        groups.append(WHEEL_SPEEDS)
    if TORQUES in blamed and signals.has(*DRIVE_TORQUES, *BRAKE_TORQUES):
        groups += [DRIVE_TORQUES, BRAKE_TORQUES]
    for members in groups:
        if not members:
            continue
        kind = kind_of(members[0])
        for unit, factor in _MISTAKEN.get(kind, ()):
            ours = _TRUE_TO_MISTAKEN.get(kind, {"speed": "m/s", "torque": "N m"}.get(kind, ""))
            plural = "are" if len(members) > 1 else "is"
            yield Hypothesis(
                members,
                f"{plural} in {unit}, not in {ours}",
                _lines(members, f'unit = "{unit}"'),
                _scaling(members, factor),
            )
            yield Hypothesis(
                members,
                f"{plural} in {ours}, not in {unit}",
                _lines(members, f'unit = "{ours}"'),
                _scaling(members, 1.0 / factor),
            )
        if members == WHEEL_SPEEDS:
            radius = car.radius if car else TYPICAL_RADIUS
            for unit, factor in (("km/h", 1.0 / 3.6), ("m/s", 1.0)):
                yield Hypothesis(
                    members,
                    f"are in {unit}, not in rad/s",
                    _lines(members, f'unit = "{unit}", radius = {radius:.3g}'),
                    _scaling(members, factor / radius),
                )
        if members == ("steering_wheel_angle",) and car is not None:
            ratio = car.steering_ratio
            for words, factor in (
                ("is that of the road wheels, not of the hand wheel", ratio),
                ("is that of the road wheels in deg", ratio * np.pi / 180.0),
            ):
                yield Hypothesis(
                    members,
                    words,
                    _lines(members, f"factor = {ratio:g}")
                    + (', unit = "deg"' if "deg" in words else ""),
                    _scaling(members, factor),
                )


def _brakes(signals: Signals, car: CarFacts) -> Iterator[Hypothesis]:
    """A scale of the brakes or of the drive torques by which both belong to one car."""
    shares = torque_shares(signals, car)
    if shares is None:
        return
    drive, brake = shares
    for members, other, own in (
        (BRAKE_TORQUES, drive, brake),
        (DRIVE_TORQUES, brake, drive),
    ):
        if _LIKELY[0] < other < _LIKELY[1] and not 0.7 < own / other < 1.5:
            factor = own / other
            kind = "brakes" if members is BRAKE_TORQUES else "engine or motors"
            yield Hypothesis(
                members,
                f"of the {kind} are {1.0 / factor:.3g} times what the others let expect",
                _lines(members, f"factor = {factor:.3g}"),
                _scaling(members, factor),
            )


def torque_shares(signals: Signals, car: CarFacts) -> tuple[float, float] | None:
    """Force per drive torque and per brake torque, in what the car's own mass lets expect.

    Both are the car's mass over the true one where the map is right; None if the drive does not
    excite both.
    """
    if not signals.has(*DRIVE_TORQUES, *BRAKE_TORQUES, "ax", "speed"):
        return None
    good = signals.where("ax", "speed")
    if not good.any():
        return None
    ax = signals.known["ax"][good]
    parts = [
        np.sum([signals.known[name][good] for name in names], axis=0) / car.radius
        for names in (DRIVE_TORQUES, BRAKE_TORQUES)
    ]
    mass = car.mass + car.spin_mass
    known = mass * ax + car.drag * signals.known["speed"][good] ** 2
    spreads = [float(part.std()) for part in parts]
    if min(spreads) <= 0.0:
        return None
    matrix = np.column_stack([parts[0] / spreads[0], -parts[1] / spreads[1], np.ones(ax.size)])
    solved, rest, _, _ = np.linalg.lstsq(matrix, known, rcond=None)
    contributes = np.abs(solved[:2]).min() > 0.15 * mass  # [N] of 0.15 m/s2
    explained = rest.size and rest[0] < 0.1 * np.sum((known - known.mean()) ** 2)
    if not (contributes and explained):
        return None
    return float(solved[0] / spreads[0]), float(solved[1] / spreads[1])


_LIKELY = (0.68, 1.2)  # the car's own mass over that of the loaded car


def _swaps(signals: Signals, blamed: set[str]) -> Iterator[Hypothesis]:
    pairs = (
        ("wheel_speed_fl", "wheel_speed_fr", "left and right"),
        ("wheel_speed_rl", "wheel_speed_rr", "left and right"),
        ("roll_rate", "pitch_rate", "roll and pitch"),
        ("ax", "ay", "two axes of the IMU"),
        ("yaw_rate", "roll_rate", "two rates"),
        ("ax", "az", "two axes of the IMU"),
        ("ay", "az", "two axes of the IMU"),
        ("yaw_rate", "pitch_rate", "two rates"),
    )
    for first, second, what in pairs:
        if signals.has(first, second) and (first in blamed or second in blamed):
            yield Hypothesis(
                (first, second),
                f"{what} are swapped",
                _swapped_lines((first, second)),
                _swapping(((first, second),)),
            )
    if signals.has(*WHEEL_SPEEDS) and any(name in blamed for name in WHEEL_SPEEDS):
        yield Hypothesis(
            WHEEL_SPEEDS,
            "left and right are swapped",
            _swapped_lines(WHEEL_SPEEDS[:2]) + "; " + _swapped_lines(WHEEL_SPEEDS[2:]),
            _swapping((WHEEL_SPEEDS[:2], WHEEL_SPEEDS[2:])),
        )
    if signals.has("ax", "ay") and ("ax" in blamed or "ay" in blamed):
        rates = signals.has("roll_rate", "pitch_rate")
        for way, sign in (("left", 1.0), ("right", -1.0)):
            # an IMU turned to the left by 90 degrees: its x axis looks along our y
            yield Hypothesis(
                ("ax", "ay", *(("roll_rate", "pitch_rate") if rates else ())),
                f"the IMU is turned to the {way} by 90 degrees",
                f"names of ax and ay exchanged, {'ax' if sign > 0 else 'ay'} with sign = -1"
                + (", roll_rate and pitch_rate likewise" if rates else ""),
                _turning(sign, rates),
            )


def _delays(signals: Signals, failing: Sequence[Check]) -> Iterator[Hypothesis]:
    inputs = _inputs(signals)
    lags: dict[tuple[str, ...], list[float]] = {}
    for check in failing:
        if check.fit is None or abs(check.fit.lag) < _SHORTEST:
            continue
        for place, name in enumerate(check.channels):
            late = check.fit.lag if place == 0 or "difference" in check.name else -check.fit.lag
            if "difference" in check.name and name not in WHEEL_SPEEDS:
                late = -check.fit.lag
            members = WHEEL_SPEEDS if name in WHEEL_SPEEDS else _members(name, signals)
            if members and signals.has(*members):
                lags.setdefault(members, []).append(late)
            if name in (TORQUES, "steering_wheel_angle"):
                lags.setdefault(inputs, []).append(late)
    for members, found in lags.items():
        around = np.median(found)
        for late in sorted({round(float(lag), 2) for lag in (around, *found)}):
            verb = "are" if len(members) > 1 else "is"
            words = f"{verb} {abs(late):.2f} s {'late' if late > 0 else 'early (the others late)'}"
            yield Hypothesis(
                members,
                words,
                _lines(members, f"delay = {late:.2f}"),
                _shifting(members, late),
            )


def _inputs(signals: Signals) -> tuple[str, ...]:
    names = ("steering_wheel_angle", *DRIVE_TORQUES, *BRAKE_TORQUES)
    return tuple(name for name in names if name in signals.known)


def _clocks(signals: Signals, failing: Sequence[Check]) -> Iterator[Hypothesis]:
    inputs = _inputs(signals)
    for check in failing:
        if check.fit is None or not check.fit.drift:
            continue
        sign = 1.0 if check.channels[0] == TORQUES else -1.0
        rate = sign * check.fit.drift  # by which the inputs' clock runs slow
        yield Hypothesis(
            inputs,
            f"come by another clock, {100 * abs(rate):.2g} % {'slow' if rate > 0 else 'fast'}, "
            "late by a growing time",
            _lines(inputs, f"clock = {1.0 - rate:.5g}"),
            _stretching(inputs, rate),
        )


def _members(name: str, signals: Signals) -> tuple[str, ...]:
    """The channels of the map behind a name that stands in a check."""
    if name == TORQUES:
        return tuple(n for n in (*DRIVE_TORQUES, *BRAKE_TORQUES) if n in signals.known)
    return (name,) if name in signals.known and name not in ("speed", "wheels") else ()


def _lines(members: Sequence[str], text: str) -> str:
    return f"[channels.{shown(members)}] {text}"


def shown(members: Sequence[str]) -> str:
    """Names of channels, those of all wheels as one."""
    names: dict[str, None] = {}
    for name in members:
        stem, _, wheel = name.rpartition("_")
        of_all = wheel in ("fl", "fr", "rl", "rr") and all(
            f"{stem}_{w}" in members for w in ("fl", "fr", "rl", "rr")
        )
        names[f"{stem}_*" if of_all else name] = None
    return ", ".join(names)


def _swapped_lines(names: Sequence[str]) -> str:
    return f"names of [channels.{names[0]}] and [channels.{names[1]}] exchanged"


def _scaling(members: Sequence[str], factor: float) -> Callable[[dict[str, Array], Array], None]:
    def change(known: dict[str, Array], time: Array) -> None:
        for name in members:
            known[name] = factor * known[name]

    return change


def _swapping(
    pairs: Sequence[Sequence[str]],
) -> Callable[[dict[str, Array], Array], None]:
    def change(known: dict[str, Array], time: Array) -> None:
        for first, second in pairs:
            known[first], known[second] = known[second], known[first]

    return change


def _turning(sign: float, rates: bool) -> Callable[[dict[str, Array], Array], None]:
    def change(known: dict[str, Array], time: Array) -> None:
        pairs = [("ax", "ay"), *([("roll_rate", "pitch_rate")] if rates else [])]
        for x, y in pairs:
            known[x], known[y] = -sign * known[y], sign * known[x]

    return change


def _shifting(members: Sequence[str], late: float) -> Callable[[dict[str, Array], Array], None]:
    def change(known: dict[str, Array], time: Array) -> None:
        for name in members:
            known[name] = np.interp(time + late, time, known[name])

    return change


def _stretching(members: Sequence[str], rate: float) -> Callable[[dict[str, Array], Array], None]:
    def change(known: dict[str, Array], time: Array) -> None:
        for name in members:
            known[name] = np.interp(time + rate * (time - time[0]), time, known[name])

    return change
