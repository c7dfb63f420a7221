"""What signals of cars' buses usually are, by their names and units: English, German, and ours.

A proposal only: names lie. `scenarios.logs.proposal` shows what follows from it as a map.
"""

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from twin import WHEELS, TwinError
from twin.logs.map import unit_in_si
from twin.logs.units import kind_of

_TYPICAL_RADIUS = 0.33  # [m]; any does to ask whether a unit is one of a wheel's speed

# Words of what a car is asked to do, of quality, limits and raw data: no measurement
_NO_MEASUREMENT = {
    *("target", "tgt", "req", "request", "requested", "cmd", "command", "desired", "des", "dsrd"),
    *("soll", "setpoint", "set", "anf", "anforderung", "wunsch", "demand", "dmd", "want"),
    *("valid", "vld", "validity", "quality", "qual", "qf", "bit", "status", "stat", "state"),
    *("fault", "flt", "fehler", "err", "error", "offset", "ofst", "bias", "max", "min", "maximum"),
    *("minimum", "limit", "lim", "crc", "checksum", "counter", "cnt", "bz", "temp", "raw", "roh"),
    *("tolerance", "confidence", "sd", "std", "stddev", "variance", "vz", "sign", "gradient"),
    *("estimated", "predicted", "display", "anzeige", "avg", "average", "idle", "loss", "losses"),
}
_LEFT = {"l", "le", "lft", "left", "lh", "li", "links"}
_RIGHT = {"r", "ri", "rt", "rgt", "right", "rh", "re", "rechts"}
_FRONT = {"f", "fr", "frt", "frnt", "fnt", "front", "v", "vo", "vorn", "vorne"}
_REAR = {"r", "re", "rr", "rear", "back", "h", "hi", "hinten", "ra"}
_CORNERS = {"fl": "fl", "fr": "fr", "rl": "rl", "rr": "rr", "vl": "fl", "vr": "fr", "hl": "rl",
            "hr": "rr", "lf": "fl", "rf": "fr", "lr": "rl"}  # fmt: skip


class _Rule(NamedTuple):
    """A channel of ours, and the names that it goes by.

    Attributes:
        channel: ours; {wheel} and {axle} stand for what the name says.
        long: pattern in the name without its separators.
        short: words of which one does as well.
        no: pattern that the name must not have.
    """

    channel: str
    long: str
    short: frozenset[str] = frozenset()
    no: str = "$^"


def _rule(channel: str, long: str, short: str = "", no: str = "$^") -> _Rule:
    return _Rule(channel, long, frozenset(short.split()), no)


_DRIVING = "motor|engine|drive|drivetrain|propulsion|antrieb|kupplung|crank"
# The first one that fits is taken
_RULES = (
    _rule("steering_wheel_angle", "steer|lenk|handwheel", "sas swa lws hwa lrw",
          no="roadwheel|frontwheel|rack|pinion|motor|column.?torq|rear|lenkeinschlag"),
    _rule("road_wheel_angle_{side}", "roadwheel|frontwheelangle|radwinkel|lenkeinschlag", "rwa",
          no="rear|hinten"),
    _rule("road_wheel_angle", "roadwheel|frontwheelangle|steeringangleatwheel|lenkeinschlag",
          "rwa", no="rear|hinten"),
    _rule("yaw_rate", "yaw|gier|gyro.?z|ang(ular)?(rate|vel(ocity)?).?z|omegaz|ratez|rotz", "wz"),
    _rule("roll_rate", "roll|wank|gyro.?x|ang(ular)?(rate|vel(ocity)?).?x|omegax|ratex|rotx",
          "wx rol"),
    _rule("pitch_rate", "pitch|nick|gyro.?y|ang(ular)?(rate|vel(ocity)?).?y|omegay|ratey|roty",
          "wy"),
    _rule("wheel_speed_{wheel}", "wheel|whl|whsp|rad|speed|spd|geschw|drehz|rotat", "ws v w n",
          no="steer|lenk|target"),
    _rule("ax", "long|laengs|forward|accel?.?x|acc.?x|beschl.?x", "ax fwd lgt"),
    _rule("ay", "lat|quer|transv|accel?.?y|acc.?y|beschl.?y", "ay"),
    _rule("az", "vert|accel?.?z|acc.?z|beschl.?z|hub", "az"),
    _rule("sideslip", "sideslip|slipangle|schwimm|bodyslip", "beta"),
    _rule("vy", "lateral.?(vel|speed)|vel(ocity)?.?(y|lateral)|quergeschw", "vy"),
    _rule("vx", "veh|speed|spd|velocity|vel|geschw|forward|esp.?v.?signal", "v vx vfzg",
          no="wheel|rad|engine|motor|wind|fan|cruise|gps|gnss|vertical|down|north|east|vely|velz"),
    _rule("brake_torque_{wheel}", "brak|brems|brk"),
    _rule("drive_torque_{wheel}", "torq|trq|moment|drehm|drive|motor|antrieb", "tq m mot em",
          no="steer|lenk"),
    _rule("motor_torque_{axle}", _DRIVING, "eng mot mg em edu", no="brake|steer|lenk|spring"),
    _rule("motor_torque", _DRIVING, "eng mot mg em edu", no="brake|steer|lenk|eps"),
    _rule("brake_pressure_{axle}", "brak|brems|brk|mastercyl|cylpres|hauptzyl"),
    _rule("brake_pressure", "brak|brems|brk|mastercyl|cylpres|hauptzyl", "mc mcp thz",
          no="vacuum|booster|unterdruck|parking"),
    _rule("accelerator_pedal", "accelerator|accelped|gaspedal|fahrpedal|throttleped", "app gas"),
    _rule("gear", "gear|gang", no="ratio|shift|reverse|lever|selector|wahl"),
)  # fmt: skip


class Meaning(NamedTuple):
    """What a signal seems to be.

    Attributes:
        channel: of ours, or a signal of cars.
        unit: whether the database gives one that fits; else it gives none.
        score: higher is better.
    """

    channel: str
    unit: bool
    score: int


def meaning_of(message: str, signal: str, unit: str) -> Meaning | None:
    """What a signal seems to be; None if nothing that we know.

    Args:
        message: its name, which may tell the axle.
        signal: its name.
        unit: as the database gives it; empty if it gives none.
    """
    words = words_of(signal)
    if _NO_MEASUREMENT & set(words):
        return None
    joined = "".join(words)
    of_message = words_of(message)
    for rule in _RULES:
        if not (re.search(rule.long, joined) or rule.short & set(words)):
            continue
        if re.search(rule.no, joined):
            continue
        channel = _placed(rule.channel, words, of_message)
        if channel is None or not (unit or _says_enough(channel, joined)):
            continue
        if channel.startswith("brake_pressure") and wheel_of(words):
            continue  # of one caliper
        if unit and not _fits(channel, unit):
            continue
        score = 2 * (signal.lower() == channel) + bool(unit) - ("gps" in joined)
        return Meaning(channel, bool(unit) or kind_of(channel) == "number", score)
    return None


def words_of(name: str) -> list[str]:
    """The words of a name in lower case: of WhlSpd_FL2 whl, spd, fl, 2."""
    found = re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-zäöüß]+|[A-ZÄÖÜ]+|\d+", name)
    return [word.lower() for word in found]


def sign_of(signal: str, others: Sequence[str]) -> str | None:
    """Among a message's signals the one that seems to hold another's sign, as some cars have it."""
    words = set(words_of(signal))
    for other in others:
        marks = set(words_of(other)) - words
        if words - {"abs"} <= set(words_of(other)) | marks and marks & {"vz", "sign", "vorzeichen"}:
            return other
    return None


def _says_enough(channel: str, joined: str) -> bool:
    """Whether a name without a unit says what is measured."""
    if channel.startswith("steering"):
        return re.search("ang|winkel|pos", joined) is not None
    if channel == "yaw_rate":
        return re.search("rate", joined) is not None
    return kind_of(channel) == "number" or channel.startswith("wheel_speed")


def _fits(channel: str, unit: str) -> bool:
    if kind_of(channel) == "number":
        return True
    try:
        unit_in_si(channel, unit, _TYPICAL_RADIUS)
    except TwinError:
        return False
    return True


def _placed(channel: str, words: Sequence[str], of_message: Sequence[str]) -> str | None:
    """A rule's channel with the wheel, side or axle that a name says; None if it says none."""
    if "{wheel}" in channel:
        wheel = wheel_of(words) or wheel_of([*of_message, *words])
        return None if wheel is None else channel.format(wheel=wheel)
    if "{side}" in channel:
        side = "left" if set(words) & _LEFT else "right" if set(words) & (_RIGHT - {"re"}) else None
        return None if side is None else channel.format(side=side)
    if "{axle}" in channel:
        front, rear = set(words) & (_FRONT - {"f", "v"}), set(words) & (_REAR - {"r", "h"})
        return None if bool(front) == bool(rear) else channel.format(
            axle="front" if front else "rear"
        )  # fmt: skip
    return channel


def wheel_of(words: Sequence[str]) -> str | None:
    """The wheel that words say, or None."""
    for first, second in pairwise(words):
        for one, other in ((first, second), (second, first)):
            if one in _FRONT and other in _LEFT | _RIGHT and one != other:
                return "fl" if other in _LEFT else "fr"
            if one in _REAR and other in _LEFT | _RIGHT:
                return "rl" if other in _LEFT else "rr"
    for word in words:
        if word in _CORNERS:
            return _CORNERS[word]
    for word in words:  # as in wheelspeedfl
        if len(word) > 5 and word[-2:] in WHEELS and word[:2] not in WHEELS:
            return word[-2:]
    axle = "f" if set(words) & (_FRONT - {"f", "fr", "v"}) else (
        "r" if set(words) & (_REAR - {"r", "re", "rr", "h"}) else ""
    )  # fmt: skip
    side = "l" if set(words) & (_LEFT - {"l", "le"}) else (
        "r" if set(words) & (_RIGHT - {"r", "re", "rh"}) else ""
    )  # fmt: skip
    return axle + side if axle and side else None
