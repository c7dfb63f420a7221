"""Computes the table of `scenarios.planning.advice`, after a change of the observer or the car.

python -m scenarios.planning.advice_table > scenarios/planning/advice.toml
"""

import numpy as np
import tomli_w

from estimators.joint.expected import LONGEST, names_reached
from estimators.joint.observer import JointSettings
from scenarios.planning.design import DT, hand_wheel_of
from scenarios.planning.drive import Motion, course_for
from scenarios.planning.fit import fitted
from scenarios.planning.limits import PlanLimits
from scenarios.planning.plan import Task, told_by
from scenarios.planning.standard import STANDARD
from twin import LOAD, SCALES, Vehicle

CAR = "suv"
LIMITS = PlanLimits(fast=22.0, slow=8.0, width=np.inf)
_SLALOM = (15.0, 0.9, 4.0)  # [m/s], [Hz], [m/s2]
_SIMULATED = 40.0  # [s] of each manoeuvre; beyond, it is extrapolated


def slalom(vehicle: Vehicle, limits: PlanLimits, seconds: float) -> Motion:
    """A sine of the hand wheel at constant speed."""
    speed, frequency, lateral = _SLALOM
    time = np.arange(round(seconds / DT)) * DT
    amplitude = min(lateral, limits.lateral) * hand_wheel_of(vehicle, np.array([speed]))[0]
    return Motion(
        name="slalom",
        speed=np.full(time.size, speed),
        steering=amplitude * np.clip(2.0 * time, 0.0, 1.0) * np.sin(2.0 * np.pi * frequency * time),
        free=True,
    )


MANOEUVRES = {"slalom": slalom, **STANDARD}


def seconds_of(manoeuvre: str, simulated: float = _SIMULATED) -> dict[str, float]:
    """Seconds of a manoeuvre until each parameter is valid, those within ten minutes.

    Args:
        manoeuvre: of `MANOEUVRES`.
        simulated: of it [s].
    """
    task = Task(CAR, {"mass": 100.0}, LIMITS)
    motion = MANOEUVRES[manoeuvre](task.car, LIMITS, simulated)
    motion, _, _ = fitted(task.car, motion, course_for(LIMITS, task.car), LIMITS)
    share, names = JointSettings().valid_share, (*LOAD, *SCALES)
    found = names_reached(
        told_by(task, motion).information, names, share, task.error, until=LONGEST
    )
    return {name: round(seconds, 1) for name, seconds in found.items() if np.isfinite(seconds)}


if __name__ == "__main__":
    columns = {name: seconds_of(name) for name in MANOEUVRES}
    rows = {
        parameter: {
            name: column[parameter] for name, column in columns.items() if parameter in column
        }
        for parameter in (*LOAD, *SCALES)
    }
    print("# Seconds of standard manoeuvres; see scenarios/planning/advice_table.py.\n")
    print(tomli_w.dumps(rows), end="")
