"""The observer of logs, fed by a bus: estimates as one flat record, a state file, and no crash."""

import json
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from estimators.til.default_observer import default_observer
from estimators.til.stream import Stream
from scenarios.live.signals import BusSignals
from scenarios.logs.stream import told
from twin import PARAMETERS, WHEELS, TwinError, Vehicle

PARKED = 60.0  # [s] after which people may have got in or out; chosen
PARKED_SD = 75.0  # [kg]: one person; chosen
_WARM_UP = 50  # samples, so that all compiled code is loaded
_MASS_SD = 0.15  # of the mass; with more it counts as not known yet, as it is beforehand (0.2)


class LiveEstimator:
    """Observes samples of a bus.

    Attributes:
        stream: that brings samples to the twin's steps.
        notes: what cannot be estimated, in sentences.
        lost: samples that were not observed, as the twin has blown up.
    """

    def __init__(self, vehicle: Vehicle, signals: BusSignals) -> None:
        """Args: signals: whose map says what is measured.

        Raises:
            TwinError: the car's files are broken.
        """
        self._vehicle = vehicle
        default = default_observer(vehicle, signals.measured, mass="ax" in signals.measured)
        self._default = default
        self.stream = Stream(default.observer, default.rolling_radius)
        self.lost = 0
        missing = () if "ax" in signals.measured else ("mass cannot be estimated without ax.",)
        self.notes = (*default.left_out, *missing)
        self._learnt = math.nan  # time of the last trustworthy sample
        twin = default.observer.twin
        self._nominal = float(default.observer.twin.car.nominal[0])  # pyright: ignore[reportAttributeAccessIssue]
        self._total = self._nominal + float(np.sum(twin.car.other_mass[0]))  # pyright: ignore[reportAttributeAccessIssue]
        self._warm_up(signals)

    def _warm_up(self, signals: BusSignals) -> None:
        """Loads all compiled code before the first frame is waited for."""
        u, y, _ = signals.sample({name: 0.0 for name in signals.names})
        for k in range(_WARM_UP):
            self.stream.update(0.01 * k, np.nan_to_num(u), np.full(len(y), np.nan), speed=1.0)
        self.stream = Stream(self._default.observer, self._default.rolling_radius)

    def resume(self, path: Path) -> str:
        """Goes on with what a state file knows; returns a sentence.

        Raises:
            TwinError: the file is broken, or of another vehicle or observer.
        """
        if not path.exists():
            return f"{path} is not there yet: nothing is known of the load"
        age = max(time.time() - path.stat().st_mtime, 0.0)
        self.stream.restore(path)
        parked = {"mass": PARKED_SD} if age > PARKED else {}
        self._default.observer.forget(age, parked)
        sd = self._default.observer.parameter_sd().get("mass", math.nan)
        return f"goes on with {path}, {age:.0f} s old: the mass is known to {sd:.0f} kg"

    def save(self, path: Path) -> None:
        """Writes the state file, unless nothing has been observed yet.

        Raises:
            TwinError: the file cannot be written.
        """
        if self.stream.counts["taken"] and np.isfinite(self._default.observer.memory.p).all():
            self.stream.save(path)

    def update(
        self, at: float, u: Sequence[float], y: Sequence[float], speed: float, age: float
    ) -> dict[str, Any] | None:
        """Takes a sample; returns the estimate as names and finite values.

        Args:
            at: time [s].
            u: (nu,) inputs, NaN where there is none.
            y: (ny,) measurements.
            speed: measured [m/s], or NaN.
            age: of the oldest signal [s].
        """
        try:
            sample = self.stream.update(at, u, y, speed=speed)
        except TwinError:  # the twin has blown up: it starts again at the measured speed
            sound = np.isfinite(self._default.observer.memory.p).all()
            self.stream.start_again(fresh=not sound)
            self.lost += 1
            return None
        if sample is None:
            return None
        found = dict(told(sample, self.stream, self._default))
        if sample.trustworthy:
            self._learnt = at
        delta = float(sample.parameters[PARAMETERS.index("mass")])
        sd = found.get("mass_sd")
        known = isinstance(sd, float) and sd < _MASS_SD * self._total
        trustworthy = bool(found["trustworthy"])
        tyres = self._default.observer.twin.car.tyre_output  # pyright: ignore[reportAttributeAccessIssue]
        found |= {
            "mass": self._total + delta,
            "load": delta,
            "mass_valid": trustworthy and known,
            "sideslip_valid": trustworthy,
            "forces_valid": trustworthy,
            "age_of_inputs": age,
            "age_of_mass": at - self._learnt,
        }
        for wheel, row in zip(WHEELS, tyres, strict=True):
            found |= {f"{name}_{wheel}": float(row[k]) for k, name in enumerate(("fx", "fy", "fz"))}
        return finite(found)


def finite(values: dict[str, Any]) -> dict[str, Any]:
    """What JSON can hold, and an estimate may say: None in place of what is no number.

    What is not finite is not valid either.
    """
    found = {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in values.items()
    }
    for valid, names in (("mass_valid", ("mass", "load")), ("sideslip_valid", ("sideslip",))):
        if any(found.get(name) is None for name in names):
            found[valid] = False
    if any(found.get(f"{force}_{w}") is None for force in ("fx", "fy", "fz") for w in WHEELS):
        found["forces_valid"] = False
    return found


def line(values: dict[str, Any]) -> str:
    """A record as a line of JSON, without digits that mean nothing."""
    rounded = {k: round(v, 6) if isinstance(v, float) else v for k, v in values.items()}
    return json.dumps(rounded, allow_nan=False)
