"""What the intervals contain for the fields of a car's file that are guesses."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenarios.logs.candidate import SLOWEST
from scenarios.logs.estimators import Found
from scenarios.logs.mass_interval import widened
from twin import TwinError, Vehicle
from twin.car.guesses import Guess, draw, guesses_of

Array = NDArray[np.float64]

CARS = 8  # drawn from what the guesses allow; each is an observer's run over the log
_SEED = 0  # the same cars for every log
_LEAST = CARS // 2  # of them have to get through the log
_DRAWS = 100  # at most, until one can be a car
# 97.5 % quantile of Student's t with CARS degrees of freedom, over that of the normal distribution:
# the spread of so few cars is not well known itself
_STUDENT = 2.306 / 1.960


def with_guesses(found: Found, vehicle: Vehicle, run: Callable[[Vehicle], Found]) -> Found:
    """With the spread of what twins find of a log that differ in what is guessed of the car.

    Args:
        found: by the twin of the car's file.
        vehicle: the car.
        run: the same estimator on the same log with another car.
    """
    guesses, total = guesses_of(vehicle)
    if not guesses:
        return found
    trusted = found.estimate.trustworthy
    others = _runs(vehicle, guesses, run, trusted is not None and bool(trusted[-1]))
    told = f"{len(guesses)} of {total} fields of {vehicle.source.name} are guesses"
    if len(others) < _LEAST:
        return found._replace(
            faults=(
                *found.faults,
                f"{told}, and {CARS - len(others)} of {CARS} cars that they allow do not get "
                "through this drive: change what you know of yours.",
            )
        )
    allowed = []
    if "mass" in found.sd:
        own = _total_mass(found, vehicle)
        more = _spread([_total_mass(one, car) - own for car, one in others])
        found = widened(found, float(more[-1]), over_time=more)
        allowed.append(f"{more[-1]:.3g} kg of the total mass' standard deviation")
        found = _empty_mass_told(found, guesses)
    if found.estimate.sideslip_sd is not None:
        own = _sideslip(found)
        more = _spread([_sideslip(one) - own for _, one in others])
        sd = np.hypot(found.estimate.sideslip_sd, more)
        found = found._replace(estimate=replace(found.estimate, sideslip_sd=sd))
        moves = found.estimate["vx"] > SLOWEST
        rms = np.degrees(np.sqrt(np.mean(more[moves] ** 2))) if moves.any() else 0.0
        allowed.append(f"{rms:.2g} deg (rms) of the sideslip's")
    if not allowed:
        return found._replace(done=(*found.done, f"{told}; no interval is given for them."))
    note = f"{told}; the intervals allow for them: {' and '.join(allowed)}."
    return found._replace(done=(*found.done, note))


def _empty_mass_told(found: Found, guesses: Sequence[Guess]) -> Found:
    """With a word where the car's own mass is a guess."""
    for guess in guesses:
        if guess.name == "chassis.mass":
            note = (
                f"The car's own mass is a guess, with a standard deviation of {guess.sd:.3g} kg: "
                "the interval is that of the total mass, the load is known no better than that."
            )
            return found._replace(done=(*found.done, note))
    return found


def _runs(
    vehicle: Vehicle, guesses: Sequence[Guess], run: Callable[[Vehicle], Found], sound: bool
) -> list[tuple[Vehicle, Found]]:
    """What cars that the guesses allow find, those left out that the log rules out.

    Args:
        vehicle: the car.
        guesses: of it.
        run: the estimator on the log.
        sound: whether an estimate must be trustworthy at the end, as that of the car's file is.
    """
    rng = np.random.default_rng(_SEED)
    found = []
    for _ in range(CARS):
        car = _drawn(vehicle, guesses, rng)
        try:
            one = run(car)
        except TwinError:  # the twin blows up, or leaves what is measured again and again
            continue
        trusted = one.estimate.trustworthy
        if not sound or trusted is None or trusted[-1]:
            found.append((car, one))
    return found


def _drawn(vehicle: Vehicle, guesses: Sequence[Guess], rng: np.random.Generator) -> Vehicle:
    """A car that the guesses allow.

    Raises:
        TwinError: none of many draws can be a car.
    """
    for _ in range(_DRAWS):
        values: Mapping[str, float] = draw(guesses, rng)
        try:
            return vehicle.with_fields(values)
        except TwinError:  # no body has such an inertia, for example
            continue
    raise TwinError(f"{vehicle.source}: no car has what its guesses allow")


def _total_mass(found: Found, vehicle: Vehicle) -> Array:
    """(N,) of the whole car [kg]."""
    return vehicle.figures.mass + found.estimate["mass"]


def _sideslip(found: Found) -> Array:
    """(N,) [rad]."""
    estimate = found.estimate
    if "sideslip" in estimate.output_names:
        return estimate["sideslip"]
    return np.arctan2(estimate["vy"], np.maximum(estimate["vx"], SLOWEST))


def _spread(differences: Sequence[Array]) -> Array:
    """(N,) standard deviation, of which the interval of a normal distribution holds 95 %."""
    return _STUDENT * np.sqrt(np.mean(np.square(differences), axis=0))
