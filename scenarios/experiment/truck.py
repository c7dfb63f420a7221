"""The truck of KBF: its cases, what its estimators are given, and how they are scored."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from estimators.benchmarks.kalman_bucy import KalmanBucySettings, detecting, matched
from estimators.entry import Given
from estimators.til.law import ParameterLaw
from scenarios.experiment.experiment import Case, Experiment, Recipe, Run, Score, Trial
from scenarios.experiment.truck_plant import LOAD_STEPS, NOISE, SAMPLE_TIME, TruckOnRoad
from twin import Drive, TruckParameters, TruckTwin, TwinError
from twin.truck.model import RATES
from twin.truck.twin import TRUCK_PARAMETERS

Array = NDArray[np.float64]
SettingsOf = Callable[[TruckOnRoad], KalmanBucySettings]

UNITS: dict[str, str] = dict(
    zip((*TRUCK_PARAMETERS, *RATES), ("kg", "kg m2", "kg m2", "m/s", "rad/s", "rad/s"), strict=True)
)
PAPER: Mapping[tuple[str, str], float] = {
    ("mass", "rmse"): 509.4,
    ("Jxx", "rmse"): 566.7,
    ("Jyy", "rmse"): 1829.5,
    ("vz", "rmse"): 0.007,
    ("roll_rate", "rmse"): 0.014,
    ("pitch_rate", "rmse"): 0.012,
    ("mass", "mape_pct"): 4.18,
    ("Jxx", "mape_pct"): 3.29,
    ("Jyy", "mape_pct"): 3.51,
    ("vz", "mape_pct"): 3.50,
    ("roll_rate", "mape_pct"): 1.21,
    ("pitch_rate", "mape_pct"): 0.851,
    **{(name, "time_to_10pct"): 0.5 for name in TRUCK_PARAMETERS},
}
"""KBF, Table 2, by quantity and metric; the times are those of its conclusions."""

HOLD = 0.1
"""How long an error has to stay below 10 % to count as settled [s]; chosen."""


def _til_law(
    parameter: str, signal: str, nominal: float, noise: float, mode: tuple[float, float]
) -> ParameterLaw:
    """One law in the manner of TiL Eq. (14); mode: frequency [Hz] and damping ratio."""
    return ParameterLaw(
        parameter=parameter,
        signal=signal,
        scale=nominal,
        prior_sd=nominal,  # the start is 2 x nominal
        noise_density=noise,
        drift=0.7 * nominal,  # per root of second: a load step of half is learnt in half a second
        filter_time=0.007,
        mode_frequency=mode[0],
        mode_damping=mode[1],
    )


# Modes are those of the nominal chassis on its springs and dampers. Gains, noise, drift and filter
# were found by a random search of 110 trials over seed 100 under the smaller and seed 101 under the
# larger noise; one setting serves both.
_NOMINAL = TruckParameters().nominal
TIL_LAWS = (
    _til_law("mass", "heave_acceleration", _NOMINAL.mass, 0.13, (1.87, 0.28)),
    _til_law("Jxx", "roll_acceleration", _NOMINAL.roll_inertia, 0.05, (1.62, 0.24)),
    _til_law("Jyy", "pitch_acceleration", _NOMINAL.pitch_inertia, 0.05, (2.01, 0.29)),
)
TIL_GAINS = {(rate, rate): 18.0 for rate in RATES}  # [1/s]


NOMINAL: dict[str, float] = dict(
    zip(TRUCK_PARAMETERS, map(float, _NOMINAL.parameters), strict=True)
)
# All start at twice the nominal load, a delta of once that
INITIAL = tuple(NOMINAL.items())


def truck_case(name: str, paper: Mapping[tuple[str, str], float] | None = None, **changes) -> Case:
    """A truck that differs from the paper's in some attributes of `TruckOnRoad`."""
    return Case(name=name, plant=TruckOnRoad(**changes), initial=INITIAL, paper=paper or {})


CASES = tuple(truck_case(noise, PAPER, noise=noise) for noise in NOISE)
"""Both readings of the paper's noise."""


def truck_of(run: Run) -> TruckOnRoad:
    """The real vehicle of a run.

    Raises:
        TwinError: it is no truck.
    """
    if not isinstance(run.case.plant, TruckOnRoad):
        raise TwinError(f"{run.experiment.name}: is no truck, for which alone {run.estimator} is")
    return run.case.plant


def matched_settings(truck: TruckOnRoad) -> KalmanBucySettings:
    """R from the sensors of the case."""
    noise = NOISE[truck.noise]
    return matched(noise.sensors, SAMPLE_TIME, parameter_density=noise.parameter_density)


def detecting_settings(truck: TruckOnRoad, *, robust: bool) -> KalmanBucySettings:
    """As `matched_settings`, with detection of load changes."""
    return detecting(matched_settings(truck), robust=robust)


def kalman_bucy(settings: KalmanBucySettings | SettingsOf, name: str = "kalman-bucy") -> Recipe:
    """The filter with its settings or what gives them for a truck."""

    def complete(run: Run, drive: Drive, given: Given) -> Given:
        truck = truck_of(run)
        own = settings(truck) if callable(settings) else settings
        own = replace(own, gravity=truck.known_gravity)
        return replace(given, model=TruckParameters(), settings=own)

    return Recipe(estimator=name, complete=complete)


def _til(run: Run, drive: Drive, given: Given) -> Given:
    """The Twin-in-the-Loop observer around a `TruckTwin`.

    Its twin, a simulator of the whole truck, is driven by the road heights under the real wheels,
    without error: more than a real truck knows. It sees the three rates, but no suspension; the
    filters see both and know no road.

    The laws know no weight: under gravity a twin whose mass they raise sinks, which they take for
    the answer of a mass still too small. Only a twin without gravity finds the mass there.
    """
    gravity = truck_of(run).known_gravity
    return replace(given, black_box=lambda: TruckTwin(gravity=gravity), gains=TIL_GAINS)


_PLAIN = KalmanBucySettings()
RECIPES: Mapping[str, Recipe] = {
    "kalman-bucy": kalman_bucy(_PLAIN),
    "kalman-bucy-matched": kalman_bucy(matched_settings),
    "kalman-bucy-literal": kalman_bucy(replace(_PLAIN, parametrisation="p"), "kalman-bucy-literal"),
    "til": Recipe(estimator="til", laws=TIL_LAWS, channels=RATES, complete=_til),
    "kalman-bucy-detecting": kalman_bucy(partial(detecting_settings, robust=True)),
    "kalman-bucy-sharp": kalman_bucy(partial(detecting_settings, robust=False)),
    "kalman-bucy-p": kalman_bucy(replace(_PLAIN, parametrisation="p")),
    "kalman-bucy-log": kalman_bucy(replace(_PLAIN, parametrisation="log p")),
}


def some(*names: str) -> dict[str, Recipe]:
    """Some of `RECIPES`."""
    return {name: RECIPES[name] for name in names}


def estimate_of(trial: Trial, name: str) -> Array:
    """(N,) of a load parameter, as a value, or of a rate."""
    estimate = trial.estimate
    if name in TRUCK_PARAMETERS:
        return NOMINAL[name] + estimate[name]
    return estimate.outputs[:, estimate.output_names.index(name)]


def errors(trial: Trial) -> list[Score]:
    """RMSE and MAPE of KBF Eq. (10), and the time to 10 % after a load step.

    That time is the longest over the steps, as in `settling_times`; NaN for a drive without any.
    The percentage leaves out the sample at rest, whose true velocities are zero.
    """
    found = []
    for name in trial.run.experiment.quantities:
        true, own = trial.drive.truth[name], estimate_of(trial, name)
        relative = np.divide(true - own, true, out=np.zeros_like(own), where=true != 0)
        found += [
            Score(name, "mape_pct", "%", float(100 * np.abs(relative).mean())),
            Score(name, "rmse", UNITS[name], float(np.sqrt(np.mean((true - own) ** 2)))),
        ]
        if name in TRUCK_PARAMETERS:
            times = settling_times(trial.drive, name, own)[1:]
            found.append(Score(name, "time_to_10pct", "s", max(times, default=np.nan)))
    return found


def settling_times(drive: Drive, name: str, found: Array) -> list[float]:
    """How long after the start and each load step the error falls below 10 % [s].

    It has to stay there for `HOLD`; infinite where it never does before the next step.

    Args:
        drive: with its truth.
        name: of the parameter.
        found: its estimate. Shape (n,).
    """
    wrong = np.abs(found / drive.truth[name] - 1) >= 0.1
    hold = round(HOLD / SAMPLE_TIME)
    steps = (round(start / SAMPLE_TIME) for start, _ in LOAD_STEPS)
    starts = [0, *(step for step in steps if step < wrong.size)]
    times = []
    for first, last in zip(starts, [*starts[1:], wrong.size], strict=True):
        misses = np.concatenate([[0], np.cumsum(wrong[first:last])])
        settled = np.flatnonzero(misses[hold:] == misses[:-hold])
        times.append(float(settled[0] * SAMPLE_TIME if settled.size else np.inf))
    return times


def experiment(
    name: str,
    cases: tuple[Case, ...],
    recipes: Mapping[str, Recipe],
    quantities: tuple[str, ...] = TRUCK_PARAMETERS,
) -> Experiment:
    """Estimators of the truck's load on some cases."""
    return Experiment(
        name=name,
        cases=cases,
        estimators=recipes,
        quantities=quantities,
        metrics=errors,
        timeline="truck",
    )
