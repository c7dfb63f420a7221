"""What broken sensors and inputs do to the answer of `til estimate`: `til reproduce faults`.

A drive of the loaded SUV that the empty one's twin observes, and laps of the sports car, which
observes itself (the same model on both sides: labelled so), as logs of several rates. Each fault is
put into each channel or group; what is then off by more than its 95 % interval (mass) or by a
degree (sideslip) and still called trustworthy is counted, and named.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.driving import joint_drives
from scenarios.driving.drivers import driver_of, limits_of
from scenarios.driving.manoeuvres import laps
from scenarios.driving.record import record
from scenarios.experiment.progress import parallel
from scenarios.experiment.reproduction import Clock, Making
from scenarios.experiment.result import Result, Row
from scenarios.logs.answer import sideslip
from scenarios.logs.estimate import estimate_of
from scenarios.plants.faults import CHANNELS, FAULTS, with_fault
from scenarios.report.pictures import canvas
from twin import Drive, TwinError, Vehicle, with_noise

DURATION = 60.0  # [s]
SNR = 20.0  # [dB]
RATES = (100, 1000)  # [Hz] of the logs with faults
SOUND_RATES = (50, 100, 1000)  # of those without
_NORMAL_95 = 1.96  # standard deviations
_MOST_SIDESLIP = 1.0  # [deg] rms
_SLOW = 3.0  # [m/s] below which sideslip is not scored
_NO_FAULT = "none"
SHADES = ("refused", "not trustworthy", "trustworthy and right", "trustworthy and off")


class Car(NamedTuple):
    """Who drives, and which twin observes.

    Attributes:
        real, twin: cars.
        label: in the table.
        weighed: whether the drive tells the mass, so that it is scored.
    """

    real: str
    twin: str
    label: str
    weighed: bool


CARS = (
    Car("suv_loaded", "suv", "suv, mixed", weighed=True),
    Car("sports_car", "sports_car", "sports car, laps (same model)", weighed=False),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One log with one fault.

    Attributes:
        car: that drives.
        rate: of the log [Hz].
        channel: of `CHANNELS`.
        fault: of `FAULTS`, or "none".
        seed: of the noise.
        duration: [s].
    """

    car: Car
    rate: int
    channel: str
    fault: str
    seed: int
    duration: float


class Outcome(NamedTuple):
    """What came of a run.

    Attributes:
        trusted: share of the time called trustworthy; NaN if the log was refused.
        off: what is off while it is trusted: "mass", "sideslip", both or nothing.
        mass_error, mass_sd: [kg] at the end; NaN where it is not scored.
        sideslip: rms of its error while trusted [deg].
    """

    trusted: float
    off: str
    mass_error: float
    mass_sd: float
    sideslip: float

    @property
    def shade(self) -> int:
        """Its place in `SHADES`."""
        if np.isnan(self.trusted):
            return 0
        return 3 if self.off else (2 if self.trusted > 0.0 else 1)


_REFUSED = Outcome(np.nan, "", np.nan, np.nan, np.nan)


def faults(making: Making) -> Result:
    """Share of the faults that end off and trusted, and each of them by name; sound logs first."""
    clock = Clock.started()
    duration = DURATION if making.duration is None else making.duration
    seed = making.seeds[0]

    def run(car: Car, rate: int, channel: str, fault: str) -> Run:
        return Run(
            car=car, rate=rate, channel=channel, fault=fault, seed=seed, duration=duration
        )  # fmt: skip

    found: list[Row] = []
    for car in CARS:
        sound = [run(car, rate, "", _NO_FAULT) for rate in SOUND_RATES]
        for one, outcome in zip(sound, _outcomes(sound, making.jobs), strict=True):
            found += _rows_of_sound(one, outcome)
    grids = {}
    for car in CARS:
        for rate in RATES:
            todo = [run(car, rate, c, f) for c in CHANNELS for f in FAULTS]
            outcomes = _outcomes(todo, making.jobs)
            found += _rows_of_faults(f"{car.label}, {rate} Hz", todo, outcomes)
            shades = [outcome.shade for outcome in outcomes]
            grids[f"{car.label}, {rate} Hz"] = np.reshape(shades, (len(CHANNELS), len(FAULTS)))
    _draw(making.out / "faults.png", grids)
    return clock.result("faults", making, found, knows="nothing but the log", snr=SNR)


def _outcomes(todo: Sequence[Run], jobs: int) -> list[Outcome]:
    return parallel(outcome_of, todo, jobs, f"faults: {todo[0].car.label}, {todo[0].rate} Hz")


def outcome_of(run: Run) -> Outcome:
    """Estimates a log with a fault, as `til estimate` would."""
    sound, truth = _log(run.car, run.rate, run.seed, run.duration)
    broken = sound
    if run.fault != _NO_FAULT:
        rng = np.random.default_rng([run.seed, 1])
        broken = with_fault(sound, CHANNELS[run.channel], FAULTS[run.fault], rng)
    try:
        found, _ = estimate_of(broken, Vehicle.load(run.car.twin))
    except TwinError:
        return _REFUSED
    estimate = found.estimate
    trusted = np.asarray(estimate.trustworthy)
    off = []
    error = sd = np.nan
    if run.car.weighed and "mass" in found.parameters:
        error = float(estimate.absolute("mass")[-1] - truth.truth["mass"][-1])
        sd = found.sd["mass"]
        if bool(trusted[-1]) and abs(error) > _NORMAL_95 * sd:
            off.append("mass")
    slip, speed = (np.interp(estimate.time, truth.time, truth.truth[n]) for n in ("sideslip", "vx"))
    scored = trusted & (speed > _SLOW)
    wrong = np.degrees(sideslip(found) - slip)[scored]
    rms = float(np.sqrt(np.mean(wrong**2))) if wrong.size else 0.0
    if rms > _MOST_SIDESLIP:
        off.append("sideslip")
    return Outcome(float(trusted.mean()), " and ".join(off), error, sd, rms)


@cache
def _log(car: Car, rate: int, seed: int, duration: float) -> tuple[Drive, Drive]:
    """A noisy log without its truth, and with it."""
    vehicle = Vehicle.load(car.real)
    if car.weighed:
        clean = record(vehicle, joint_drives.mixed(duration=duration))
    else:
        drive = laps(duration=duration, limits=limits_of(vehicle))
        clean = record(vehicle, drive, driver_of(vehicle))
    noisy = with_noise(clean, SNR, np.random.default_rng(seed))
    thinned = noisy[:: round(1.0 / (rate * noisy.dt))]
    return thinned.replace(truth={}), thinned


def _row(case: str, quantity: str, metric: str, unit: str, value: float) -> Row:
    return Row.over_seeds(
        [value], case=case, quantity=quantity, metric=metric, unit=unit, estimator="til"
    )


def _rows_of_sound(run: Run, outcome: Outcome) -> list[Row]:
    case = f"{run.car.label}, {run.rate} Hz, sound"
    rows = [
        _row(case, "all", "trusted", "1", outcome.trusted),
        _row(case, "sideslip", "rmse", "deg", outcome.sideslip),
    ]
    if run.car.weighed:
        rows += [
            _row(case, "mass", "error", "kg", outcome.mass_error),
            _row(case, "mass", "claimed_sd", "kg", outcome.mass_sd),
        ]
    return rows


def _rows_of_faults(case: str, todo: Sequence[Run], outcomes: Sequence[Outcome]) -> list[Row]:
    """Shares over all faults, then every run that is off and trusted."""
    shades = np.array([outcome.shade for outcome in outcomes])
    rows = [
        _row(case, "all", metric, "1", float(np.mean(shades == shade)))
        for shade, metric in enumerate(("refused", "found", "right", "trusted_and_off"))
    ]
    for run, outcome in zip(todo, outcomes, strict=True):
        named = f"{case}: {run.channel}, {run.fault}"
        if "mass" in outcome.off:
            rows.append(_row(named, "mass", "error", "kg", outcome.mass_error))
        if "sideslip" in outcome.off:
            rows.append(_row(named, "sideslip", "rmse", "deg", outcome.sideslip))
    return rows


def _draw(path: Path, grids: dict[str, NDArray[np.int_]]) -> None:
    """A field per fault and channel, for every car and rate."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    colours = ("0.75", "#4c78a8", "#72b57a", "#d62728")
    with canvas(path, title="One fault in one channel", size=(18.0, 12.0)) as sheet:
        axes = sheet.subplots(2, 2, sharex=True, sharey=True)
        for one, (name, grid) in zip(axes.flat, grids.items(), strict=True):
            one.imshow(grid, cmap=ListedColormap(colours), vmin=-0.5, vmax=3.5, aspect="auto")
            one.set_title(name)
            one.set_yticks(range(len(CHANNELS)), list(CHANNELS))
            one.set_xticks(range(len(FAULTS)), list(FAULTS), rotation=90)
        handles = [Patch(color=c, label=s) for c, s in zip(colours, SHADES, strict=True)]
        sheet.legend(handles=handles, loc="outside lower center", ncols=4)
