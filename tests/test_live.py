"""The observer on a bus: frames in, estimates out."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import can
import cantools
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import models
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import record
from scenarios.live.align import Aligner
from scenarios.live.estimator import LiveEstimator
from scenarios.live.messages import DATABASE, EstimateMessages
from scenarios.live.replay import Replay, disturb, frames_of
from scenarios.live.replay import run as replay
from scenarios.live.run import Live, run
from scenarios.live.signals import BusSignals
from twin import Drive, TwinError, Vehicle, with_noise
from twin.logs.can_signals import Database
from twin.logs.map import LogMap

ROOT = Path(__file__).parents[1]
MAP = models.path("can/suv.toml")
LOAD = 355.0  # [kg] of the loaded SUV


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Half a minute through town with a load."""
    drive = record(Vehicle.load("suv_loaded"), urban(duration=30.0))
    path = tmp_path_factory.mktemp("drive") / "drive.parquet"
    with_noise(drive, 20.0, np.random.default_rng(0)).save(path)
    return path


@pytest.fixture(scope="module")
def estimator():
    return LiveEstimator(Vehicle.load("suv"), _signals())


def _signals(log_map=None):
    log_map = log_map or LogMap.load(MAP)
    database = Database.load(models.path("can/suv.dbc"))
    return BusSignals(log_map, database, Vehicle.load("suv"))


def _lines(texts):
    lines = [json.loads(text) for text in texts]
    return [line for line in lines if "time" in line], lines[-1]


# --- alignment


def _aligned(points, names=("a", "b"), **settings):
    aligner = Aligner(names, 0.01, **settings)
    found = []
    for name, time_, value in points:
        aligner.add(name, time_, value)
        found += list(aligner.samples())
    return aligner, found


def test_signals_of_other_phase_are_linear_between_their_points():
    points = sorted(
        [("a", 0.01 * k, 1.0 * k) for k in range(50)]
        + [("b", 0.01 * k + 0.004, 2.0 * k) for k in range(50)],
        key=lambda p: p[1],
    )
    aligner, found = _aligned(points)
    assert aligner.late == 0
    assert len(found) > 40
    for at, values, age in found[2:]:
        assert values["a"] == pytest.approx(100.0 * at)
        assert values["b"] == pytest.approx(200.0 * (at - 0.004))
        assert age == 0.0


def test_a_late_signal_is_waited_for_so_long_and_not_longer():
    points = [("a", 0.01 * k, 1.0) for k in range(100)]
    points.insert(1, ("b", 0.001, 5.0))
    aligner, found = _aligned(points, lateness=0.03)
    assert aligner.late > 0
    waits = [at for at, _, _ in found]
    assert np.diff(waits) == pytest.approx(0.01)
    # b is held while it may still come back, and unknown thereafter
    assert found[3][1]["b"] == 5.0
    assert "b" not in found[-1][1]


def test_a_fast_signal_is_averaged_over_a_sample():
    points = [("a", 0.001 * k, float(k % 2)) for k in range(500)]
    _, found = _aligned(points, names=("a",))
    assert np.array([values["a"] for _, values, _ in found[1:]]) == pytest.approx(0.5, abs=0.06)


@given(st.lists(st.tuples(st.sampled_from("ab"), st.floats(), st.floats(-1e3, 1e3)), max_size=60))
@settings(max_examples=100, deadline=None)
def test_times_of_any_kind_neither_stop_nor_flood_the_samples(points):
    _, found = _aligned(points)
    assert len(found) <= 60 * len(points)


# --- estimates as messages


def test_messages_tell_the_estimate_again():
    database = cantools.database.load_file(str(DATABASE))
    values = {"mass": 2481.0, "load": 355.0, "mass_sd": 7.0, "mass_valid": True, "sideslip": -0.02,
              "vx": 20.0, "fz_rr": 5100.0, "fx_rr": -1e9, "age_of_mass": None}  # fmt: skip
    found = {}
    for identifier, data in EstimateMessages().encoded(values):
        found |= database.decode_message(identifier, data)
    assert found["mass"] == 2481.0
    assert found["load"] == 355.0
    assert found["mass_valid"] == 1
    assert found["sideslip_valid"] == 0
    assert found["sideslip"] == pytest.approx(-0.02)
    assert found["fz_rr"] == 5100.0
    assert found["fx_rr"] == -65536.0  # the least that it can carry
    assert found["age_of_mass"] == 0.0


def test_identifiers_of_the_car_are_not_sent_again():
    with pytest.raises(TwinError, match="identifier 0x6a1"):
        EstimateMessages([256, 0x6A1])


# --- frames that nobody should send


frames = st.builds(
    can.Message,
    timestamp=st.floats(0.0, 30.0),
    arbitration_id=st.one_of(st.integers(256, 261), st.integers(0, 0x7FF)),
    is_extended_id=st.just(False),
    is_error_frame=st.booleans(),
    data=st.binary(max_size=8),
    check=st.just(False),
)


@given(st.lists(frames, max_size=100))
@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_hostile_frames_are_counted_and_give_no_nan(estimator, frames):
    signals = _signals()
    aligner = Aligner(signals.names, 0.01)
    at = 100.0
    for frame in frames:
        at += abs(frame.timestamp) * 1e-3
        signals.take(frame, at, aligner)
        for time_, values, age in aligner.samples():
            u, y, speed = signals.sample(values)
            found = estimator.update(time_, u, y, speed, age)
            if found is not None:
                numbers = [v for v in found.values() if isinstance(v, float)]
                assert np.isfinite(numbers).all()
                EstimateMessages().encoded(found)
    assert sum(signals.counts.values()) >= len(frames)


def test_extreme_values_on_the_bus_are_bridged(estimator):
    rng = np.random.default_rng(0)
    signals = _signals()
    aligner = Aligner(signals.names, 0.01)
    for k in range(6000):
        data = rng.integers(0, 256, 8, dtype=np.uint8).tobytes()
        frame = can.Message(arbitration_id=256 + k % 6, is_extended_id=False, data=data)
        signals.take(frame, 500.0 + k / 600.0, aligner)
        for time_, values, age in aligner.samples():
            found = estimator.update(time_, *signals.sample(values), age)
            if found is not None:
                assert np.isfinite([v for v in found.values() if isinstance(v, float)]).all()
    assert signals.counts["implausible"] > 0


def test_signal_that_the_database_has_not_is_one_line(tmp_path):
    text = MAP.read_text().replace("Imu.ax", "Imu.axe")
    (tmp_path / "map.toml").write_text(text)
    with pytest.raises(TwinError, match=r"channels\.ax\.name is 'Imu\.axe'"):
        _signals(LogMap.load(tmp_path / "map.toml"))


# --- on a bus


def test_drive_becomes_frames_and_the_same_drive_again(log):
    drive = Drive.load(log)
    frames = frames_of(Replay(log=log, interface="virtual", channel="", map=MAP))
    database = cantools.database.load_file(str(models.path("can/suv.dbc")))
    found = [
        (at, database.decode_message(identifier, data)["ax"])
        for at, identifier, data in frames
        if identifier == 256
    ]
    at, ax = np.array(found).T
    assert ax == pytest.approx(np.interp(at, drive.time, drive.channel("ax")), abs=1.1e-3)
    assert len(frames) == pytest.approx(6 * 3000, abs=6)


def test_jitter_and_lost_frames_leave_the_mass_alone(log):
    """By the frames' own times: no clock of the machine has a part in it."""
    task = Replay(log=log, interface="virtual", channel="", map=MAP)
    found = {}
    for name, disturbed in (("clean", {}), ("rough", {"jitter": 0.002, "loss": 0.01})):
        estimator, signals = LiveEstimator(Vehicle.load("suv"), _signals()), _signals()
        aligner = Aligner(signals.names, 0.01)
        for at, identifier, data in disturb(frames_of(task), replace(task, **disturbed)):
            frame = can.Message(arbitration_id=identifier, is_extended_id=False, data=data)
            signals.take(frame, at, aligner)
            for time_, values, age in aligner.samples():
                found[name] = estimator.update(time_, *signals.sample(values), age) or found.get(
                    name
                )
    assert abs(found["clean"]["load"] - LOAD) < 40.0
    assert abs(found["rough"]["load"] - found["clean"]["load"]) < 20.0
    assert found["rough"]["mass_valid"]


def test_replayed_drive_is_observed_on_the_bus_and_kept(log, tmp_path):
    state, written, said = tmp_path / "til.state", [], []
    sent = []
    listener = can.Bus(interface="virtual", channel="test_live")
    live = Live(
        interface="virtual", channel="test_live", vehicle="suv", map=MAP, speed=5.0, idle=1.0,
        send=True, state=state,
    )  # fmt: skip
    task = Replay(
        log=log, interface="virtual", channel="test_live", map=MAP, speed=5.0, jitter=0.002,
        loss=0.01,
    )  # fmt: skip

    def say(text):
        said.append(text)
        if text.startswith("listens"):
            threading.Thread(target=replay, args=(task, lambda _: None), daemon=True).start()

    run(live, written.append, say)
    while (frame := listener.recv(0.0)) is not None:
        if frame.arbitration_id == 0x6A1 and any(frame.data):  # zeros: of the silent bus
            sent.append(frame.data)
    listener.shutdown()
    estimates, total = _lines(written)
    assert len(estimates) > 2500
    last = estimates[-1]
    assert total["total"]["estimates"] == len(estimates) == len(sent)
    database = cantools.database.load_file(str(DATABASE))
    assert database.decode_message(0x6A1, sent[-1])["load"] == pytest.approx(last["load"], abs=1)
    assert any('"health"' in text for text in written)
    assert any("silent" in text for text in said)
    # the next ignition goes on with what was learnt
    other = LiveEstimator(Vehicle.load("suv"), _signals())
    assert "goes on" in other.resume(state)
    fresh = other.stream.observer.parameter_sd()["mass"]
    assert last["mass_sd"] <= fresh < last["mass_sd"] + 5.0
    assert other.stream.observer.memory.p[0] == pytest.approx(last["load"], abs=1e-3)
    # and what is a day old counts less
    past = time.time() - 86400.0
    os.utime(state, (past, past))
    other.resume(state)
    assert other.stream.observer.parameter_sd()["mass"] > 75.0


def test_state_of_another_car_is_refused(estimator, tmp_path):
    estimator.stream.observer.reset(0.0)
    estimator.stream.save(tmp_path / "til.state")
    other = LiveEstimator(Vehicle.load("sports_car"), _signals())
    with pytest.raises(TwinError, match="another vehicle"):
        other.resume(tmp_path / "til.state")


BUS = ("--interface", "udp_multicast", "--channel", "239.74.163.2")


def test_one_process_drives_the_other(log, tmp_path):
    port = f"port={20000 + os.getpid() % 20000}"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    program = (sys.executable, "-m", "scenarios")
    common = (*BUS, "--bus-option", port, "--map", str(MAP))
    observer = subprocess.Popen(
        [*program, "live", *common, "--vehicle", "suv", "--speed", "4", "--state", "til.state",
         "--out", "out.jsonl"],
        cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        for line in observer.stderr:
            if "listens" in line or "cannot be opened" in line:
                break
        if "cannot be opened" in line:
            pytest.skip("this machine has no multicast")
        done = subprocess.run(
            [*program, "replay", str(log), *common, "--speed", "4"],
            cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        time.sleep(0.3)
        observer.send_signal(signal.SIGINT)
        _, err = observer.communicate(timeout=30)
    finally:
        observer.kill()
    assert observer.returncode == 0, err
    estimates, _ = _lines((tmp_path / "out.jsonl").read_text().splitlines())
    assert len(estimates) > 2500
    assert (tmp_path / "til.state").is_file()
