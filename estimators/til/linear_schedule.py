"""A twin's planar dynamics, linearised by differences at a grid of speeds and accelerations.

The twin stays a black box: it is driven round an ever tighter bend at each speed, and wherever its
lateral acceleration passes a level it is started again from there with one number changed. What the
change has become after `HORIZON`, when the tyres have built up their forces and before the driver
could answer, makes the linear model of lateral speed and yaw rate under lateral forces on the axles
(TiL's extended variables, Eqs. 2-3):

    x' = A x,  x = (v_y, r, F_front, F_rear),    (a_y, F_y of the tyres in front and behind) = C x.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from twin import EXTENDED, INPUTS, OUTPUTS, PARAMETERS, STATES, Twin, TwinError, U
from twin.kernel import correct, is_sound, read_states, step

Array = NDArray[np.float64]

SPEEDS = (3.0, 5.0, 8.0, 12.0, 17.0, 24.0, 34.0, 48.0, 65.0)  # [m/s]; chosen: some 1.4 each
LEVELS = (0.0, 2.0, 4.0, 6.0, 7.5, 9.0, 10.0, 11.0, 12.0, 13.0)  # [m/s2] of lateral acceleration
HORIZON = 0.05  # [s]: some relaxation lengths, and short against the yaw mode; chosen
BEND = 5.0  # [s] until the steering is at its end
SHARPEST = 0.5  # [rad] of the road wheels
MOST = 15.0  # [m/s2], what the steering is meant for at the end, an understeering car aside
UNDERSTEER = 0.12  # [rad] that the steering has in store for it
ROLLED_OVER = 0.6  # [rad]; beyond it there is nothing to linearise
CHANGES = np.array([0.05, 0.01, 200.0, 200.0])  # of x: [m/s], [rad/s], [N], [N]; chosen

VY, YAW_RATE = STATES.index("vy"), STATES.index("yaw_rate")
FORCES = PARAMETERS.index("axle_force_front"), PARAMETERS.index("axle_force_rear")
NX, NY = 4, 3
_VX, _ROLL = STATES.index("vx"), STATES.index("roll")
_AY = OUTPUTS.index("ay")
_FY = EXTENDED.index("fy_fl")
_STRIDE = EXTENDED.index("fy_fr") - _FY


class LinearSchedule(NamedTuple):
    """Linear models at a grid; a level that a car does not reach has the model of the last one."""

    speeds: Array  # (n,) [m/s], rising
    levels: Array  # (m,) of |a_y| [m/s2], rising
    dt: float  # [s], of the transitions
    transition: Array  # (n, m, 4, 4) of x over dt
    outputs: Array  # (n, m, 3, 4) of a_y and the axles' tyre forces


NO_SCHEDULE = LinearSchedule(
    np.array([0.0, 1.0]),
    np.array([0.0, 1.0]),
    0.0,
    np.zeros((2, 2, NX, NX)),
    np.zeros((2, 2, NY, NX)),
)


def linear_schedule(
    twin: Twin,
    dt: float,
    speeds: tuple[float, ...] = SPEEDS,
    levels: tuple[float, ...] = LEVELS,
) -> LinearSchedule:
    """The schedule of a twin, which is left somewhere, with its parameters.

    Args:
        twin: the black box.
        dt: of the transitions [s].
        speeds: of the grid [m/s], rising.
        levels: of the grid, lateral acceleration [m/s2], rising from 0.

    Raises:
        TwinError: the car does not settle on its wheels.
    """
    transitions = np.empty((len(speeds), len(levels), NX, NX))
    outputs = np.empty((len(speeds), len(levels), NY, NX))
    nominal = twin.car.parameters.copy()
    for i, speed in enumerate(speeds):
        twin.reset(speed)
        known, time = None, np.zeros(1)
        for j, level in enumerate(levels):
            if _bend(twin.car, speed, level, time):
                known = _differences(twin, speed, time[0], nominal)
            if known is None:
                raise TwinError(f"schedule: the car cannot drive straight on at {speed:g} m/s")
            grown, felt = known
            transitions[i, j] = _over(grown, dt / HORIZON)
            outputs[i, j] = felt @ np.linalg.inv(grown)
    twin.set_parameters(nominal)
    return LinearSchedule(np.array(speeds), np.array(levels), dt, transitions, outputs)


def _differences(twin: Twin, speed: float, time: float, nominal: Array) -> tuple[Array, Array]:
    """What a change of x becomes over the horizon, (4, 4), and of the outputs, (3, 4)."""
    here = twin.snapshot()
    ends = []
    for change in (np.zeros(NX), *np.diag(CHANGES)):
        twin.restore(here)
        dx, p = np.zeros(len(STATES)), nominal.copy()
        dx[[VY, YAW_RATE]] = change[:2]
        p[list(FORCES)] += change[2:]
        twin.correct(dx)
        twin.set_parameters(p)
        end = np.empty(2 + NY)
        _end(twin.car, speed, time, end)
        ends.append(end)
    twin.restore(here)
    slopes = (np.array(ends[1:]) - ends[0]).T / CHANGES
    grown = np.eye(NX)
    grown[:2] = slopes[:2]
    return grown, slopes[2:]


def _over(grown: Array, share: float) -> Array:
    """The transition (4, 4) over a share of the horizon; forces are held over it."""
    free, forced = grown[:2, :2], grown[:2, 2:]
    values, vectors = np.linalg.eig(free.astype(np.complex128))
    part = np.real(vectors @ np.diag(values**share) @ np.linalg.inv(vectors))
    transition = np.eye(NX)
    transition[:2, :2] = part
    transition[:2, 2:] = (part - np.eye(2)) @ np.linalg.solve(free - np.eye(2), forced)
    return transition


@njit(cache=True, nogil=True)
def _steering(car, speed, time):
    """Of the hand wheel: grows evenly to what the sharpest bend asks for."""
    sharpest = min(math.atan(car.wheelbase * MOST / speed**2) + UNDERSTEER, SHARPEST)
    return car.steering_ratio * sharpest * min(time / BEND, 1.0)


@njit(cache=True, nogil=True)
def _advance(car, speed, time, u, y, x, dx):
    """One step at a speed that is held from outside."""
    u[U.steering_wheel_angle] = _steering(car, speed, time)
    step(car, u, y)
    read_states(car, x)
    dx[_VX] = speed - x[_VX]
    correct(car, dx)


@njit(cache=True, nogil=True)
def _bend(car, speed, level, time):
    """Drives on until the lateral acceleration reaches the level; whether it did."""
    u, y = np.zeros(len(INPUTS)), np.zeros(len(OUTPUTS))
    x, dx = np.zeros(len(STATES)), np.zeros(len(STATES))
    while time[0] < BEND:
        _advance(car, speed, time[0], u, y, x, dx)
        time[0] += car.dt
        if not is_sound(car) or abs(x[_ROLL]) > ROLLED_OVER:
            time[0] = BEND
            return False
        if y[_AY] >= level:
            return True
    return False


@njit(cache=True, nogil=True)
def _end(car, speed, time, end):
    """Lateral speed, yaw rate and outputs at the end of the horizon, the steering held."""
    u, y = np.zeros(len(INPUTS)), np.zeros(len(OUTPUTS))
    x, dx = np.zeros(len(STATES)), np.zeros(len(STATES))
    for _ in range(int(HORIZON / car.dt + 0.5)):
        _advance(car, speed, time, u, y, x, dx)
    end[0], end[1] = x[VY], x[YAW_RATE]
    step(car, u, y)
    tyres = car.tyre_output
    end[2] = y[_AY]
    end[3] = tyres[0, 1] + tyres[1, 1]
    end[4] = tyres[2, 1] + tyres[3, 1]


@njit(cache=True, nogil=True)
def _place(grid, value):
    """Index below and share of the next."""
    i = 0
    while i < grid.size - 2 and grid[i + 1] < value:
        i += 1
    share = (value - grid[i]) / (grid[i + 1] - grid[i])
    return i, min(max(share, 0.0), 1.0)


@njit(cache=True, nogil=True)
def look_up(schedule, speed, level, transition, outputs):
    """The linear model between those of the grid.

    Args:
        schedule: a `LinearSchedule`.
        speed: [m/s].
        level: of the lateral acceleration, without its sign [m/s2].
        transition: (4, 4) receives the transition.
        outputs: (3, 4) receives the outputs.
    """
    i, a = _place(schedule.speeds, speed)
    j, b = _place(schedule.levels, level)
    for s in range(2):
        for t in range(2):
            weight = (a if s else 1.0 - a) * (b if t else 1.0 - b)
            first = s == 0 and t == 0
            for m in range(NX):
                for n in range(NX):
                    old = 0.0 if first else transition[m, n]
                    transition[m, n] = old + weight * schedule.transition[i + s, j + t, m, n]
            for m in range(NY):
                for n in range(NX):
                    old = 0.0 if first else outputs[m, n]
                    outputs[m, n] = old + weight * schedule.outputs[i + s, j + t, m, n]
