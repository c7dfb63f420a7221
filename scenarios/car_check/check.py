"""Compares a car with usual cars: measured at rest, on its springs and driven."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scenarios.car_check.drives import (
    BRAKING,
    GRAVITY,
    Cornering,
    Pedals,
    StepSteer,
    cornering_of,
    drift_of,
    pedals_of,
    step_steer_of,
)
from scenarios.car_check.modes import Modes, modes_of
from twin import TYRE, Twin, Vehicle
from twin.car.guesses import guesses_of


class Range(NamedTuple):
    """The usual range of a figure of a car.

    Attributes:
        least, largest: in the check's unit.
        source: where the range comes from.
    """

    least: float
    largest: float
    source: str


_GILLESPIE = "Gillespie"
_INERTIA = "NHTSA's measured inertias"
_BOOKS = (
    "Gillespie: Fundamentals of Vehicle Dynamics, SAE 1992. NHTSA's measured inertias: Heydinger "
    "et al., SAE 1999-01-1336."
)
_CHOSEN = "chosen: from light sports cars to large SUVs"
RANGES: dict[str, tuple[str, Range]] = {
    "mass": ("kg", Range(500.0, 3500.0, _CHOSEN)),
    "wheelbase": ("m", Range(1.8, 3.6, _CHOSEN)),
    "track": ("m", Range(1.2, 1.8, _CHOSEN)),
    "weight on the front axle": ("%", Range(35.0, 65.0, _CHOSEN)),
    "left against right": ("%", Range(-4.0, 4.0, "chosen: a car with its driver alone has 2")),
    "static stability factor": (
        "1",
        Range(1.0, 2.0, "NHTSA's rollover rating: SUVs from 1.0, cars to 1.5; racing cars more"),
    ),
    "roll gyration over track": ("1", Range(0.30, 0.55, _INERTIA)),
    "yaw inertia over m a b": ("1", Range(0.7, 1.2, _INERTIA)),
    "tyre deflection": ("mm", Range(8.0, 45.0, "chosen: a tyre of 200 to 300 N/mm")),
    "ride frequency": ("Hz", Range(0.9, 3.0, f"{_GILLESPIE}, ch. 5: 1 to 1.5; racing cars more")),
    "ride damping": ("1", Range(0.15, 0.7, f"{_GILLESPIE}, ch. 5: 0.2 to 0.4; sports cars more")),
    "pitch frequency": ("Hz", Range(0.9, 3.0, f"{_GILLESPIE}, ch. 5: near the ride frequency")),
    "pitch damping": ("1", Range(0.15, 0.8, _CHOSEN)),
    "roll frequency": ("Hz", Range(1.0, 5.5, _CHOSEN)),
    "roll damping": ("1", Range(0.1, 0.7, _CHOSEN)),
    "wheel hop": ("Hz", Range(8.0, 20.0, f"{_GILLESPIE}, ch. 5: 10 to 15")),
    "steering ratio": (
        "1",
        Range(9.0, 25.0, "chosen: cars 12 to 20; 1 where a log has the road wheels' angle"),
    ),
    "drift from the straight": ("m", Range(-1.0, 1.0, "chosen: in 5 s at 80 km/h")),
    "understeer gradient": (
        "deg/g",
        Range(0.0, 6.0, f"{_GILLESPIE}, ch. 6: cars 1 to 5; below 0 a car oversteers"),
    ),
    "roll gradient": ("deg/g", Range(1.0, 8.0, f"{_GILLESPIE}, ch. 6: 3 to 7; sports cars less")),
    "largest lateral acceleration": ("g", Range(0.6, 1.6, "chosen: 0.7 to 1.0, racing tyres more")),
    "load left inside then": (
        "%",
        Range(2.0, 45.0, "chosen: at 0 the inside wheels lift, and the car rolls over"),
    ),
    "yaw rate's rise time": ("s", Range(0.05, 0.5, "chosen; the step of ISO 7401")),
    "yaw rate's overshoot": ("%", Range(-1.0, 50.0, "chosen; the step of ISO 7401")),
    "braking by 0.4 g": ("g", Range(0.9 * BRAKING, 1.2 * BRAKING, "the commanded value, and drag")),
    "0 to 100 km/h": ("s", Range(2.5, 20.0, "chosen; power is a field of the drivetrain")),
}


class Check(NamedTuple):
    """A figure of the car against its range.

    Attributes:
        name: of `RANGES`.
        value: in the range's unit.
    """

    name: str
    value: float

    @property
    def good(self) -> bool:
        """Whether the value is in the usual range."""
        least, largest, _ = RANGES[self.name][1]
        return bool(least <= self.value <= largest)


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """A car that was measured and driven.

    Attributes:
        vehicle: the car.
        checks: in the order of `RANGES`.
        cornering, step, pedals: what it did.
        guesses: number of fields that are guesses, and of all fields; (0, 0) for an MJCF file.
    """

    vehicle: Vehicle
    checks: tuple[Check, ...]
    cornering: Cornering
    step: StepSteer
    pedals: Pedals
    guesses: tuple[int, int]


def check_car(name: str) -> Checked:
    """Measures and drives a car.

    Args:
        name: of a car of the project, or a file.

    Raises:
        TwinError: the file is broken, or the car cannot stand or drive.
    """
    vehicle = Vehicle.load(name)
    twin = Twin(vehicle)
    modes = modes_of(twin)
    cornering = cornering_of(vehicle)
    step = step_steer_of(vehicle, cornering)
    pedals = pedals_of(twin)
    values = _at_rest(vehicle, twin) | _on_springs(modes)
    values["steering ratio"] = vehicle.figures.steering_ratio
    values["drift from the straight"] = drift_of(twin)
    values |= {
        "understeer gradient": np.degrees(cornering.understeer) * GRAVITY,
        "roll gradient": np.degrees(cornering.roll_gradient) * GRAVITY,
        "largest lateral acceleration": cornering.largest / GRAVITY,
        "load left inside then": 100.0 * cornering.inside,
        "yaw rate's rise time": step.rise,
        "yaw rate's overshoot": 100.0 * step.overshoot,
        "braking by 0.4 g": pedals.braking,
        "0 to 100 km/h": pedals.hundred,
    }
    guesses, total = guesses_of(vehicle)
    return Checked(
        vehicle=vehicle,
        checks=tuple(Check(name, float(values[name])) for name in RANGES),
        cornering=cornering,
        step=step,
        pedals=pedals,
        guesses=(len(guesses), total),
    )


def _at_rest(vehicle: Vehicle, twin: Twin) -> dict[str, float]:
    """Figures of the car as it stands."""
    car, body = vehicle.figures, vehicle.chassis()
    twin.reset(0.0)
    load = twin.tyre_forces()[:, TYRE.fz]
    track = float(np.mean(car.track))
    behind = car.axle_load[1] / sum(car.axle_load) * car.wheelbase
    deflection = load / vehicle.tyres()["vertical_stiffness"]
    roll, yaw = body.inertia[0, 0], body.inertia[2, 2]
    return {
        "mass": car.mass,
        "wheelbase": car.wheelbase,
        "track": track,
        "weight on the front axle": 100.0 * float(load[:2].sum() / load.sum()),
        "left against right": 100.0 * float(1.0 - 2.0 * load[1::2].sum() / load.sum()),
        "static stability factor": 0.5 * track / car.cm_height,
        "roll gyration over track": float(np.sqrt(roll / body.mass)) / track,
        "yaw inertia over m a b": float(yaw / (body.mass * behind * (car.wheelbase - behind))),
        "tyre deflection": 1000.0 * float(deflection.mean()),
    }


def _on_springs(modes: Modes) -> dict[str, float]:
    """Figures of the body's and the wheels' motion."""
    return {
        "ride frequency": modes.ride.frequency,
        "ride damping": modes.ride.damping,
        "pitch frequency": modes.pitch.frequency,
        "pitch damping": modes.pitch.damping,
        "roll frequency": modes.roll.frequency,
        "roll damping": modes.roll.damping,
        "wheel hop": modes.hop.frequency,
    }


def as_text(checked: Checked) -> str:
    """A line per check: value, range, verdict and the range's source."""
    rows = [("", "value", "", "usual range", "", "source of the range")]
    for check in checked.checks:
        unit, (least, largest, source) = RANGES[check.name]
        unit = "" if unit == "1" else unit
        verdict = "ok" if check.good else "LOOK"
        rows.append(
            (check.name, _shown(check.value), unit, f"{least:g} to {largest:g}", verdict, source)
        )
    widths = [max(len(row[i]) for row in rows) for i in range(5)]
    lines = [
        f"{row[0]:{widths[0]}}  {row[1]:>{widths[1]}} {row[2]:{widths[2]}}  {row[3]:{widths[3]}}  "
        f"{row[4]:{widths[4]}}  {row[5]}".rstrip()
        for row in rows
    ]
    odd = [check.name for check in checked.checks if not check.good]
    lines.append("")
    if odd:
        lines.append(
            f"Outside the usual range: {', '.join(odd)}. The car may really be like that; "
            "otherwise look for a wrong number or unit in its file."
        )
    else:
        lines.append("Every figure is in the usual range.")
    lines.append(_BOOKS)
    few, total = checked.guesses
    if few:
        lines.append(f"{few} of {total} fields of the file are guesses.")
    return "\n".join(lines)


def _shown(value: float) -> str:
    """Three significant digits; what rounds to zero has no sign."""
    if np.isnan(value):
        return "-"
    return f"{value:.0f}" if 1000.0 <= abs(value) < np.inf else f"{round(value, 3) + 0.0:.3g}"
