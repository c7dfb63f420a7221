"""Frames of a car's bus become channels of ours, by the map and its database."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from scenarios.live.align import Aligner
from scenarios.logs.pieces import ROAD
from twin import CHANNEL, INPUTS, OUTPUTS, TwinError, Vehicle
from twin.car.signals import signals_of
from twin.logs.can_frame import FrameDecoder
from twin.logs.can_signals import Database
from twin.logs.car_signals import GIVES, CarSignals, derive
from twin.logs.map import LogMap, unit_in_si
from twin.logs.units import kind_of

EXTENDED = 1 << 31  # of an identifier that has 29 bits
_LARGEST = 1e6  # of a signal that is none of ours


class BusSignals:
    """What a map makes of the frames of a bus.

    Attributes:
        database: of the bus.
        names: of the channels that the map takes from it.
        measured: names of our outputs that the bus tells, directly or by signals of cars.
        counts: frames that were used, not in the map, too short, without data, and values that no
            car has.
    """

    def __init__(self, log_map: LogMap, database: Database, vehicle: Vehicle) -> None:
        """Args: vehicle: whose file says what signals of cars mean.

        Raises:
            TwinError: a signal is not in the database, or the map needs what a bus cannot give.
        """
        if log_map.follow_speed:
            raise TwinError(f"{log_map.path}: follow_speed is true; allowed on a bus: torques")
        if "course" in log_map.channels:
            raise TwinError(f"{log_map.path}: channels.course; allowed on a bus: a yaw rate")
        self.database, self._map = database, log_map
        self.names = tuple(log_map.channels)
        self.counts = dict.fromkeys(("used", "unknown", "short", "no_data", "implausible"), 0)
        self.seen: set[str] = set()  # messages
        self._car = signals_of(vehicle)
        if log_map.car is not None:
            self._car = CarSignals.of(log_map.car, self._car)
        self._derives = bool(set(self.names) & set(GIVES)) or log_map.free_of_gravity
        given = {*self.names, *(g for name in self.names for g in GIVES.get(name, ()))}
        self.measured = {name for name in OUTPUTS if name in given}
        self._decoders: dict[int, FrameDecoder] = {}
        self._uses: dict[str, list[tuple[str, str, float, float, float]]] = {}
        for name in self.names:
            self._use(name)

    def _use(self, name: str) -> None:
        """Finds the signal of a channel of ours."""
        source, path = self._map.channels[name], self._map.path
        message_name, _, signal = source.name.partition(".")
        message = next((m for m in self.database.messages.values() if m.name == message_name), None)
        if message is None or signal not in [s.name for s in message.signals]:
            raise TwinError(
                f"{path}: channels.{name}.name is {source.name[:80]!r}, which is not in "
                f"{self.database.path}; allowed: a Message.signal of it"
            )
        if source.clock != 1.0:
            raise TwinError(f"{path}: channels.{name}.clock; allowed on a bus: 1")
        unit = source.unit or self.database.units[message_name, signal]
        unit = "1" if kind_of(name) == "number" else unit
        if not unit:
            raise TwinError(f"{path}: channels.{name}.unit is missing; allowed: name it")
        try:
            scale = source.sign * unit_in_si(name, unit, source.radius) * source.factor
        except TwinError as error:
            raise TwinError(f"{path}: channels.{name}.unit {error}") from None
        self._decoders.setdefault(message.identifier, FrameDecoder(message))
        use = (signal, name, scale, source.offset, source.delay)
        self._uses.setdefault(message_name, []).append(use)

    def check(self) -> None:
        """Checks that the car says what the map's signals need.

        Raises:
            TwinError: it does not.
        """
        columns = {name: np.zeros(1) for name in self.names}
        try:
            derive(columns, 1.0, self._car, self._map.free_of_gravity)
        except TwinError as error:
            raise TwinError(f"{self._map.path}: {error}") from None
        given = {*columns, *self._map.constants, *ROAD}
        for name in INPUTS:
            if name not in given:
                raise TwinError(f"{self._map.path}: input {name} is missing; allowed: map it")

    @property
    def identifiers(self) -> tuple[int, ...]:
        """Of the messages that are used; of 29 bits with `EXTENDED`."""
        return tuple(self._decoders)

    @property
    def silent(self) -> list[str]:
        """Messages that the map needs and nobody has sent."""
        return sorted(set(self._uses) - self.seen)

    def take(self, frame: Any, time: float, aligner: Aligner) -> None:
        """Decodes a frame of python-can into the aligner; what is wrong with it is counted."""
        if frame.is_error_frame or frame.is_remote_frame:
            self.counts["no_data"] += 1
            return
        decoder = self._decoders.get(
            frame.arbitration_id | (EXTENDED if frame.is_extended_id else 0)
        )
        if decoder is None:
            self.counts["unknown"] += 1
            return
        found, short = decoder.decode(bytes(frame.data))
        self.counts["short" if short else "used"] += 1
        self.seen.add(decoder.message.name)
        for signal, name, scale, offset, delay in self._uses[decoder.message.name]:
            if signal not in found:
                continue
            value = scale * (found[signal] - offset)
            record = CHANNEL.get(name)
            low, high = (record.low, record.high) if record else (-_LARGEST, _LARGEST)
            if low <= value <= high:
                aligner.add(name, time - delay, value)
            else:
                self.counts["implausible"] += 1

    def sample(self, values: Mapping[str, float]) -> tuple[list[float], list[float], float]:
        """Inputs (nu,), measurements (ny,) and the measured speed; NaN where there is none."""
        found = {**self._map.constants, **values}
        if self._derives:
            columns = {name: np.array([found.get(name, math.nan)]) for name in self.names}
            columns |= {name: np.array([value]) for name, value in found.items()}
            try:
                derive(columns, 1.0, self._car, self._map.free_of_gravity)
                found = {name: float(column[0]) for name, column in columns.items()}
            except TwinError:  # of a gear that the car does not have; `check` has tried the rest
                self.counts["implausible"] += 1
        u = [_sound(name, found, 0.0 if name in ROAD else math.nan) for name in INPUTS]
        y = [_sound(name, found, math.nan) for name in OUTPUTS]
        return u, y, found.get("vx", math.nan)


def _sound(name: str, found: Mapping[str, float], otherwise: float) -> float:
    """A value within its channel's range; NaN if what signals of cars give is beyond it."""
    value = found.get(name, otherwise)
    return value if CHANNEL[name].low <= value <= CHANNEL[name].high else math.nan
