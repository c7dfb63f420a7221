"""What the mass' standard deviation contains besides the noise, and whether it fits the forces."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenarios.logs.estimators import Found
from scenarios.logs.findings import Finding
from scenarios.logs.force_balance import balances, mass_of
from scenarios.logs.signals import facts_of, signals_of
from twin import Drive, Vehicle

Array = NDArray[np.float64]

_LEAST_HILL = 0.1  # [m/s2]; what is less is noise and pitching
# Of the mass, for each m/s2 of hills: twice of what 12 drives of the SUV were off in sines of 1 to
# 6 % and 25 to 60 s
_HILLS = 0.07
_UNLIKE = 0.05  # of the car's mass, by which the balance of forces may differ beside the interval
_NORMAL_95 = 1.96  # standard deviations


def unlike_forces(found: Found, drive: Drive, vehicle: Vehicle) -> list[Finding]:
    """A finding if the mass is none that torques over the wheels' acceleration let expect.

    The observer and the balance of forces weigh the same drive by other means: noise of a torque,
    a lag or a scale of a_x moves them apart.

    Args:
        found: of an estimator.
        drive: that it observed.
        vehicle: of the twin.
    """
    if "mass" not in found.sd:
        return []
    car = facts_of(vehicle)
    parts = balances(signals_of(drive.replace(truth={}), car), car)
    expected = mass_of(parts[0], car) if parts else None
    mass = car.mass + float(found.estimate["mass"][-1])
    allowed = _UNLIKE * car.mass + _NORMAL_95 * found.sd["mass"]
    if expected is None or abs(mass - expected) <= allowed:
        return []
    return [
        Finding(
            channels=("ax",),
            words=(
                f"The observer finds a car of {mass:.0f} kg, torques over the wheels' acceleration "
                f"one of {expected:.0f} kg"
            ),
        )
    ]


def with_hills(found: Found, hill: float) -> Found:
    """With what a twin on a flat road gets wrong in hills.

    Args:
        found: of an estimator that knows nothing of hills.
        hill: standard deviation of what gravity adds to a_x [m/s2].
    """
    if "mass" not in found.sd or hill < _LEAST_HILL:
        return found
    more = _HILLS * hill * float(found.estimate.absolute("mass")[-1])
    return _told(
        widened(found, more),
        f"Hills of {hill:.2g} m/s2, which the twin does not drive: the mass' standard deviation "
        f"contains {more:.3g} kg for them.",
    )


def with_torque_accuracy(found: Found, vehicle: Vehicle) -> Found:
    """With what the scale of the log's torques may be off by: the mass is off by as much.

    An observer that estimates that scale along has it in its standard deviation already.
    """
    accuracy = vehicle.figures.torque_accuracy
    if "mass" not in found.sd or "drive_torque" in found.parameters or accuracy == 0.0:
        return found
    more = accuracy * (vehicle.figures.mass + float(found.estimate["mass"][-1]))
    return _told(
        widened(found, more),
        f"The torques are taken to be accurate to {100.0 * accuracy:.3g} % (torque_accuracy of the "
        f"car's file): the mass' standard deviation contains {more:.3g} kg for them.",
    )


def widened(found: Found, more: float, over_time: Array | None = None) -> Found:
    """With an independent error of the mass, at the end and over time.

    Args:
        found: of an estimator that gives the mass and its standard deviation.
        more: standard deviation of that error at the end [kg].
        over_time: (N,) the same at each sample; None: as at the end.
    """
    estimate = found.estimate
    if estimate.sd is not None and "mass" in estimate.estimated:
        sd = estimate.sd.copy()
        column = estimate.estimated.index("mass")
        sd[:, column] = np.hypot(sd[:, column], more if over_time is None else over_time)
        estimate = replace(estimate, sd=sd)
    return found._replace(
        estimate=estimate, sd=found.sd | {"mass": float(np.hypot(found.sd["mass"], more))}
    )


def _told(found: Found, note: str) -> Found:
    return found._replace(done=(*found.done, note))
