"""Forty wrong maps of one good log: what is found, and whether the estimate is called trustworthy.

Run as `python -m tests.wrong_maps`; `test_wrong_maps.py` does it under `make test-slow`.
"""

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import record
from scenarios.logs.estimators import til
from scenarios.logs.findings import findings
from scenarios.logs.pieces import prepared
from twin import OUTPUTS, WHEELS, Drive, TwinError, Vehicle, with_noise

SECONDS = 90.0
LOAD = 355.0  # [kg] in suv_loaded
STRIDE = 10  # of 1 kHz
CHANNELS = (
    "steering_wheel_angle",
    *OUTPUTS,
    *(f"{kind}_torque_{wheel}" for kind in ("drive", "brake") for wheel in WHEELS),
)
_ALL = ("steering_wheel_angle", *CHANNELS[11:])


class Outcome(NamedTuple):
    """What became of one map."""

    name: str
    found: tuple[str, ...]
    mass: float
    sd: float
    trustworthy: bool

    @property
    def off(self) -> bool:
        """Whether the mass is off by more than its 95 % interval."""
        return not abs(self.mass - LOAD) <= 1.96 * self.sd


def the_map(**changes):
    """The right map, but for fields of channels: channel=dict(...)."""
    lines = ["[time]", 'name = "t"', "[constants]", "road_height = 0.0", ""]
    for channel in CHANNELS:
        fields = {"name": channel, "unit": unit_of(channel), **changes.get(channel, {})}
        lines.append(f"[channels.{channel}]")
        lines += [f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v}" for k, v in fields.items()]
    return "\n".join(lines)


def unit_of(channel):
    if "torque" in channel:
        return "N m"
    if channel in ("ax", "ay", "az"):
        return "m/s2"
    return "rad" if "angle" in channel else "rad/s"


def each(names, **fields):
    return {name: fields for name in names}


def swap(*pairs):
    changes = {}
    for a, b in pairs:
        changes |= {a: {"name": b}, b: {"name": a}}
    return changes


WHEEL = tuple(f"wheel_speed_{w}" for w in WHEELS)
DRIVE = tuple(f"drive_torque_{w}" for w in WHEELS)
BRAKE = tuple(f"brake_torque_{w}" for w in WHEELS)
WRONG = {
    "ax in g called m/s2": each(["ax"], factor=1 / 9.80665),
    "ay in g called m/s2": each(["ay"], factor=1 / 9.80665),
    "ax in m/s2 called g": each(["ax"], unit="g"),
    "yaw rate in deg/s called rad/s": each(["yaw_rate"], factor=57.29578),
    "yaw rate in rad/s called deg/s": each(["yaw_rate"], unit="deg/s"),
    "all rates in deg/s": each(["roll_rate", "pitch_rate", "yaw_rate"], factor=57.29578),
    "steering in deg called rad": each(["steering_wheel_angle"], factor=57.29578),
    "steering at the road wheel": each(["steering_wheel_angle"], factor=1 / 16),
    "wheel speeds in km/h called rad/s": each(WHEEL, factor=0.361 * 3.6),
    "wheel speeds in m/s called rad/s": each(WHEEL, factor=0.361),
    "wheel speeds in rpm called rad/s": each(WHEEL, factor=9.5493),
    "torques in kN m called N m": each((*DRIVE, *BRAKE), factor=1e-3),
    "torques times 2.5": each((*DRIVE, *BRAKE), factor=2.5),
    "torques of one wheel for all": each((*DRIVE, *BRAKE), factor=0.5),
    "brakes times 3": each(BRAKE, factor=3.0),
    "brakes in bar, 1/20": each(BRAKE, factor=0.05),
    "drive torques at the engine, 1/4": each(DRIVE, factor=0.25),
    "sign of ax": each(["ax"], sign=-1),
    "sign of ay": each(["ay"], sign=-1),
    "sign of az": each(["az"], sign=-1),
    "sign of the yaw rate": each(["yaw_rate"], sign=-1),
    "sign of the pitch rate": each(["pitch_rate"], sign=-1),
    "sign of the roll rate": each(["roll_rate"], sign=-1),
    "sign of the steering": each(["steering_wheel_angle"], sign=-1),
    "sign of the drive torques": each(DRIVE, sign=-1),
    "sign of ay, yaw rate and steering": each(["ay", "yaw_rate", "steering_wheel_angle"], sign=-1),
    "left and right wheels swapped": swap(WHEEL[:2], WHEEL[2:]),
    "left and right front wheels swapped": swap(WHEEL[:2]),
    "front and rear wheels swapped": swap((WHEEL[0], WHEEL[2]), (WHEEL[1], WHEEL[3])),
    "front and rear brakes swapped": swap((BRAKE[0], BRAKE[2]), (BRAKE[1], BRAKE[3])),
    "ax and ay swapped": swap(("ax", "ay")),
    "IMU turned by 90 degrees": {
        "ax": {"name": "ay"},
        "ay": {"name": "ax", "sign": -1},
        "roll_rate": {"name": "pitch_rate"},
        "pitch_rate": {"name": "roll_rate", "sign": -1},
    },
    "roll and pitch rate swapped": swap(("roll_rate", "pitch_rate")),
    "ax and az swapped": swap(("ax", "az")),
    "ax late by 0.4 s": each(["ax"], delay=-0.4),
    "ax late by 0.2 s": each(["ax"], delay=-0.2),
    "yaw rate late by 0.2 s": each(["yaw_rate"], delay=-0.2),
    "wheel speeds late by 0.3 s": each(WHEEL, delay=-0.3),
    "torques late by 0.3 s": each((*DRIVE, *BRAKE), delay=-0.3),
    "all inputs late by 0.3 s": each(_ALL, delay=-0.3),
    "clock of the inputs 0.2 % slow": each(_ALL, clock=1.002),
    "clock of the inputs 1 % slow": each(_ALL, clock=1.01),
    "ax off by 1 m/s2": each(["ax"], offset=1.0),
    "yaw rate off by 3 deg/s": each(["yaw_rate"], offset=0.0524),
    "steering off by 15 deg": each(["steering_wheel_angle"], offset=0.262),
    "torques off by 200 N m": each(DRIVE, offset=-200.0),
    "az without gravity": each(["az"], offset=9.81),
}


def town():
    """Urban driving with bends of three to six seconds."""
    manoeuvre = urban(duration=SECONDS)
    time = np.arange(manoeuvre.speed.size) * manoeuvre.dt
    for start, seconds, angle in zip(
        range(5, 85, 7),
        (4, 3, 6, 5, 4, 3, 6, 5, 4, 3, 4, 5),
        (1.2, -0.8, 0.5, -1.5, 0.9, 1.1) * 2,
        strict=True,
    ):
        share = np.clip((time - start) / seconds, 0.0, 1.0)
        manoeuvre.steering[:] += angle * np.sin(np.pi * share) ** 2
    return manoeuvre


def good_log(folder: Path) -> Path:
    """A loaded SUV in town with the noise of a common IMU, at 100 Hz."""
    drive = record(Vehicle.load("suv_loaded"), town())
    drive = with_noise(drive, 10.0, np.random.default_rng(0))
    columns = {"t": drive.time[::STRIDE]}
    columns |= {name: drive.channel(name)[::STRIDE] for name in CHANNELS}
    pq.write_table(pa.table(columns), folder / "log.parquet")
    return folder / "log.parquet"


def outcome(name: str, log: Path, text: str) -> Outcome:
    """What the checks and the estimator say of the log under a map."""
    path = log.with_name("map.toml")
    path.write_text(text)
    vehicle = Vehicle.load("suv")
    drive = Drive.load(log, path)
    found = findings(drive, vehicle)
    words = tuple(f"{finding.words} -> {finding.mend}" for finding in found)
    try:
        made = til(vehicle, prepared(drive, 1e-3))
    except TwinError as error:
        return Outcome(name, (*words, f"refused: {error}"), np.nan, np.nan, False)
    mass, sd = float(made.estimate["mass"][-1]), made.sd["mass"]
    trusted = made.estimate.trustworthy
    faults = [finding for finding in found if finding.severity == "fault"]
    trustworthy = trusted is not None and bool(trusted[-1]) and not faults
    return Outcome(name, words, mass, sd, trustworthy)


def outcomes(names=None):
    """All maps, the right one first."""
    with TemporaryDirectory() as folder:
        log = good_log(Path(folder))
        yield outcome("the right map", log, the_map())
        for name, changes in WRONG.items():
            if names is None or re.search(names, name):
                yield outcome(name, log, the_map(**changes))


def as_row(one: Outcome) -> str:
    """A row of the table."""
    found = " | ".join(one.found) or "-"
    interval = f"{one.mass:.0f} +- {1.96 * one.sd:.0f} kg"
    trust = "trustworthy" if one.trustworthy else "not trustworthy"
    return f"{one.name:38} {interval:20} {'off' if one.off else 'in':4} {trust:16} {found}"


if __name__ == "__main__":
    import sys

    for one in outcomes(sys.argv[1] if len(sys.argv) > 1 else None):
        print(as_row(one), flush=True)
