"""Compiled parts of observers that compare several twins of a vehicle, block by block of samples.

A Kalman step takes the mean of a block, by which the noise is smaller and the work less; whatever
moves the parameters of a twin moves its states along.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimators.ensemble.stepping import correct, is_sound, read_states, step
from twin import OUTPUTS, SPINS, STATES, WHEEL_ANGLES, WHEEL_SPEEDS, X

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

NX, NY = len(STATES), len(OUTPUTS)
FIRST_WHEEL, AFTER_WHEELS = WHEEL_SPEEDS.start, WHEEL_SPEEDS.stop
ROLL, VX = X.roll, X.vx
ANGLES, AFTER_ANGLES = WHEEL_ANGLES.start, WHEEL_ANGLES.stop
FIRST_SPIN, AFTER_SPINS = SPINS.start, SPINS.stop
ABSENT = 1e12  # variance of a channel that has no measurement
LEAST_SPIN = 1.0  # slower than this a wheel speed tells no speed of the car [rad/s]; chosen


class Block(NamedTuple):
    """Sums over a block of samples, of n twins."""

    out: Array  # (n, ny) the twins' last outputs
    mean: Array  # (n, ny) of their outputs; a sum until the block is full
    measured: Array  # (ny,) mean of the measurements, NaN: none; a sum until the block is full
    number: Array  # (ny,) of measurements
    samples: Indices  # (1,) in the block


def new_block(n: int) -> Block:
    """An empty block of n twins."""
    return Block(
        out=np.zeros((n, NY)), mean=np.zeros((n, NY)), measured=np.zeros(NY), number=np.zeros(NY),
        samples=np.zeros(1, dtype=np.int64),
    )  # fmt: skip


@njit(cache=True, nogil=True)
def advance(cars, block, size, u, y):
    """Steps all cars by a sample; tells whether the block is full and its means are to be used."""
    if block.samples[0] == size:
        block.samples[0] = 0
        block.mean[:] = 0.0
        block.measured[:] = 0.0
        block.number[:] = 0.0
    step_all(cars, u, block.out)
    for i in range(cars.size):
        for j in range(NY):
            block.mean[i, j] += block.out[i, j]
    for j in range(NY):
        if not np.isnan(y[j]):
            block.measured[j] += y[j]
            block.number[j] += 1.0
    block.samples[0] += 1
    if block.samples[0] < size:
        return False
    for j in range(NY):
        block.mean[:, j] /= size
        block.measured[j] = block.measured[j] / block.number[j] if block.number[j] else np.nan
    return True


@njit(cache=True, nogil=True)
def kalman_step(z, covariance, h, r, variance, step_limit):
    """A Kalman step, Joseph's form with the gain really used.

    Args:
        z: (q,) estimates, changed in place.
        covariance: (q, q) of them, changed in place.
        h: (ny, q) derivatives of the outputs.
        r: (ny,) innovations.
        variance: (ny,) of their noise.
        step_limit: (q,) the most that an estimate may move: where one would move further, the
            gain of all is less.
    """
    hp = h @ covariance
    s = hp @ h.T + np.diag(variance)
    gain = np.ascontiguousarray(np.linalg.solve(s, hp).T)
    move = gain @ r
    share = 1.0
    for i in range(z.size):
        if share * abs(move[i]) > step_limit[i]:
            share = step_limit[i] / abs(move[i])
    gain *= share
    rest = np.eye(z.size) - gain @ h
    covariance[:] = rest @ covariance @ rest.T + (gain * variance) @ gain.T
    z += share * move


@njit(cache=True, nogil=True)
def move_states(car, dx, roll):
    """Adds a change of the states (nx,) but for position, heading and wheel angles.

    These have no influence. The change of the pitch angle becomes a small turn about the axes of a
    body that leans by an angle of roll [rad].
    """
    dx[X.x] = dx[X.y] = 0.0
    pitch = dx[X.pitch]
    dx[X.pitch], dx[X.yaw] = np.cos(roll) * pitch, -np.sin(roll) * pitch
    dx[ANGLES:AFTER_ANGLES] = 0.0
    correct(car, dx)


@njit(cache=True, nogil=True)
def follow_speed(cars, means, measured, number, share, least_spin):
    """Draws each car's speed by a share to the measured wheel speeds.

    Speed and wheels change alike, so that no tyre slips by it: the accelerometers do not see it,
    and their information on the mass remains.

    Args:
        cars: of the ensemble.
        means: (n, ny) of the cars' outputs over a block.
        measured: (ny,) means of the measurements.
        number: (ny,) of measurements.
        share: of the difference; zero: none is followed.
        least_spin: of a car that moves [rad/s].
    """
    if share == 0.0:
        return
    x, dx = np.zeros(NX), np.zeros(NX)
    for i in range(cars.size):
        late, spin, n = 0.0, 0.0, 0
        for j in range(FIRST_WHEEL, AFTER_WHEELS):
            if number[j] > 0.0:
                late += measured[j] - means[i, j]
                spin += means[i, j]
                n += 1
        if n == 0 or spin < n * least_spin:
            continue
        read_states(cars[i], x)
        dx[VX] = share * late / spin * x[VX]
        for k in range(FIRST_SPIN, AFTER_SPINS):
            dx[k] = share * late / spin * x[k]
        correct(cars[i], dx)


@njit(cache=True, nogil=True)
def are_sound(cars):
    """Whether none of the cars has blown up."""
    sound = True
    for i in range(cars.size):
        sound = sound and is_sound(cars[i])
    return sound


@njit(cache=True, nogil=True)
def step_all(cars, u, out):
    """Steps all cars under inputs u (nu,); fills their outputs (n, ny) before it."""
    for i in range(cars.size):
        step(cars[i], u, out[i])
