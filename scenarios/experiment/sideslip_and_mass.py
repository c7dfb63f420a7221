"""Sideslip and mass together, TiL Section 5: what its estimators are given, and what tuning costs.

The paper's car and its data cannot be had. A second simulation plays the real vehicle, one that
differs from the twin as its name says, or another program's car. The real vehicle is unloaded; the
estimators believe at the start that 350 kg are missing, as the paper's do.

Any car can take the place of the sports car: its driver and its limits follow from its file. Where
the project ships no gains for it, it gets those that a tuning starts from; where it ships no double
track, one is fitted.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Literal, get_args

import numpy as np

from estimators.benchmarks import double_track, static_map
from estimators.entry import Given
from estimators.til import state_and_mass
from scenarios.driving.drivers import limits_of
from scenarios.driving.manoeuvres import lane_changes, laps
from scenarios.driving.record import CourseManoeuvre
from scenarios.experiment import double_track_fit, gains_file
from scenarios.experiment.experiment import Case, Cost, Experiment, Gain, Recipe, Run, Score
from scenarios.experiment.metrics import sideslip_and_mass
from scenarios.experiment.plants import CommonRoadCar, SimulatedCar
from scenarios.plants.mismatch import MISMATCHES
from twin import Drive, Twin, TwinError, Vehicle

TWIN, BMW = "sports_car", "bmw_320i"
CASE = "mismatched"
COMMONROAD = "commonroad"
MISSING = -350.0  # [kg], TiL Section 5.3
SNR = 20.0  # [dB]; chosen: a tenth of each signal, and not less than `twin.noise` has
FIT_SEED = 1000  # of the drive that the static map is fitted to
# [1/s]; chosen: quicker than a bend, and a fifth of what is missing
AXLE_FORCE_BANDWIDTH, AXLE_FORCE_LEAK = 2.0, 8.0

BOUNDS: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "til": {
        **state_and_mass.STATE_BOUNDS,
        **state_and_mass.CROSS_BOUNDS,
        **state_and_mass.LEAST_SQUARES_BOUNDS,
    },
    "til-paper": {**state_and_mass.STATE_BOUNDS, **state_and_mass.SIGN_BOUNDS},
    "double-track": double_track.BOUNDS,
}
# TiL Table 8; its gains on the mass are printed without a unit
TABLE_8: Mapping[str, Mapping[str, float]] = {
    "til-paper": {
        "wheel_speed": 0.259,
        "ax_vx": 3.287e-3,
        "ay_vy": 7.430e-2,
        "pitch_rate": 0.913,
        "yaw_rate": 1.046,
        "mass": 248.17,
    },
    "double-track": {"ax_vx": 9.282e-2, "ay_vy": 5.271e-2, "yaw_rate": 0.314, "mass": 2.06},
}
# Where a tuning starts for a car that has no gains yet: found by hand, or the paper's
_UNTUNED = {
    "til": {
        "wheel_speed": 100.0,
        "ax_vx": 1e-3,
        "ay_vy": 0.05,
        "pitch_rate": 50.0,
        "yaw_rate": 50.0,
        "yaw_rate_vy": 50.0,
        "noise_density": 0.063,
        "drift": 0.22,
    },
    **TABLE_8,
}


@cache
def gains_of(car: str, estimator: str) -> Mapping[str, float]:
    """The gains that ship with the project, or those that a tuning starts from."""
    if not gains_file.ships(car, estimator):
        return _UNTUNED[estimator]
    return gains_file.shipped(car, estimator, BOUNDS[estimator])


def _gains(run: Run, estimator: str) -> Mapping[str, float]:
    return gains_of(run.case.twin, estimator) if run.gains is None else dict(run.gains)


def _tunable(estimator: str, car: str) -> tuple[Gain, ...]:
    today = gains_of(car, estimator)
    return tuple(Gain(n, low, high, today[n]) for n, (low, high) in BOUNDS[estimator].items())


def _til(run: Run, drive: Drive, given: Given) -> Given:
    """Our mass law, and corrections of the states."""
    values = _gains(run, "til")
    law = state_and_mass.mass_law(values, wheels_of(run.case.twin))
    return replace(given, laws=(law,), gains=state_and_mass.state_gains(values))


def _til_axle_forces(run: Run, drive: Drive, given: Given) -> Given:
    """The same, with the lateral forces that the axles lack as extended states."""
    given, model = _til(run, drive, given), double_track_of(run.case.twin)
    laws = state_and_mass.axle_force_laws(
        _gains(run, "til"),
        AXLE_FORCE_BANDWIDTH,
        AXLE_FORCE_LEAK,
        model.mass,
        model.yaw_inertia,
        (model.front.x, model.rear.x),
    )
    return replace(given, laws=(*given.laws, *laws))


def _til_paper(run: Run, drive: Drive, given: Given) -> Given:
    values = _gains(run, "til-paper")
    law = state_and_mass.paper_mass_law(values)
    return replace(given, laws=(law,), gains=state_and_mass.state_gains(values))


def _double_track(run: Run, drive: Drive, given: Given) -> Given:
    settings = double_track.Gains(**_gains(run, "double-track"))
    return replace(given, model=double_track_of(run.case.twin), settings=settings)


def _static_map(run: Run, drive: Drive, given: Given) -> Given:
    return replace(given, model=_fitted_map(run.case.twin))


RECIPES: Mapping[str, Recipe] = {
    "til": Recipe(estimator="til", complete=_til, tunable=partial(_tunable, "til")),
    "til-paper": Recipe(
        estimator="til-paper", complete=_til_paper, tunable=partial(_tunable, "til-paper")
    ),
    "double-track": Recipe(
        estimator="double-track", complete=_double_track, tunable=partial(_tunable, "double-track")
    ),
    "static-map": Recipe(estimator="static-map", complete=_static_map),
    "zero": Recipe(estimator="zero"),
}
AXLE_FORCES = {"til-axle-forces": Recipe(estimator="til", complete=_til_axle_forces)}


@cache
def double_track_of(car: str) -> double_track.DoubleTrack:
    """The double track that ships with the project; for another car, one that is fitted to it."""
    path = double_track_fit.path(car)
    return double_track.load(path) if path.is_file() else double_track_fit.fit(car)


@cache
def wheels_of(car: str) -> state_and_mass.Wheels:
    """What the mass law has to know of a car."""
    twin = Twin(Vehicle.load(car))
    mass = float(twin.model.body_mass.sum())
    radii = np.array([tyre["unloaded_radius"] for tyre in twin.vehicle.tyres()])
    return state_and_mass.Wheels(mass, float(np.mean(twin.car.spin_inertia / radii) / mass))


@cache
def _fitted_map(car: str) -> static_map.StaticMap:
    """Fitted to laps of a real vehicle with its true sideslip: more than a user has."""
    real = case(COMMONROAD, "laps") if car == BMW else case(CASE, "laps", car)
    drive = real.noisy_drive(FIT_SEED)
    return static_map.fit(*static_map.map_inputs(drive), drive.truth["sideslip"])


DriveName = Literal["laps", "lane-change"]


@dataclass(frozen=True, slots=True)
class AtLimits:
    """A drive at the limits of a car; a function of its duration.

    Attributes:
        car: whose limits, by its name in `models` or its file.
        drive: which.
    """

    car: str
    drive: DriveName

    def __call__(self, duration: float | None = None) -> CourseManoeuvre:
        """The manoeuvre; of the first so many seconds only, if a duration is given [s]."""
        manoeuvre = laps if self.drive == "laps" else lane_changes
        return manoeuvre(duration=duration, limits=limits_of(Vehicle.load(self.car)))


def case(vehicle: str, drive: DriveName, car: str = TWIN) -> Case:
    """A real vehicle on a drive.

    Args:
        vehicle: a name of `MISMATCHES`, or `COMMONROAD`.
        drive: which.
        car: of the twin and, but for CommonRoad's, of the real vehicle.
    """
    if vehicle == COMMONROAD:
        plant, twin = CommonRoadCar(drives=drive), BMW
    else:
        plant, twin = SimulatedCar(car=car, manoeuvre=AtLimits(car, drive), mismatch=vehicle), car
    return Case(
        name=f"{vehicle}, {drive}",
        plant=plant,
        twin=twin,
        snr=SNR,
        initial=(("mass", MISSING),),
    )


# Tuning, on noise that no result is reported on. Two costs:
#
# * "paper", TiL Eq. (26): over a lap, from the paper's initial error, 10 times the rms of the
#   sideslip's error [deg] (k_beta = 100 stands inside the root) plus the rms of the mass's over the
#   last 10 s [kg]. It can be met by a mass that happens to pass the truth at the end.
# * "robust", ours: rms of the sideslip's error over 0.1 deg plus that of the mass's over the last
#   minute over 1 % of the car's mass; the mean over a lap and lane changes, each from two initial
#   errors of either sign.
SEED = 1000
LAP = 105.0  # [s]
STARTS = {"robust": (MISSING, 200.0), "paper": (MISSING,)}  # [kg]
DURATIONS: Mapping[str, Mapping[DriveName, float]] = {
    "robust": {"laps": LAP, "lane-change": 80.0},
    "paper": {"laps": LAP},
}  # [s]
# What no tuning sees unless it is told to: other real vehicles, both drives
HELD_OUT = ("all-scales:laps", "all-scales:lane-change", "cornering_stiffness-10:laps",
            "brake+5:lane-change")  # fmt: skip
SIDESLIP, MASS_SHARE = 0.1, 0.01  # [deg], [-]: errors that count as one
K_BETA = 100.0  # TiL Eq. (26)


def _runs(
    cost: str,
    names: tuple[str, ...],
    experiment: Experiment,
    estimator: str,
    values: tuple[tuple[str, float], ...],
) -> list[Run]:
    """A run for each real vehicle and drive, and each start."""
    car = experiment.cases[0].twin
    return [
        Run(
            experiment=experiment,
            case=replace(case(vehicle, drive, car), initial=(("mass", start),)),
            estimator=estimator,
            seed=SEED,
            duration=DURATIONS["robust"][drive],
            gains=values,
        )
        for vehicle, drive in map(vehicle_and_drive, names)
        for start in STARTS[cost]
    ]


def vehicle_and_drive(name: str) -> tuple[str, DriveName]:
    """Of a name as in `mismatched:laps`.

    Raises:
        TwinError: an unknown vehicle or drive.
    """
    vehicle, _, drive = name.partition(":")
    vehicles = (*MISMATCHES, COMMONROAD)
    if vehicle not in vehicles or drive not in get_args(DriveName):
        raise TwinError(
            f"tune: {name!r} is no real vehicle on a drive; allowed: VEHICLE:DRIVE of "
            f"{', '.join(vehicles)} and {', '.join(get_args(DriveName))}"
        )
    return vehicle, "laps" if drive == "laps" else "lane-change"


def _robust(scored: Sequence[Sequence[Score]], runs: Sequence[Run]) -> float:
    share = MASS_SHARE * wheels_of(runs[0].case.twin).mass
    return float(np.mean([
        _figure(one, "sideslip", "rmse") / SIDESLIP + _figure(one, "mass", "rmse_last_60s") / share
        for one in scored
    ]))  # fmt: skip


def _paper(scored: Sequence[Sequence[Score]], runs: Sequence[Run]) -> float:
    del runs
    return float(np.mean([
        np.sqrt(K_BETA) * _figure(one, "sideslip", "rmse") + _figure(one, "mass", "rmse_last_10s")
        for one in scored
    ]))  # fmt: skip


def _figure(scores: Sequence[Score], quantity: str, metric: str) -> float:
    return next(s.value for s in scores if (s.quantity, s.metric) == (quantity, metric))


def _cost(
    name: str,
    of: Callable[[Sequence[Sequence[Score]], Sequence[Run]], float],
    worst: float,
    names: Sequence[str] = (),
) -> Cost:
    names = tuple(names) or tuple(f"{CASE}:{drive}" for drive in DURATIONS[name])
    others = {vehicle_and_drive(one)[0] == COMMONROAD for one in names}
    if len(others) > 1:
        raise TwinError(f"tune: {', '.join(names)} are of 2 cars; allowed: of one car")
    made = {
        "tuned_on": list(names),
        "seed": SEED,
        "snr": SNR,
        "starts": list(STARTS[name]),
        "seconds": [DURATIONS["robust"][vehicle_and_drive(one)[1]] for one in names],
    }
    held_out = () if True in others else HELD_OUT
    return Cost(
        partial(_runs, name, names), of, f"{name}_cost", worst, made,
        on=partial(_cost, name, of, worst), held_out=tuple(n for n in held_out if n not in names),
    )  # fmt: skip


COSTS = {"robust": _cost("robust", _robust, 1e3), "paper": _cost("paper", _paper, 1e4)}


def experiment(drive: DriveName, car: str = TWIN) -> Experiment:
    """A drive of the mismatched car.

    Args:
        drive: which.
        car: by its name in `models` or its file.
    """
    return Experiment(
        name=drive,
        cases=(case(CASE, drive, car),),
        estimators=RECIPES,
        quantities=("sideslip", "mass", "fy_front", "fy_rear"),
        metrics=sideslip_and_mass,
        costs=COSTS,
        timeline="sideslip and mass",
        with_car=partial(experiment, drive),
    )
