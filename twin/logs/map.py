"""The map of a log: a small TOML file that says which of its channels are ours, and how.

    axes = "SAE"            # of the log: "ISO" (ISO 8855, the default) or "SAE" (J670, z down)
    rate = 1000             # of the drive [Hz]; the twin's by default
    longest_gap = 0.1       # up to so many seconds are interpolated
    follow_speed = false    # true: no torques in the log, the twin follows the measured vx

    free_of_gravity = false # true: accelerations of motion (GNSS/INS), not what an accelerometer
                            # shows, its specific force: at rest 9.81 m/s2 upwards

    [time]                  # tables; MDF, MCAP and ROS 2 bags have times of their own
    name = "t"              # by default the column that is called time, or declared to be it
    unit = "s"              # by default the one that the log gives; none for timestamps

    [can]                   # raw CAN logs (BLF, ASC, candump, TRC, CSV, MF4)
    database = "car.dbc"    # DBC, ARXML, KCD or SYM, beside the map; channels are "Message.signal"

    [channels.ax]           # an input or measurement of ours
    name = "LongAcc"        # the log's channel
    unit = "g"              # by default the one that the log gives
    sign = 1                # or -1: beyond what the axes say
    factor = 1.0            # units per number of the log, for example N m per bar of brake pressure
    offset = 0.0            # what the log shows at zero, in its own numbers
    delay = 0.0             # [s] by which the log is late
    clock = 1.0             # seconds that one of this channel's lasts, if another clock stamped it
    radius = 0.34           # [m], wheel speeds in km/h only

    [truth.sideslip]        # as [channels], of what only scoring may see

    [constants]             # inputs that the log has not; road_height means that of all four wheels
    road_height = 0.0

    [car]                   # what turns signals of cars into ours, if the car's file says nothing
    final_drive = 9.1       # beside: gear_ratios, efficiency, driven, front_share,
    driven = "rear"         # brake_torque_per_bar_front and _rear (both wheels, N m per bar),
                            # steering_ratio, radius

Instead of ours, [channels] may have signals as cars have them: `motor_torque` (or `_front` and
`_rear`) with `gear`; `brake_pressure` (or `_front` and `_rear`); `road_wheel_angle`, or those of
both front wheels, `road_wheel_angle_left` and `_right`; `speed`, one for all wheels; `course` over
ground; and, for accelerations free of gravity, `slope` (uphill positive) and `bank` (the road's
left side higher), as angles or in %. See `twin.logs.car_signals`.

A number v of the log becomes sign * unit * factor * (v - offset). In SAE axes y points to the right
and z down: signs of ay, az, pitch and yaw rate, pitch, v_y, sideslip and hand wheel turn round.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from twin.channels import FURTHER_OUTPUTS, INPUTS, OUTPUTS, WHEELS
from twin.errors import TwinError
from twin.logs.car_signals import GIVES, CarSignals
from twin.logs.log_time import TimeWanted
from twin.logs.raw_log import Wanted
from twin.logs.units import UNITS, in_si, kind_of
from twin.toml_file import Table, read_toml

TORQUES = tuple(name for name in INPUTS if "torque" in name)
MEASURABLE = (*OUTPUTS, *FURTHER_OUTPUTS)
# What turns its sign between ISO 8855 and SAE J670
TURNED = (
    "steering_wheel_angle",
    "road_wheel_angle",
    "road_wheel_angle_left",
    "road_wheel_angle_right",
    "ay",
    "az",
    "pitch_rate",
    "yaw_rate",
    "vy",
    "sideslip",
    "pitch",
)

_KEYS = (
    *("axes", "rate", "longest_gap", "follow_speed", "free_of_gravity"),
    *("time", "can", "channels", "truth", "constants", "car"),
)
_CHANNEL_KEYS = ("name", "unit", "sign", "factor", "offset", "delay", "clock", "radius")
_LARGEST = 1e9  # of factors, offsets and constants


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Where a channel of ours comes from.

    Attributes:
        name: of the log's channel.
        unit: of its numbers times `factor`; None: what the log says.
        sign: 1 or -1, the axes' turn included.
        factor, offset: see above.
        delay: [s].
        clock: seconds that one of the channel's lasts.
        radius: of the wheel [m], that turns a wheel's speed in m/s into rad/s; None: not needed.
    """

    name: str
    unit: str | None
    sign: float
    factor: float
    offset: float
    delay: float
    clock: float
    radius: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LogMap:
    """What the map of a log says.

    Attributes:
        path: of the map.
        axes: "ISO" or "SAE".
        rate: of the drive [Hz].
        longest_gap: [s].
        follow_speed: whether the twin is to follow the measured speed.
        time_name: of the time's column; None: as the log has it.
        time_unit: [s]; None: as the log has it.
        database: of the messages of a raw CAN log; None: the log is none.
        channels: where inputs and measurements come from, by our names.
        truth: where truth comes from.
        constants: of inputs that the log has not [SI].
        free_of_gravity: whether the accelerations are those of motion.
        car: the table [car]; None if there is none.
    """

    path: Path
    axes: str
    rate: float
    longest_gap: float
    follow_speed: bool
    time_name: str | None
    time_unit: float | None
    database: Path | None
    channels: dict[str, Source]
    truth: dict[str, Source]
    constants: dict[str, float]
    free_of_gravity: bool = False
    car: Table | None = None

    @classmethod
    def load(cls, path: str | Path) -> "LogMap":
        """Reads a map.

        Raises:
            TwinError: the file is missing or broken, a field is unknown, or an input is neither
                mapped nor declared.
        """
        return cls._of_table(read_toml(path))

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> "LogMap":
        """A map from its content, as TOML would have it.

        Raises:
            TwinError: see `load`.
        """
        return cls._of_table(Table("map", "", content))

    @classmethod
    def _of_table(cls, table: Table) -> "LogMap":
        table.check_keys(_KEYS)
        axes = table.choice("axes", "ISO", ("ISO", "SAE"))
        time = table.table("time")
        time.check_keys(("name", "unit"))
        allowed = (*INPUTS, *MEASURABLE, *GIVES)
        log_map = cls(
            path=Path(table.path),
            axes=axes,
            rate=table.number("rate", 1000.0, 1.0, 1e4),
            longest_gap=table.number("longest_gap", 0.1, 0.0, 1e3),
            follow_speed=table.flag("follow_speed"),
            time_name=time.text("name"),
            time_unit=_time_unit(time),
            database=_database(table),
            channels=_sources(table.table("channels"), allowed, axes),
            truth=_sources(table.table("truth"), MEASURABLE, axes),
            constants=_constants(table.table("constants")),
            free_of_gravity=table.flag("free_of_gravity"),
            car=table.table("car") if "car" in table else None,
        )
        if log_map.car is not None:
            CarSignals.of(log_map.car)
        _check_inputs(log_map)
        return log_map

    @property
    def wanted(self) -> Wanted:
        """What the reader of a log has to know of the map."""
        sources = (*self.channels.values(), *self.truth.values())
        return Wanted(
            TimeWanted(self.time_name, self.time_unit),
            frozenset(s.name for s in sources),
            self.database,
        )

    @property
    def input_names(self) -> tuple[str, ...]:
        """Inputs of the drive: all of ours, or all but the torques."""
        return tuple(name for name in INPUTS if not (self.follow_speed and name in TORQUES))


def _database(table: Table) -> Path | None:
    """The file that [can] names, beside the map."""
    can = table.table("can")
    can.check_keys(("database",))
    name = can.text("database")
    return None if name is None else Path(table.path).parent / name


def _time_unit(table: Table) -> float | None:
    """Seconds that one of the time's numbers is; None if the map does not say."""
    unit = table.text("unit")
    if unit is None:
        return None
    factor = in_si("time", unit)
    if factor is None:
        table.refuse("unit", f"{', '.join(UNITS['time'])}, or a number of them as in '10 ms'")
    return factor


def _sources(table: Table, allowed: tuple[str, ...], axes: str) -> dict[str, Source]:
    table.check_keys(allowed)
    return {name: _source(name, entry, axes) for name, entry in table.tables()}


def _source(channel: str, table: Table, axes: str) -> Source:
    table.check_keys(_CHANNEL_KEYS)
    name = table.text("name")
    if name is None:
        table.refuse("name", "the name of a channel of the log")
    turned = -1.0 if axes == "SAE" and channel in TURNED else 1.0
    sign = table.number("sign", 1.0, -1.0, 1.0)
    if abs(sign) != 1.0:
        table.refuse("sign", "1 or -1")
    factor = table.number("factor", 1.0, -_LARGEST, _LARGEST)
    if factor == 0.0:
        table.refuse("factor", "a number that is not 0")
    unit = table.text("unit")
    radius = None
    if "radius" in table:
        if not channel.startswith("wheel_speed"):
            table.refuse("radius", "none, but for wheel speeds")
        radius = table.number("radius", 0.0, 0.05, 2.0)
    if unit is not None:
        try:
            unit_in_si(channel, unit, radius)
        except TwinError as error:
            raise TwinError(f"{table.path}: {table.place}.unit {error}") from None
    return Source(
        name=name,
        unit=unit,
        sign=sign * turned,
        factor=factor,
        offset=table.number("offset", 0.0, -_LARGEST, _LARGEST),
        delay=table.number("delay", 0.0, -10.0, 10.0),
        clock=table.number("clock", 1.0, 0.9, 1.1),
        radius=radius,
    )


def unit_in_si(channel: str, unit: str, radius: float | None) -> float:
    """How much of a channel's SI unit one of another unit is.

    Args:
        channel: one of ours.
        unit: a unit of its kind, or of speed if it is a wheel's.
        radius: of the wheel [m], for a unit of speed.

    Raises:
        TwinError: no such unit for this channel; the message starts after its name.
    """
    kind = kind_of(channel)
    scale = in_si(kind, unit)
    if scale is None and channel.startswith("wheel_speed"):
        scale = in_si("speed", unit)
        if scale is not None and not radius:
            raise TwinError(
                f"is {unit!r}, which needs the wheel's radius; allowed: radius = a number"
            )
        scale = scale / radius if scale is not None and radius else None
    if scale is None:
        units = (*UNITS[kind], *(UNITS["speed"] if channel.startswith("wheel_speed") else ()))
        raise TwinError(f"is {unit[:40]!r}; allowed: {', '.join(units)}")
    return scale


def _constants(table: Table) -> dict[str, float]:
    groups = ("drive_torque", "brake_torque", "road_height")
    table.check_keys((*INPUTS, *groups))
    constants: dict[str, float] = {}
    for key in table.values:
        value = table.number(key, 0.0, -_LARGEST, _LARGEST)
        for name in [f"{key}_{wheel}" for wheel in WHEELS] if key in groups else [key]:
            if name in constants:
                table.refuse(key, f"one value for {name}")
            constants[name] = value
    return constants


def _check_inputs(log_map: LogMap) -> None:
    """Checks that each input is mapped or declared, once."""
    path, given = log_map.path, {**log_map.constants, **log_map.channels}
    for signal in log_map.channels:
        for name in GIVES.get(signal, ()):
            if name in log_map.channels:
                raise TwinError(
                    f"{path}: channels.{name} is given beside channels.{signal}, which gives it; "
                    "allowed: one of them"
                )
            given[name] = 0.0
    for name in log_map.constants:
        if name in log_map.channels:
            raise TwinError(f"{path}: constants.{name} is also in channels; allowed: one of them")
    if log_map.follow_speed:
        if "vx" not in log_map.channels:
            raise TwinError(f"{path}: follow_speed needs channels.vx; allowed: map it")
        for name in TORQUES:
            if name in given:
                raise TwinError(f"{path}: {name} is given; allowed with follow_speed: no torque")
    for name in log_map.input_names:
        if name not in given:
            hint = " or follow_speed = true" if name in TORQUES else ""
            raise TwinError(
                f"{path}: input {name} is missing; allowed: [channels.{name}], a value under "
                f"[constants]{hint}"
            )
