"""Speed of the closed loop, as ratios measured side by side in one run."""

import threading
import time
from collections.abc import Callable

import mujoco
import numpy as np

from estimators.joint.observer import JointObserver, JointSettings
from estimators.til.observer import Observer
from scenarios import mass
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import record
from scenarios.experiment.progress import progress
from scenarios.experiment.result import Result, Row
from twin import LOAD, Drive, Twin, Vehicle, with_noise

BLOCK = 5.0  # [s] of driving per measurement of what is compared
PAIRS = 30
SUSTAINED = 60.0  # [s] of driving
SAMPLES = 20000  # of the one-sample update


def run() -> Result:
    """All measurements; each compared pair is interleaved."""
    start = time.perf_counter()
    drive = with_noise(
        record(Vehicle.load("suv_loaded"), urban(duration=SUSTAINED)),
        10.0,
        np.random.default_rng(0),
    )
    rows = [
        _row("closed_loop_ratio", "1", _closed_loop_ratio(_part(drive, 10.0, BLOCK))),
        _row("real_time_factor", "1", _real_time_factor(drive)),
        _row(
            "joint_realtime_factor",
            "1",
            _joint_real_time_factor(_part(drive, 10.0, BLOCK), LOAD[:7]),
        ),
        _row(
            "joint_default_realtime_factor", "1", _joint_real_time_factor(_part(drive, 10.0, BLOCK))
        ),
        _row("step_latency_p999_us", "us", _latency(drive)),
        _row("thread_speedup_2", "1", _thread_speedup(_part(drive, 10.0, BLOCK))),
    ]
    return Result(name="bench", settings={}, seconds=time.perf_counter() - start, rows=rows)


def _row(name: str, unit: str, values: list[float]) -> Row:
    return Row.over_seeds(
        values, case="SUV at 1 ms", quantity=name, metric="speed", unit=unit, estimator="til"
    )


def _part(drive: Drive, start: float, duration: float) -> Drive:
    part = slice(round(start / drive.dt), round((start + duration) / drive.dt))
    return drive.replace(
        time=drive.time[part],
        inputs=drive.inputs[part],
        measurements=drive.measurements[part],
        truth={"vx": drive.truth["vx"][part]},
    )


def _observer() -> Observer:
    return Observer(Twin(Vehicle.load("suv")), mass.EXPERIMENT.estimators["til"].laws)


def _seconds(task: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    start = clock()
    task()
    return clock() - start


def _closed_loop_ratio(drive: Drive) -> list[float]:
    """Step, tyres, law and log, over a bare Python loop of mj_step on the same model.

    Both in processor time of this thread, which what else the machine does disturbs least.
    """
    observer, speed = _observer(), float(drive.truth["vx"][0])
    bare = Twin(Vehicle.load("suv"))
    step, model, data = mujoco.mj_step, bare.model, bare.data

    def loop() -> None:
        for _ in range(len(drive)):
            step(model, data)

    ratios = []
    observer.run(drive)
    for _ in progress(range(PAIRS), "closed loop"):
        observer.reset(speed)
        bare.reset(speed)
        data.qfrc_applied[:] = 0.0
        closed = _seconds(lambda: observer.run(drive), time.thread_time)
        ratios.append(closed / _seconds(loop, time.thread_time))
    return ratios


def _real_time_factor(drive: Drive) -> list[float]:
    """Seconds of driving observed per second of wall time."""
    observer = _observer()
    factors = []
    for _ in progress(range(3), "real time"):
        observer.reset(0.0)
        factors.append((len(drive) * drive.dt) / _seconds(lambda: observer.run(drive)))
    return factors


def _joint_real_time_factor(
    drive: Drive, parameters: tuple[str, ...] = JointSettings().parameters
) -> list[float]:
    """The same of the joint observer: one twin more than it estimates parameters, on one core."""
    sd = [drive.settings["noise_sd"][name] for name in drive.output_names]
    observer = JointObserver(Vehicle.load("suv"), sd, JointSettings(parameters=parameters))
    factors = []
    for _ in progress(range(4), "joint"):
        observer.reset(float(drive.truth["vx"][0]))
        factors.append((len(drive) * drive.dt) / _seconds(lambda: observer.run(drive)))
    return factors[1:]


def _latency(drive: Drive) -> list[float]:
    """99.9th percentile of the one-sample update's time [us]."""
    observer = _observer()
    observer.reset(0.0)
    times = np.empty(SAMPLES)
    for k in progress(range(SAMPLES), "latency"):
        u, y = drive.inputs[k], drive.measurements[k]
        start = time.perf_counter()
        observer.update(u, y)
        times[k] = time.perf_counter() - start
    return [float(np.percentile(times[1:], 99.9)) * 1e6]


def _thread_speedup(drive: Drive) -> list[float]:
    """Two observers one after the other, over the same two in two threads."""
    observers = [_observer(), _observer()]
    speed = float(drive.truth["vx"][0])

    def both() -> None:
        threads = [threading.Thread(target=o.run, args=(drive,)) for o in observers]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def one_by_one() -> None:
        for observer in observers:
            observer.run(drive)

    ratios = []
    one_by_one()
    for _ in progress(range(PAIRS), "threads"):
        for observer in observers:
            observer.reset(speed)
        alone = _seconds(one_by_one)
        for observer in observers:
            observer.reset(speed)
        ratios.append(alone / _seconds(both))
    return ratios
