"""A map to begin with for the log of a bus, proposed by names and units: shown, never applied."""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from scenarios.logs.common_names import Meaning, meaning_of
from scenarios.logs.proposed_line import Choice, Seen, entry, line
from twin import WHEELS
from twin.logs.car_signals import CarSignals

_FEWEST_BITS = 5  # of a measurement; a signal with fewer is a flag or a state
_RATES = (100, 200, 250, 500, 1000)  # [Hz] of the drive
_GAP = 2.5  # periods of the slowest signal that are bridged
_USUAL_GAP = 0.1  # [s] that a map bridges unless it says otherwise

DRIVE = tuple(f"drive_torque_{wheel}" for wheel in WHEELS)
BRAKE = tuple(f"brake_torque_{wheel}" for wheel in WHEELS)
_TRUTH = ("vy", "sideslip")  # what an observer estimates is scored against, not used


class Proposal(NamedTuple):
    """A map as text.

    Attributes:
        text: TOML.
        missing: inputs for which there is no signal; with any the map is not accepted yet.
        meanings: what each signal seems to be, by its name.
    """

    text: str
    missing: tuple[str, ...]
    meanings: Mapping[str, str]


def propose(signals: Iterable[Seen], database: str, car: CarSignals | None) -> Proposal | None:
    """The map that names and units suggest; None if no signal says anything.

    Args:
        signals: of the bus.
        database: its file, as the map names it.
        car: what the car makes of its signals; None: no car is named.
    """
    chosen, meanings = _chosen(signals)
    if not chosen:
        return None
    known = car or CarSignals()
    lines: dict[str, str] = {}  # of channels, by our name
    left_out: list[str] = []
    angles = _angle(chosen, known, left_out)
    torques, constants = _torques(chosen, known, left_out)
    follows = not torques
    measured = [
        name
        for name in chosen
        if name not in (*_TRUTH, *DRIVE, *BRAKE)
        and not name.startswith(("steering", "road_wheel", "motor", "brake", "gear"))
    ]
    used = []
    for name in (*angles, *torques, *measured):
        text, complete = line(name, chosen[name], known)
        lines[name] = text if complete else f"# {text}"
        used += [chosen[name].seen] if complete else []
    given = {name for name in lines if not lines[name].startswith("#")}
    missing = []
    if not any(name in given for name in angles):
        missing.append("steering_wheel_angle")
    if follows and "vx" not in given:
        missing.append("drive and brake torques, or vx")
    truth = [f"{name} = {entry(chosen[name], name, known)}" for name in _TRUTH if name in chosen]
    text = _text(
        [lines[name] for name in sorted(lines, key=_order)], left_out, truth, constants, database,
        follows, used, missing,
    )  # fmt: skip
    return Proposal(text, tuple(missing), meanings)


def _chosen(signals: Iterable[Seen]) -> tuple[dict[str, Choice], dict[str, str]]:
    """The best signal for each channel of ours, and what each signal seems to be."""
    found: dict[str, list[tuple[Seen, Meaning]]] = {}
    for seen in signals:
        meaning = meaning_of(seen.message, seen.signal, seen.channel.unit)
        if meaning is None or (seen.bits < _FEWEST_BITS and meaning.channel != "gear"):
            continue
        found.setdefault(meaning.channel, []).append((seen, meaning))
    chosen = {}
    for channel, candidates in found.items():
        ranked = sorted(candidates, key=_rank, reverse=True)
        (best, meaning), others = ranked[0], ranked[1:]
        chosen[channel] = Choice(best, meaning, tuple(seen.name for seen, _ in others))
    meanings = {seen.name: c for c, candidates in found.items() for seen, _ in candidates}
    return chosen, meanings


def _rank(candidate: tuple[Seen, Meaning]) -> tuple[int, bool, float]:
    seen, meaning = candidate
    return meaning.score, bool(np.ptp(seen.channel.values) > 0.0), round(seen.rate, 1)


def _angle(chosen: Mapping[str, Choice], car: CarSignals, left_out: list[str]) -> tuple[str, ...]:
    """Names of the channels that give the steering."""
    sides = ("road_wheel_angle_left", "road_wheel_angle_right")
    if "steering_wheel_angle" in chosen:
        return ("steering_wheel_angle",)
    names = sides if all(name in chosen for name in sides) else ("road_wheel_angle",)
    names = tuple(name for name in names if name in chosen)
    if names and car.steering_ratio is None:
        left_out += [
            f"{line(name, chosen[name], car)[0]}; needs --vehicle, or steering_ratio in [car]"
            for name in names
        ]
        return ()
    return names


def _torques(
    chosen: Mapping[str, Choice], car: CarSignals, left_out: list[str]
) -> tuple[tuple[str, ...], dict[str, float]]:
    """Names of the channels that give all torques, and what is constant; none if one is missing."""
    constants: dict[str, float] = {}
    drive = tuple(name for name in DRIVE if name in chosen)
    axles = [DRIVE[:2], DRIVE[2:]]
    if drive and len(drive) < 4 and drive in axles:  # the other axle is not driven, it seems
        constants = {name: 0.0 for name in DRIVE if name not in drive}
    elif len(drive) < 4:
        drive = ()
    brake = tuple(name for name in BRAKE if name in chosen)
    brake = brake if len(brake) == 4 else ()
    reasons = []
    if not drive:
        drive, why = _motors(chosen, car)
        reasons += why
    if not brake:
        brake, why = _pressures(chosen, car)
        reasons += why
    if drive and brake:
        return (*drive, *brake), constants
    of_torque = [
        name for name in chosen if name.startswith(("drive_torque", "brake_", "motor", "gear"))
    ]
    left_out += [line(name, chosen[name], car)[0] for name in of_torque]
    if of_torque:
        left_out += [f"Torques are not used: {'; '.join(reasons)}."]
    return (), {}


def _motors(chosen: Mapping[str, Choice], car: CarSignals) -> tuple[tuple[str, ...], list[str]]:
    axles = tuple(name for name in ("motor_torque_front", "motor_torque_rear") if name in chosen)
    names = axles or tuple(name for name in ("motor_torque",) if name in chosen)
    if not names:
        return (), ["no drive torques"]
    if car.final_drive is None or (not axles and car.driven is None):
        return (), ["motor torques need final_drive and driven in [car] or the car's file"]
    if not axles and car.driven == "all" and car.front_share is None:
        return (), ["motor torques need front_share in [car] or the car's file"]
    if len(car.gear_ratios) > 1:
        if "gear" not in chosen:
            return (), ["motor torques need the gear"]
        return (*names, "gear"), []
    return names, []


def _pressures(chosen: Mapping[str, Choice], car: CarSignals) -> tuple[tuple[str, ...], list[str]]:
    axles = ("brake_pressure_front", "brake_pressure_rear")
    names = axles if all(name in chosen for name in axles) else ("brake_pressure",)
    if not all(name in chosen for name in names):
        return (), ["no brake torques"]
    if car.brake_torque_per_bar_front is None or car.brake_torque_per_bar_rear is None:
        return (), [
            "brake pressures need brake_torque_per_bar_front and _rear in [car] or the car's file"
        ]
    return names, []


def _order(name: str) -> int:
    """Where a channel stands in the map: steering, torques, measurements."""
    starts = ("steering", "road_wheel", "drive", "motor", "gear", "brake", "ax", "ay", "az")
    for k, start in enumerate(starts):
        if name.startswith(start):
            return k
    return len(starts) + ("rate" not in name) + name.startswith("wheel_speed")


def _text(
    lines: Sequence[str],
    left_out: Sequence[str],
    truth: Sequence[str],
    constants: Mapping[str, float],
    database: str,
    follows: bool,
    used: Sequence[Seen],
    missing: Sequence[str],
) -> str:
    """The map as TOML."""
    rates = [seen.rate for seen in used]
    rate = next((r for r in _RATES if r >= 0.95 * max(rates, default=0.0)), _RATES[-1])
    gap = _GAP / min(rates, default=100.0)
    said = [f"# NOT COMPLETE, no signal found for: {'; '.join(missing)}"] if missing else []
    said += [f"rate = {rate}"]
    if gap > _USUAL_GAP:
        said.append(f"longest_gap = {min(gap, 10.0):.3g}  # [s], of the slowest signal")
    if follows:
        said.append("follow_speed = true  # without torques: sideslip, but no mass, no til live")
    said += ["", "[can]", f"database = {json.dumps(database, ensure_ascii=False)}"]
    said += ["", "[channels]", *lines, *(f"# {line}" for line in left_out)]
    if truth:
        said += ["", "[truth]  # only scored against", *truth]
    said += ["", "[constants]", "road_height = 0.0"]
    said += [f"{name} = 0.0  # this axle is not driven?" for name in constants]
    return "\n".join(said)
