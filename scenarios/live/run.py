"""`til live`: receives, aligns, observes, and sends, until it is stopped."""

import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

import models
from scenarios.live.align import LATENESS, Aligner
from scenarios.live.bus import Bus
from scenarios.live.estimator import LiveEstimator, line
from scenarios.live.health import Health
from scenarios.live.messages import EstimateMessages
from scenarios.live.signals import BusSignals
from twin import TwinError, Vehicle
from twin.logs.can_signals import Database
from twin.logs.map import LogMap

_SILENT = 1.0  # [s] without a frame
_SAVED = 10.0  # [s] between two state files
_HEALTH = 1.0  # [s]
_WAIT = 0.05  # [s] for a frame, at most
_UNSEEN = 5.0  # [s] after which a message that never came is named
_AT_ONCE = 200  # frames before estimates are made, at most


@dataclass(frozen=True, slots=True, kw_only=True)
class Live:
    """What `til live` is asked for.

    Attributes:
        interface, channel, options: of python-can.
        vehicle: name or file of the car.
        map: file; its names are those of signals of the bus.
        database: of the bus; None: the one that the map names.
        rate: of estimates [Hz].
        lateness: that a sample waits for late signals [s].
        speed: how much faster than the clock the bus' time runs.
        send: whether estimates go out as CAN messages.
        state: file that is resumed and left.
        duration, idle: [s] after which it ends, by the clock, and without frames.
        view: whether the Rerun viewer shows it.
    """

    interface: str
    channel: str
    options: dict[str, Any] = field(default_factory=dict)
    vehicle: str
    map: Path
    database: Path | None = None
    rate: float = 100.0
    lateness: float = LATENESS
    speed: float = 1.0
    send: bool = False
    state: Path | None = None
    duration: float | None = None
    idle: float | None = None
    view: bool = False


def run(live: Live, write: Callable[[str], object], say: Callable[[str], object]) -> None:
    """Observes a bus until SIGINT, SIGTERM or the end that is asked for.

    Args:
        live: what is asked for.
        write: takes estimates and health as lines of JSON.
        say: takes sentences for people.

    Raises:
        TwinError: a file is broken, the map does not fit the database, or the bus cannot be opened.
    """
    session = _Session(live, write, say)
    stopped: list[int] = []

    def stop(number: int, _: FrameType | None) -> None:
        stopped.append(number)

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        while not stopped and not session.over():
            session.turn()
    finally:
        session.close()
        for number, handler in before.items():
            signal.signal(number, handler)


class _Session:
    """A run of `til live`."""

    def __init__(
        self, live: Live, write: Callable[[str], object], say: Callable[[str], object]
    ) -> None:
        self._live, self._write, self._say = live, write, say
        log_map = LogMap.load(models.path(str(live.map)))
        path = live.database or log_map.database
        if path is None:
            raise TwinError(f"{log_map.path}: names no database; allowed: [can] in it, or --dbc")
        database = Database.load(models.path(str(path)))
        vehicle = Vehicle.load(live.vehicle)
        self._signals = BusSignals(log_map, database, vehicle)
        self._signals.check()
        self._messages = EstimateMessages(tuple(database.messages)) if live.send else None
        self._aligner = Aligner(self._signals.names, 1.0 / live.rate, live.lateness)
        self._estimator = LiveEstimator(vehicle, self._signals)
        for sentence in (*database.notes, *self._estimator.notes):
            say(sentence)
        if live.state:
            say(self._estimator.resume(live.state))
        self._view = _viewer() if live.view else None
        self._health = Health()
        self._bus = Bus(live.interface, live.channel, live.options, say, self._signals.identifiers)
        say(f"listens to {live.interface} {live.channel} for {len(self._signals.names)} signals")
        now = time.monotonic()
        self._begun = self._told = self._saved = self._heard = now
        self._zero: tuple[float, float] | None = None  # the bus' time at the first frame
        self._silent = self._named = False
        self._estimates = 0
        self._margin = 0.0
        self._dropped = 0

    def over(self) -> bool:
        """Whether the end that is asked for has come."""
        now, live = time.monotonic(), self._live
        heard = self._zero is not None
        return (live.duration is not None and now - self._begun > live.duration) or (
            live.idle is not None and heard and now - self._heard > live.idle
        )

    def turn(self) -> None:
        """Takes the frames that are there, makes estimates, and looks after the rest."""
        start = time.perf_counter()
        frame = self._bus.receive(0.0)
        if frame is None:
            waited = time.perf_counter()
            frame = self._bus.receive(_WAIT)
            start += time.perf_counter() - waited
        count = 0
        received = time.perf_counter()
        while frame is not None:
            self._signals.take(frame, self._time(float(frame.timestamp)), self._aligner)
            received = time.perf_counter()
            count += 1
            if count >= _AT_ONCE:
                break
            frame = self._bus.receive(0.0)
        for at, values, age in self._aligner.samples():
            u, y, speed = self._signals.sample(values)
            found = self._estimator.update(at, u, y, speed, age)
            if found is not None:
                self._send(found)
                self._health.estimated(time.perf_counter() - received, 1.0 / self._live.rate)
        if count:
            self._heard = time.monotonic()
        self._health.busy += time.perf_counter() - start
        self._look_after()

    def _time(self, stamp: float) -> float:
        """The time of a frame in the time of the car, which may run faster than the clock."""
        if self._zero is None:
            self._zero = stamp, stamp
        return self._zero[1] + self._live.speed * (stamp - self._zero[0])

    def _send(self, found: dict[str, Any]) -> None:
        self._estimates += 1
        found["margin"] = self._margin
        if self._messages is not None:
            for identifier, data in self._messages.encoded(found):
                self._bus.send(identifier, data)
        self._write(line(found))
        if self._view is not None:
            self._view(found)

    def _look_after(self) -> None:
        """Health, silence and the state file."""
        now = time.monotonic()
        if now - self._heard > _SILENT and not self._silent:
            self._silent = True
            self._say("the bus is silent")
        elif self._silent and now - self._heard < _SILENT:
            self._silent = False
            self._say("the bus speaks again")
        if now - self._begun > _UNSEEN and not self._named and not self._silent:
            self._named = True
            if self._signals.silent:
                self._say(f"nobody sends {', '.join(self._signals.silent)}")
        if now - self._told >= _HEALTH:
            self._told = now
            self._report(now)
        if self._live.state and now - self._saved >= _SAVED:
            self._saved = now
            self._save()

    def _counts(self) -> dict[str, int]:
        aligner, stream = self._aligner, self._estimator.stream
        return {
            **self._signals.counts,
            "estimates": self._estimates,
            "late": aligner.late,
            "out_of_order": aligner.out_of_order,
            "skipped": aligner.skipped,
            "jumps_of_time": aligner.jumps,
            "restarts": stream.counts["restarts"],
            "held": stream.counts["held"],
            "incomplete": stream.counts["incomplete"],
            "lost": self._estimator.lost,
            "bus_faults": self._bus.faults,
            "unsent": self._bus.unsent,
        }

    def _report(self, now: float) -> None:
        found = self._health.report(now, self._counts())
        self._margin = float(found["margin"] or 0.0)
        self._write(line({"health": found}))
        told = ", ".join(f"{name} {value}" for name, value in found.items() if value is not None)
        self._say(f"health: {told}")
        if self._silent and self._messages is not None:
            for identifier, data in self._messages.encoded({}):  # nothing is valid
                self._bus.send(identifier, data)

    def _save(self) -> None:
        if self._live.state is None:
            return
        try:
            self._estimator.save(self._live.state)
        except TwinError as error:  # a full disk stops no observer
            self._say(str(error))

    def close(self) -> None:
        """Leaves the state file, says what was, and lets the bus go."""
        self._save()
        counts = {name: n for name, n in self._counts().items() if n}
        median, worst = self._health.total()
        with suppress(BrokenPipeError):
            self._write(line({"total": counts, "latency_p50_ms": median, "latency_p99_ms": worst}))
        self._say("in all: " + ", ".join(f"{n} {name}" for name, n in counts.items()))
        self._bus.close()


def _viewer() -> Callable[[dict[str, Any]], None]:
    """Shows estimates in the Rerun viewer."""
    import rerun as rr  # slow to import

    rr.init("til live", spawn=True)

    def show(found: dict[str, Any]) -> None:
        rr.set_time("time", duration=float(found["time"]))
        for name, value in found.items():
            if isinstance(value, int | float) and name != "time":
                rr.log(name, rr.Scalars(float(value)))

    return show


def to_stdout(text: str) -> None:
    """A line of JSON to standard output."""
    print(text, flush=True)


def to_stderr(text: str) -> None:
    """A sentence to standard error."""
    print(f"til: {text}", file=sys.stderr, flush=True)
