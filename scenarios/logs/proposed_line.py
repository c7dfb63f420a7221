"""The line of a proposed map: a signal of a bus for a channel of ours, with remarks about it."""

import json
from collections.abc import Sequence
from typing import NamedTuple

from scenarios.logs.common_names import Meaning, sign_of
from twin import CHANNEL, TwinError
from twin.logs.car_signals import CarSignals
from twin.logs.map import unit_in_si
from twin.logs.raw_log import Channel
from twin.logs.units import kind_of

GUESSED_RADIUS = 0.33  # [m] of a wheel, if no car is named
_SHOWN = 3  # further signals with the same meaning
_SIGNED = ("steering", "road_wheel", "yaw_rate", "ay")  # of both signs in any drive with bends


class Seen(NamedTuple):
    """A signal that is on the bus.

    Attributes:
        message, signal: its names.
        bits: that it has.
        channel: its samples.
        others: names of the other signals of its message.
    """

    message: str
    signal: str
    bits: int
    channel: Channel
    others: Sequence[str]

    @property
    def name(self) -> str:
        """As a map names it."""
        return f"{self.message}.{self.signal}"

    @property
    def rate(self) -> float:
        """Samples a second."""
        time = self.channel.time
        return (time.size - 1) / max(float(time[-1] - time[0]), 1e-9)


class Choice(NamedTuple):
    """The signal that is proposed for a channel of ours.

    Attributes:
        seen: the signal.
        meaning: what it seems to be.
        also: others that seem to be the same.
    """

    seen: Seen
    meaning: Meaning
    also: tuple[str, ...]


def line(name: str, choice: Choice, car: CarSignals) -> tuple[str, bool]:
    """A channel's line of the map, and whether it is complete."""
    seen, complete = choice.seen, choice.meaning.unit
    values = seen.channel.values
    low, high = float(values.min()), float(values.max())
    unit = _clean(seen.channel.unit)
    remarks = [f"{low:.4g} to {high:.4g} {unit}".rstrip() + f", {seen.rate:.4g} Hz"]
    if not complete:
        remarks.append("the database gives no unit: enter it")
    if low == high:
        remarks.append("does not change in this log")
    elif low >= 0.0:
        sign = sign_of(seen.signal, seen.others)
        if sign or name.startswith(_SIGNED):
            remarks.append(f"is never negative: its sign may be in {sign or 'another signal'}")
    if complete and _beyond(name, choice, low, high):
        remarks.append("has values that no car has")
    if _needs_radius(name, seen.channel.unit) and car.radius is None:
        remarks.append("the radius is a guess: enter yours")
    if choice.also:
        remarks.append(f"or {', '.join(choice.also[:_SHOWN])}")
    return f"{name} = {entry(choice, name, car)}  # {'; '.join(remarks)}", complete


def entry(choice: Choice, name: str, car: CarSignals) -> str:
    """The table of a signal, in one line."""
    fields = [f"name = {json.dumps(choice.seen.name, ensure_ascii=False)}"]
    if not choice.meaning.unit:
        fields.append('unit = "?"')
    if _needs_radius(name, choice.seen.channel.unit):
        fields.append(f"radius = {car.radius or GUESSED_RADIUS:.4g}")
    return f"{{ {', '.join(fields)} }}"


def _needs_radius(name: str, unit: str) -> bool:
    """Whether a wheel's speed is that of its circumference."""
    if not name.startswith("wheel_speed") or not unit:
        return False
    try:
        unit_in_si(name, unit, None)
    except TwinError:
        return True
    return False


def _beyond(name: str, choice: Choice, low: float, high: float) -> bool:
    if name not in CHANNEL or kind_of(name) == "number":
        return False
    scale = unit_in_si(name, choice.seen.channel.unit, GUESSED_RADIUS)
    record = CHANNEL[name]
    return scale * low < record.low or scale * high > record.high


def _clean(text: str) -> str:
    """A text that a comment can hold."""
    return "".join(c if c.isprintable() else "?" for c in text)[:20]
