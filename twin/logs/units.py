"""Units that logs come in, and what each of our channels is measured in."""

import math
import re

from twin.channels import FURTHER_OUTPUTS, INPUTS, OUTPUTS

GRAVITY = 9.80665  # [m/s2], standard gravity, ISO 80000-3

# By kind of quantity: unit, and how much of ours (SI) one of it is. The first one is ours.
UNITS = {
    "angle": {"rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0},
    "angular rate": {
        "rad/s": 1.0,
        "deg/s": math.pi / 180.0,
        "°/s": math.pi / 180.0,
        "rpm": math.pi / 30.0,
        "1/min": math.pi / 30.0,
    },
    "speed": {
        "m/s": 1.0,
        "km/h": 1.0 / 3.6,
        "kph": 1.0 / 3.6,
        "mph": 0.44704,
        "kn": 1852.0 / 3600.0,
        "ft/s": 0.3048,
    },
    "acceleration": {
        "m/s2": 1.0,
        "m/s^2": 1.0,
        "m/s²": 1.0,
        "g": GRAVITY,
        "G": GRAVITY,
        "mg": 1e-3 * GRAVITY,
        "ft/s2": 0.3048,
    },
    "torque": {
        "N m": 1.0,
        "Nm": 1.0,
        "N*m": 1.0,
        "kN m": 1e3,
        "kNm": 1e3,
        "lbf ft": 1.3558179483,
    },
    "force": {"N": 1.0, "kN": 1e3, "lbf": 4.4482216153},
    "pressure": {"bar": 1.0, "Pa": 1e-5, "kPa": 1e-2, "MPa": 10.0, "psi": 0.0689475729},
    "slope": {"rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0, "%": 0.01},
    "number": {"1": 1.0},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254},
    "ratio": {"1": 1.0, "%": 0.01},
    "time": {
        "s": 1.0,
        "ms": 1e-3,
        "us": 1e-6,
        "ns": 1e-9,
        "min": 60.0,
        "h": 3600.0,
        "d": 86400.0,
    },
}

# Other spellings, in lower case and without spaces; unit_... are those of Volkswagen's databases
_ALIASES = {
    "angle": {
        "rad": "rad radian radians rads",
        "deg": "deg degree degrees degs grad_angle unit_degreofarc",
        "°": "º",
    },
    "angular rate": {
        "rad/s": "rad/sec radian/s radians/s rads/s radps rad/second rads/sec rads^-1",
        "deg/s": "deg/sec degree/s degrees/s degs/s degps dps deg/second degrees/sec º/s °/sec "
        "unit_degreofarcpersecon unit_degrepersecon",
        "rpm": "rev/min r/min u/min tr/min min-1 min^-1",
    },
    "speed": {
        "m/s": "m/sec mps meter/s metres/s meters/s ms^-1 ms-1 unit_meterpersecon",
        "km/h": "kmh kmph km/hr km/hour kmh-1 kmh^-1 unit_kilometerperhour",
        "mph": "mi/h miles/h mile/h",
        "kn": "kt kts knot knots",
        "ft/s": "fps ft/sec",
    },
    "acceleration": {
        "m/s2": "m/s/s m/sec2 m/sec^2 m/s**2 ms-2 ms^-2 mps2 m/(s2) m/(s^2) m/ss meter/s2 "
        "unit_meterperseconsquar",
        "g": "gn g0 gee gs unit_forceofgravi",
    },
    "torque": {
        "N m": "n.m n·m n⋅m newtonmeter newtonmetre newton-meter newtonmeters n-m unit_newtometer",
        "kN m": "kn*m kn.m kn·m",
        "lbf ft": "lb-ft lbft lbfft ft-lb ftlb ft-lbf ftlbf lbf-ft lb*ft ft*lb lb.ft lbs-ft ft-lbs",
    },
    "force": {"N": "newton newtons", "lbf": "lb lbs pound pounds"},
    "pressure": {
        "bar": "bars unit_bar",
        "psi": "lbf/in2 psig psia",
        "kPa": "kilopascal",
        "Pa": "pascal",
    },
    "length": {
        "m": "meter metre meters metres",
        "mm": "millimeter millimetre millimeters millimetres",
        "cm": "centimeter centimetre",
        "in": "inch inches",
    },
    "ratio": {"%": "percent pct unit_percent", "1": "- ratio"},
    "time": {
        "s": "sec secs second seconds sek sekunde sekunden unixtime unix epoch posix utcseconds",
        "ms": "msec msecs millis milli millisec millisecs millisecond milliseconds msek",
        "us": "usec usecs µs μs µsec μsec micros microsec microsecond microseconds",
        "ns": "nsec nsecs nanos nanosec nanosecond nanoseconds",
        "min": "mins minute minutes",
        "h": "hr hrs hour hours",
        "d": "day days",
    },
}

_COUNTED = re.compile(r"([0-9.]+(?:e[+-]?[0-9]+)?)\*?([a-zµμ]+)", re.ASCII | re.IGNORECASE)

# By what a channel's name starts with
_KINDS = {
    "steering_wheel_angle": "angle",
    "drive_torque": "torque",
    "brake_torque": "torque",
    "road_height": "length",
    **dict.fromkeys(("ax", "ay", "az"), "acceleration"),
    **dict.fromkeys(("roll_rate", "pitch_rate", "yaw_rate", "wheel_speed"), "angular rate"),
    **dict.fromkeys(("vx", "vy"), "speed"),
    **dict.fromkeys(("sideslip", "roll", "pitch"), "angle"),
    "suspension_travel": "length",
    "accelerator_pedal": "ratio",
    # signals of cars, see `twin.logs.car_signals`
    "speed": "speed",
    **dict.fromkeys(("motor_torque", "motor_torque_front", "motor_torque_rear"), "torque"),
    **dict.fromkeys(("brake_pressure", "brake_pressure_front", "brake_pressure_rear"), "pressure"),
    **dict.fromkeys(
        ("road_wheel_angle", "road_wheel_angle_left", "road_wheel_angle_right", "course"), "angle"
    ),
    **dict.fromkeys(("slope", "bank"), "slope"),
    "gear": "number",
}

CHANNELS = (*INPUTS, *OUTPUTS, *FURTHER_OUTPUTS)


def kind_of(channel: str) -> str:
    """The kind of quantity of one of our channels; `UNITS` of it starts with our unit."""
    if channel in _KINDS:
        return _KINDS[channel]
    return _KINDS[channel.rpartition("_")[0]]


def our_unit(channel: str) -> str:
    """The unit of one of our channels."""
    return next(iter(UNITS[kind_of(channel)]))


def in_si(kind: str, unit: str) -> float | None:
    """How much of our unit one of another unit is; None if the unit is unknown.

    Args:
        kind: of `UNITS`.
        unit: in any usual spelling; units of time may carry a number, as in "10 ms".
    """
    units = UNITS[kind]
    text = unit.strip()
    if text in units:
        return units[text]
    plain = _plain(text)
    if plain in _SPELLINGS[kind]:
        return units[_SPELLINGS[kind][plain]]
    counted = _COUNTED.fullmatch(plain) if kind == "time" else None
    if counted is None:
        return None
    one = _SPELLINGS["time"].get(counted.group(2).lower())
    try:
        number = float(counted.group(1))
    except ValueError:
        return None
    return number * units[one] if one is not None and 0.0 < number < 1e9 else None


def is_unit(text: str) -> bool:
    """Whether a text is a unit of any kind that is known here, or of a few others."""
    if not text.strip():
        return False
    plain = _plain(text)
    return plain in _OTHERS or any(in_si(kind, text) is not None for kind in UNITS)


def _plain(unit: str) -> str:
    text = unit.strip().lower().replace(" per ", "/")
    text = text.replace("²", "2").replace("^2", "2").replace("⁻", "-").replace("¹", "1")
    return "".join(text.split())


def _spellings() -> dict[str, dict[str, str]]:
    """Plain spelling to unit, by kind; one that two units share stands for neither."""
    found: dict[str, dict[str, str]] = {}
    for kind, units in UNITS.items():
        words_of_kind = _ALIASES.get("angle" if kind == "slope" else kind, {})
        plain: dict[str, str] = {}
        for unit in units:
            # "mg" and "Mg", "ms" and "Ms": the case of a metric prefix is not looked at
            plain.setdefault(_plain(unit), unit)
        for unit, words in words_of_kind.items():
            for word in words.split():
                plain.setdefault(_plain(word), unit)
        found[kind] = plain
    return found


_SPELLINGS = _spellings()
# Units of channels that nobody maps, by which a row of units is recognised
_OTHERS = {
    "%", "1", "-", "#", "v", "mv", "a", "ma", "ohm", "hz", "khz", "°c", "c", "°f", "f", "degc",
    "k", "l", "l/h", "g/s", "kg", "kg/s", "km", "mi", "ft", "w", "kw", "hp", "ps", "j",
    "bool", "count", "counts", "raw", "ticks", "fix", "datetime", "date", "mbar", "hpa", "lambda",
    "afr", "ratio",
}  # fmt: skip
