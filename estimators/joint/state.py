"""What the compiled joint observer works on."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.joint.sensor_errors import E
from twin import IMU as IMU_OUTPUTS
from twin import OUTPUTS, SPINS, STATES, WHEEL_SPEEDS, X, Y

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

NY, NX = len(OUTPUTS), len(STATES)
IMU = IMU_OUTPUTS.stop
FIRST_WHEEL, AFTER_WHEELS = WHEEL_SPEEDS.start, WHEEL_SPEEDS.stop
FIRST_SPIN, AFTER_SPINS = SPINS.start, SPINS.stop
ROLL, VX = X.roll, X.vx
ROLL_RATE = Y.roll_rate
EXCITING = np.array([Y.ax, Y.ay, Y.roll_rate, Y.pitch_rate])
ABSENT = 1e12  # variance of a channel that has no measurement
# Slower wheels than this [rad/s], 1 m/s, are not used: the instant of a stop is a jump
LEAST_SPIN = 3.0
STANDING = 0.5  # and slower than this the car stands [rad/s]; chosen
# Blocks: left to look for a change of the load; of exciting driving so far; left to wait
WATCH, DRIVEN, WAIT = 0, 1, 2
SAMPLES, BLOCKS, TOTAL = 0, 1, 2  # what the clock counts: of the block, blocks, of all
DELAY, POSITION, SPEED = E.delay, E.imu_x, E.speed
RING = 64  # samples: the longest delay
LARGEST_INFLATION = 1e3  # of one window
WINDOW = 16  # blocks over which innovations are summed to see whether they are white


class Configuration(NamedTuple):
    """What does not change: p parameters, q estimates (parameters, then sensor errors)."""

    parameter: Indices  # (p,) of each among the twin's
    step: Array  # (p,) by which its twin is off
    sensor_error: Indices  # (q - p,) of `SENSOR_ERRORS`: channel of a bias, DELAY, ...
    tracking_time: float  # of the twins behind the estimates [s]
    curvature: float  # of the sensitivities, per prior variance
    speed_curvature: float  # the same of the speed's
    slip_range: float  # share of a wheel's speed
    impact: float  # least jump of sensitivities that is one, of the noise's variance
    impact_wait: float  # after one [s]
    step_limit: Array  # (q,) the most an estimate may move in a block
    drift: Array  # (q,) variance per second
    noise: Array  # (ny,) variance of a sample's noise; NaN: the channel is not used
    nominal: Array  # (np,) the unloaded chassis
    block: int  # samples
    segment: int  # blocks of used driving
    hold_off: int  # blocks before the first correction
    speed_gain: float  # of the twins' speeds [1/s]
    least_excitation: float  # [m2/s4]
    rate_weight: float  # of a roll or pitch rate in it [m2/s2]
    excitation_time: float  # over which the motion's variance is taken [s]
    inflation_time: float  # over which the innovations' whiteness is judged [s]
    prior: Array  # (q,) standard deviations
    load: Indices  # (l,) estimates that a change of the load changes
    watch: int  # blocks of driving after a standstill in which such a change is looked for
    settle: int  # blocks of driving before the first
    change_time: float  # over which what contradicts is summed [s]
    # least statistic of a change: chi-square of l degrees of freedom if there is none
    detection_threshold: float
    least_change: float  # and least change of any of them, of its prior sd
    dt: float  # of a sample [s]


class State(NamedTuple):
    """What the observer keeps from sample to sample, beside its twins."""

    theta: Array  # (np,) parameters of twin 0
    estimate: Array  # (np,) parameters estimated
    z: Array  # (q,) estimates
    covariance: Array  # (q, q)
    out: Array  # (n, ny) the twins' last outputs
    total: Array  # (n, ny) their sum over the block
    measured: Array  # (ny,) the measurements' sum
    present: Array  # (ny,) how many there were
    states: Array  # (n, nx)
    dx: Array  # (nx,)
    p: Array  # (np,) what is set
    rate: Array  # (p,) at which the twins move, times the tracking time
    went: Array  # (p,) what they moved recently
    usual: Array  # (ny, p) mean squares of the sensitivities
    last_h: Array  # (ny, q) sensitivities of the block before
    excitation: Array  # (2, 4) means and squares of what excites
    information: Array  # (q, q) of what was used
    ring: Array  # (RING, n, ny) the twins' last outputs
    late: Array  # (n, ny) the twins' outputs of the delay ago
    edge: Array  # (ny,) of twin 0 at the end of the block before
    inflation: Array  # (ny,) factor of each channel's variance that its innovations show
    window: Array  # (3, ny) sums of innovations, of their variance; number of blocks
    window_h: Array  # (ny, q) sums of sensitivities
    recent: Array  # (q, q) information of the last seconds
    score: Array  # (q,) and what it says of the parameters' error
    kept: Array  # (q,) estimates at the last standstill
    kept_covariance: Array  # (q, q)
    kept_inflation: Array  # (ny,)
    blocks: Indices  # (3,)
    changes: Indices  # (1,) of the load, so far
    clock: Indices  # (3,)
    widening: Array  # (1,) factor of the covariance for errors of the model; 0: not yet known
    # see `estimators.joint.evidence`
    segment_information: Array  # (K, ny, q, q) upper triangles
    segment_score: Array  # (K, ny, q)
    scale_information: Array  # (scales, ny, q, q) upper triangles
    scale_score: Array  # (scales, ny, q)
    scale_square: Array  # (scales, ny, 2) and the number of windows
    window_sums: Array  # (scales, ny, 2 + q) of measurements, variances, sensitivities
    prior_mean: Array  # (q,) estimates before the evidence
    prior_covariance: Array  # (q, q)
    evidence: Indices  # (4,) counts


class Log(NamedTuple):
    """Histories of N samples, to be filled."""

    states: Array  # (N, nx)
    parameters: Array  # (N, np)
    outputs: Array  # (N, ny)
    extended: Array  # (N, 4, 9)
    sd: Array  # (N, q)
    sensor_errors: Array  # (N, q - p)
    changes: Indices  # (N,)
    segments: Indices  # (N,) of used driving so far, not more than are kept
