"""What an observer of parameters believes before a drive, where a car's file holds guesses."""

import numpy as np

from twin import PARAMETER, Vehicle
from twin.car.guesses import GUESSED_BY, Guess, guesses_of


def guessed_priors(vehicle: Vehicle) -> dict[str, float]:
    """Standard deviations of a twin's parameters before the first sample, where a car is guessed.

    Args:
        vehicle: the car.

    Returns:
        By parameter, only those whose fields are guesses: that of its record and the guess's.
    """
    guesses = {guess.name: guess for guess in guesses_of(vehicle)[0]}
    found = {}
    for name, fields in GUESSED_BY.items():
        guessed = [guesses[field] for field in fields if field in guesses]
        if guessed:
            more = max(_as_delta(name, guess) for guess in guessed)
            found[name] = float(np.hypot(PARAMETER[name].prior_sd, more))
    return found


def _as_delta(parameter: str, guess: Guess) -> float:
    """A guess's standard deviation in the unit of a parameter of a twin."""
    if PARAMETER[parameter].unit != "1":
        return guess.sd
    return guess.sd / abs(guess.value) if guess.value else 0.0
