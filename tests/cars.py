"""Cars for the tests: variants of the SUV written to a folder, and a compiled loop that drives."""

import re
from typing import NamedTuple

import numpy as np
from numba import njit

import models
from estimators.til.observer import Observer
from scenarios.driving.joint_drives import mixed
from scenarios.driving.record import record
from twin import INPUTS, TYRE_OUTPUTS, WHEELS, Twin, Vehicle, noise_sd, with_noise
from twin.kernel import read_states, step

G = 9.81
FL, FR, RL, RR = range(4)
FX, FY, FZ, MX, MY, MZ, KAPPA, ALPHA, CAMBER = range(len(TYRE_OUTPUTS))
X, Y, Z, ROLL, PITCH, YAW, TRAVEL = range(7)
ANGLE, VX, VY, VZ, ROLL_RATE, PITCH_RATE, YAW_RATE, RATE, SPIN = 10, 14, 15, 16, 17, 18, 19, 20, 24

# models/suv.xml, written out: what hand calculations start from
MASS, CM_Y, UNSPRUNG, WHEEL_INERTIA = 2125.8, -0.00003, 25.0 + 28.0, 1.7
FRONT, REAR, HALF_TRACK, HUB_Z = 1.25, -1.65, 0.825, -0.2965
WHEELBASE = FRONT - REAR
TOTAL = MASS + 4.0 * UNSPRUNG
PLACES = np.array(
    [[x, y, HUB_Z] for x in (FRONT, REAR) for y in (HALF_TRACK, -HALF_TRACK)]
)  # of the wheel centres in the chassis frame
DRAG_AREA, AIR_DENSITY = 0.90, 1.2


class Run(NamedTuple):
    """What a drive gave, sample by sample; all belongs to the state before the step."""

    inputs: np.ndarray  # (N, 13)
    outputs: np.ndarray  # (N, 10)
    states: np.ndarray  # (N, 28)
    tyres: np.ndarray  # (N, 4, 9)


@njit(cache=True, nogil=True)
def _advance(car, inputs, outputs, states, tyres):
    for k in range(inputs.shape[0]):
        read_states(car, states[k])
        step(car, inputs[k], outputs[k])
        tyres[k] = car.tyre_output


def run(twin, inputs):
    """Steps the twin through (N, 13) inputs and raises if it blows up."""
    inputs = np.ascontiguousarray(inputs, dtype=float)
    n = len(inputs)
    made = Run(inputs, np.empty((n, 10)), np.empty((n, 28)), np.empty((n, 4, 9)))
    _advance(twin.car, *made)
    twin.check()
    return made


def inputs(seconds, dt=0.001, *, steering=0.0, drive=0.0, brake=0.0, road=0.0):
    """(N, 13) inputs; each argument a number, an array over time, or one per wheel."""
    u = np.zeros((round(seconds / dt), len(INPUTS)))
    u[:, 0] = steering
    u[:, 1:5] = drive
    u[:, 5:9] = brake
    u[:, 9:13] = road
    return u


def times(seconds, dt=0.001):
    return np.arange(round(seconds / dt)) * dt


def suv(speed=0.0, **where):
    """The SUV on its wheels."""
    twin = Twin(Vehicle.load("suv"))
    twin.reset(speed, **where)
    return twin


def variant(folder, *edits, tyre=()):
    """The SUV with strings of its MJCF and numbers of its tyre changed.

    Args:
        folder: where to write it.
        edits: (pattern, replacement) regular expressions; each must be found.
        tyre: pairs (KEY, value) of the .tir file.
    """
    xml = models.path("suv").read_text()
    for pattern, replacement in edits:
        xml, found = re.subn(pattern, replacement, xml)
        assert found, pattern
    tir = models.path("tyres/suv.tir").read_text()
    for key, value in dict(tyre).items():
        tir, found = re.subn(rf"(?m)^{key}(\s*)=\s*\S+", rf"{key}\1= {value!r}", tir)
        assert found == 1, key
    (folder / "tyres").mkdir(exist_ok=True)
    (folder / "tyres/suv.tir").write_text(tir)
    (folder / "car.xml").write_text(xml)
    return Vehicle.load(folder / "car.xml")


FLIP = np.ones(28)
FLIP[[Y, ROLL, YAW, VY, ROLL_RATE, YAW_RATE]] = -1.0
SWAP = [1, 0, 3, 2]


def mirrored(states):
    """States of the mirror image: y, roll and yaw change sign, left and right wheels place."""
    states = states * FLIP
    for block in (TRAVEL, ANGLE, RATE, SPIN):
        states[:, block : block + 4] = states[:, block : block + 4][:, SWAP]
    return states


def vertical_slides():
    """The edits that make the wheels travel along the body's z axis."""
    return ((r'(name="travel_\w\w" class="\w+" axis=)"[^"]*"', r'\1"0 0 1"'),)


def contact_points(twin, road=0.0):
    """(4, 3) of the wheels on level ground as MuJoCo has them now: in each wheel's plane."""
    points = np.empty((4, 3))
    for w, wheel in enumerate(WHEELS):
        body = twin.data.body(f"wheel_{wheel}")
        axis = body.xmat.reshape(3, 3)[:, 1]
        ahead = np.cross(axis, [0.0, 0.0, 1.0])
        upright = np.cross(ahead / np.linalg.norm(ahead), axis)
        height = body.xpos[2] - np.broadcast_to(road, 4)[w]
        points[w] = body.xpos - height / upright[2] * upright
    return points


def eigenvalues_of(twin):
    """Those of the black box, by finite differences of single steps about its equilibrium."""
    twin.reset()
    start, u, size = twin.snapshot(), inputs(0.001), 1e-6

    def acceleration(x):
        twin.restore(start)
        twin.correct(x)
        before = twin.read_states()[VX:]
        run(twin, u)
        return (twin.read_states()[VX:] - before) / twin.dt

    a = np.zeros((28, 28))
    a[:VX, VX:] = np.eye(14)
    for i, x in enumerate(size * np.eye(28)):
        a[VX:, i] = (acceleration(x) - acceleration(-x)) / (2.0 * size)
    return np.linalg.eigvals(a)


def pairs(values):
    """Frequency [Hz] and damping ratio of the oscillations, by frequency, (2, n)."""
    values = values[values.imag > 1.0]
    values = values[np.argsort(np.abs(values))]
    return np.array([np.abs(values) / (2.0 * np.pi), -values.real / np.abs(values)])


def drag(speed):
    """Air drag [N] along the body, by hand."""
    return -0.5 * AIR_DENSITY * DRAG_AREA * speed * abs(speed)


def drive_of_other_car(load, *, seconds, snr, seed=0):
    """A short rich drive of the SUV with other parameters than its file's, and no other difference.

    Args:
        load: deltas by name.
        seconds: of the drive.
        snr: of the sensors [dB]; inf: no noise.
        seed: of the noise.

    Returns:
        The noisy drive, the (10,) standard deviations of a noise of 10 dB, and the speed at the
        start [m/s].
    """
    vehicle = Vehicle.load("suv")
    driven = record(vehicle, mixed(duration=seconds))
    speed = float(driven.truth["vx"][0])
    other = Observer(Twin(vehicle), [])
    other.reset(speed, load)
    clean = driven.replace(measurements=other.run(driven).outputs)
    noisy = with_noise(clean, snr, np.random.default_rng(seed))
    return noisy, noise_sd(clean.measurements, 10.0), speed
