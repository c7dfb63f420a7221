"""Fits the benchmark's tyre curves to steady states of a twin.

`python -m scenarios.experiment.double_track_fit CAR` writes models/double_track/CAR.toml. The
twin is a black box here: it drives slow ramps of the hand wheel at constant speeds, and ramps of
drive and brake torque straight ahead; its states, and the forces and loads of its tyres, are what a
test bench would give. Slips are the double track's own, from hub velocities and wheel speeds, so
that its curves hold what its kinematics lack (camber, elastic rolling radius, Ackermann).
"""

import math
import sys
from pathlib import Path

import mujoco
import numpy as np
import tomli_w
from numpy.typing import NDArray

import models
from estimators.benchmarks.double_track import Axle, DoubleTrack, MagicFormula, slips
from scenarios.driving.drivers import driver_of
from scenarios.driving.manoeuvres import Manoeuvre
from scenarios.driving.record import record
from scenarios.experiment.result import replacing, versions
from twin import SPINS, WHEELS, Drive, Twin, Vehicle

Array = NDArray[np.float64]

FOLDER = Path(models.__file__).parent / "double_track"
SPEEDS = (15.0, 25.0, 40.0)  # [m/s]
RAMP = 20.0  # [s] of a slow ramp
DT = 1e-3  # [s]
HARDEST, BRAKING = 12.0, 6.0  # brakes on a ramp to so many m/s2 within so many s
NEARLY = 0.98  # of the largest lateral acceleration, up to where a slow turn counts as steady
LEAST_LOAD = 300.0  # [N]
LARGEST_SLIP, PURE_SLIP = (
    0.15,
    0.02,
)  # of the direction fitted, beyond it a wheel locks; of the other
# b, c, d, e; bounds of c and e keep the curve a tyre's beyond the slips that steady states reach
START, LOW, HIGH = (12.0, 1.4, 1.4, 0.0), (2.0, 1.1, 0.3, -2.0), (60.0, 1.7, 3.0, 0.9)


def path(car: str) -> Path:
    """Where the double track of a car lies."""
    return FOLDER / f"{car}.toml"


def fit(name: str) -> DoubleTrack:
    """Fits the double track of a car, by its name in `models` or its file."""
    vehicle = Vehicle.load(name)
    driver = driver_of(vehicle)
    twin = Twin(vehicle)
    twin.reset(SPEEDS[1])
    ratio = float(twin.car.steering_ratio)
    turns = [record(vehicle, _turn(speed, ratio), driver) for speed in SPEEDS]
    ahead = [record(vehicle, _speed_up_and_brake(), driver)]
    return DoubleTrack(
        mass=float(twin.model.body_mass.sum()),
        yaw_inertia=_yaw_inertia(twin),
        height=float(twin.data.subtree_com[twin.car.chassis, 2]),
        steering_ratio=ratio,
        drag_area=float(twin.car.drag_area),
        front=_axle(twin, 0, turns, ahead),
        rear=_axle(twin, 1, turns, ahead),
    )


def _axle(twin: Twin, axle: int, turns: list[Drive], ahead: list[Drive]) -> Axle:
    wheels = slice(2 * axle, 2 * axle + 2)
    hubs = twin.data.xpos[twin.car.wheel_body[wheels]]
    track = float(abs(hubs[0, 1] - hubs[1, 1]))
    radius = float((SPEEDS[1] / twin.read_states()[SPINS])[2 * axle])
    x = float(twin.car.axle[axle])
    ratio = float(twin.car.steering_ratio) if axle == 0 else math.inf

    def slip(drive: Drive, w: int) -> Array:
        t = drive.truth
        angles = drive.channel("steering_wheel_angle") / ratio
        spins = t[f"wheel_speed_{WHEELS[w]}"]
        motion = zip(angles, spins, t["vx"], t["vy"], t["yaw_rate"], strict=True)
        y = 0.5 * track if w % 2 == 0 else -0.5 * track
        return np.array([slips(x, y, radius, *sample) for sample in motion])

    def points(drives: list[Drive], side: int) -> Array:
        found = []
        for drive in drives:
            good = _steady(drive)
            for w in range(2 * axle, 2 * axle + 2):
                load = drive.truth[f"fz_{WHEELS[w]}"]
                both = np.abs(slip(drive, w))
                use = good & (load > LEAST_LOAD)
                use &= (both[:, side] < LARGEST_SLIP) & (both[:, 1 - side] < PURE_SLIP)
                force = drive.truth[f"{('fx', 'fy')[side]}_{WHEELS[w]}"][use] / load[use]
                found.append(np.array([slip(drive, w)[use, side], force, load[use]])[:, ::10])
        return np.concatenate(found, axis=1)

    return Axle(
        x=x,
        track=track,
        radius=radius,
        roll_share=_roll_share(turns[1], axle),
        lift_area=float(twin.car[f"lift_area_{'front' if axle == 0 else 'rear'}"]),
        along=_curve(*points(ahead, 0)),
        across=_curve(*points(turns, 1)),
    )


def _turn(speed: float, ratio: float) -> Manoeuvre:
    """A ramp of the hand wheel to an angle that is beyond the grip."""
    n = round(RAMP / DT)
    angle = min(0.3, 60.0 / speed**2) * ratio * np.linspace(0.0, 1.0, n)
    return Manoeuvre(
        name="slow turn", dt=DT, speed=np.full(n, speed), steering=angle, road=np.zeros((n, 4))
    )


def _speed_up_and_brake() -> Manoeuvre:
    """Straight ahead ever harder on drive, then on brakes, until the grip is gone."""
    time = np.arange(0.0, 2.0 * RAMP, DT)
    faster = SPEEDS[0] + 0.12 * time**2
    slower = faster[time.size // 2] - 0.5 * HARDEST / BRAKING * (time - RAMP) ** 2
    speed = np.where(time < RAMP, faster, slower)
    n = int(np.argmax(slower < SPEEDS[0])) or time.size
    return Manoeuvre(
        name="ramps", dt=DT, speed=speed[:n], steering=np.zeros(n), road=np.zeros((n, 4))
    )


def _steady(drive: Drive) -> NDArray[np.bool_]:
    """Samples after the start and before the car slides away."""
    k, lateral = np.arange(len(drive)), np.abs(drive.truth["ay"])
    end = len(drive)
    if lateral.max() > 1.0:  # a turn
        end = int(np.argmax(lateral >= NEARLY * lateral.max()))
    return (k > 0.5 / DT) & (k < end)


def _roll_share(drive: Drive, axle: int) -> float:
    """Of the load transfer in a steady turn."""
    loads = np.array([drive.truth[f"fz_{wheel}"] for wheel in WHEELS])
    across = (loads[[1, 3]] - loads[[0, 2]])[:, len(drive) // 3]
    return float(across[axle] / across.sum())


def _yaw_inertia(twin: Twin) -> float:
    """Of the whole car about its vertical axis: an entry of MuJoCo's inertia matrix."""
    full = np.zeros((twin.model.nv, twin.model.nv))
    mujoco.mj_fullM(twin.model, twin.data, full)
    return float(full[5, 5])


def _curve(slip: Array, mu: Array, load: Array) -> MagicFormula:
    """The curve with the least squared error of the forces."""
    from scipy.optimize import least_squares  # not at the top: it takes its time

    def error(values: Array) -> Array:
        b, c, d, e = values
        s = b * slip
        return (d * np.sin(c * np.arctan(s - e * (s - np.arctan(s)))) - mu) * load

    found = least_squares(error, START, bounds=(LOW, HIGH), x_scale=np.abs(HIGH))
    return MagicFormula(*found.x.tolist())


def write(name: str) -> Path:
    """Fits a car and writes its file."""
    car = fit(name)
    content = {n: getattr(car, n) for n in DoubleTrack._fields[:5]}
    for axle in ("front", "rear"):
        one: Axle = getattr(car, axle)
        content[axle] = one._asdict() | {
            "along": one.along._asdict(),
            "across": one.across._asdict(),
        }
    content["made"] = {
        "command": f"python -m scenarios.experiment.double_track_fit {name}",
        "versions": versions(),
    }
    FOLDER.mkdir(exist_ok=True)
    with replacing(path(name)) as partial:
        partial.write_bytes(tomli_w.dumps(content).encode())
    return path(name)


if __name__ == "__main__":
    for car_name in sys.argv[1:]:
        print(write(car_name))
