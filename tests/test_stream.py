import dataclasses

import numpy as np
import pytest

from estimators.til.default_observer import default_observer
from estimators.til.observer import Observer
from estimators.til.stream import LONGEST_GAP, SET_BACK, Stream, between, rolling_radius
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import record
from twin import INPUTS, OUTPUTS, Twin, TwinError, Vehicle, with_noise

VEHICLE = Vehicle.load("suv")


@pytest.fixture(scope="module")
def drive():
    """Seconds 3 to 8 of the drive through town, while the car speeds up."""
    clean = record(Vehicle.load("suv_loaded"), urban(duration=8.0))
    noisy = with_noise(clean, 20.0, np.random.default_rng(5))
    return noisy.replace(
        time=noisy.time[3000:], inputs=noisy.inputs[3000:], measurements=noisy.measurements[3000:],
        truth={name: values[3000:] for name, values in noisy.truth.items()},
    )  # fmt: skip


@pytest.fixture
def stream():
    default = default_observer(VEHICLE, set(OUTPUTS))
    return Stream(default.observer, default.rolling_radius)


def feed(stream, drive, samples):
    return [stream.update(drive.time[k], drive.inputs[k], drive.measurements[k]) for k in samples]


def mass(found):
    return np.array([sample.parameters[0] for sample in found if sample])


def test_stream_of_every_sample_is_the_run_over_the_drive(stream, drive):
    found = feed(stream, drive, range(1500))
    observer = default_observer(VEHICLE, set(OUTPUTS)).observer
    observer.reset(stream._measured_speed(drive.measurements[0]))
    part = {name: getattr(drive, name)[:1500] for name in ("time", "inputs", "measurements")}
    estimate = observer.run(drive.replace(**part, truth={}))
    np.testing.assert_array_equal(mass(found), estimate["mass"])
    np.testing.assert_allclose([s.time for s in found], drive.time[:1500])
    assert [s.trustworthy for s in found] == estimate.trustworthy.tolist()


def test_irregular_samples_are_brought_to_the_twins_step(stream, drive):
    rng = np.random.default_rng(0)
    kept = np.flatnonzero(rng.random(5000) < 0.1)
    found = feed(stream, drive, kept)
    assert stream.counts["taken"] == kept.size
    assert stream.counts["restarts"] == 0
    assert np.diff([s.time for s in found if s]).min() > 0.9e-3
    speed = found[-1].states[stream.observer.twin.states.index("vx")]
    assert speed == pytest.approx(drive.truth["vx"][kept[-1]], abs=0.05)
    assert abs(mass(found)[-1] - 355.0) < 150.0


def test_late_and_repeated_samples_are_dropped_and_counted(stream, drive):
    order = [*range(500), 200, 499, *range(500, 1000)]
    found = feed(stream, drive, order)
    assert [found[500], found[501]] == [None, None]
    assert stream.counts["late"] == 2
    other = default_observer(VEHICLE, set(OUTPUTS))
    plain = feed(Stream(other.observer, other.rolling_radius), drive, range(1000))
    np.testing.assert_array_equal(mass(found), mass(plain))


def test_time_that_is_no_number_is_dropped(stream, drive):
    feed(stream, drive, range(10))
    assert stream.update(np.nan, drive.inputs[10], drive.measurements[10]) is None
    assert stream.counts["untimed"] == 1


def test_clock_that_was_set_back_begins_a_new_time(stream, drive):
    feed(stream, drive, range(1500))
    known = stream.observer.memory.p[0]
    found = feed(stream, drive, range(500, 1000))
    assert stream.counts["late"] == SET_BACK - 1
    assert stream.counts["set_back"] == 1
    assert found[SET_BACK - 1].parameters[0] == pytest.approx(known, abs=1.0)
    assert found[-1].time == pytest.approx(drive.time[999])


@pytest.mark.parametrize("seconds", [0.6, 2.0])
def test_gap_is_bridged_or_restarted_and_flagged(stream, drive, seconds):
    feed(stream, drive, range(0, 2000, 2))
    before = stream.observer.memory.p[0]
    after = 2000 + round(1e3 * seconds)
    found = feed(stream, drive, range(after, 5000, 2))
    assert stream.counts["restarts"] == (seconds > LONGEST_GAP)
    assert stream.counts["gaps"] == (seconds <= LONGEST_GAP)
    assert not found[0].trustworthy
    if seconds > LONGEST_GAP:
        assert found[0].parameters[0] == pytest.approx(before, abs=1.0)
        assert stream.observer.parameter_sd()["mass"] < 100.0
    vx = found[-1].states[stream.observer.twin.states.index("vx")]
    assert vx == pytest.approx(drive.truth["vx"][4998], abs=0.1)
    assert np.isfinite(mass(found)).all()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_input_that_is_no_number_is_held_and_flagged(stream, drive, value):
    feed(stream, drive, range(500))
    bad = drive.inputs[500].copy()
    bad[INPUTS.index("drive_torque_fl")] = value
    found = stream.update(drive.time[500], bad, drive.measurements[500])
    assert stream.counts["held"] == 1
    assert not found.trustworthy
    assert stream._u[1] == drive.inputs[499, 1]


def test_input_out_of_range_is_one_line(stream, drive):
    feed(stream, drive, range(10))
    bad = drive.inputs[10].copy()
    bad[0] = 400.0
    with pytest.raises(TwinError, match=r"steering_wheel_angle is \S+ in sample 0; allowed: -15"):
        stream.update(drive.time[10], bad, drive.measurements[10])


def test_stream_waits_for_a_speed_to_start_at(stream, drive):
    blind = np.full(len(OUTPUTS), np.nan)
    assert stream.update(0.0, drive.inputs[0], blind) is None
    assert stream.counts["incomplete"] == 1
    assert stream.update(0.1, drive.inputs[0], blind, speed=7.0) is not None


def test_snapshot_goes_on_to_the_bit(stream, drive, tmp_path):
    feed(stream, drive, range(500))
    stream.save(tmp_path / "state.npz")
    found = feed(stream, drive, range(500, 1000))
    default = default_observer(VEHICLE, set(OUTPUTS))
    other = Stream(default.observer, default.rolling_radius)
    other.restore(tmp_path / "state.npz")
    again = feed(other, drive, range(500, 1000))
    np.testing.assert_array_equal(mass(again), mass(found))
    np.testing.assert_array_equal(again[-1].states, found[-1].states)
    assert other.counts == stream.counts
    assert [path.name for path in tmp_path.iterdir()] == ["state.npz"]


def test_snapshot_of_another_vehicle_or_observer_is_refused(stream, tmp_path):
    path = tmp_path / "state.npz"
    stream.save(path)
    heavier = dataclasses.replace(VEHICLE, scales=(("spring", 1.1),))
    for vehicle, names in ((heavier, set(OUTPUTS)), (VEHICLE, set(OUTPUTS) - {"yaw_rate"})):
        default = default_observer(vehicle, names)
        with pytest.raises(TwinError, match="snapshot of another vehicle or observer"):
            Stream(default.observer, default.rolling_radius).restore(path)


@pytest.mark.parametrize("content", [b"", b"PK\3\4nonsense", None])
def test_broken_snapshot_is_one_line_and_changes_nothing(stream, drive, tmp_path, content):
    path = tmp_path / "state.npz"
    stream.save(path)
    path.write_bytes(path.read_bytes()[:-500] if content is None else content)
    feed(stream, drive, range(50))
    before = stream.observer.twin.read_states()
    with pytest.raises(TwinError, match=r"state\.npz: is no snapshot") as caught:
        stream.restore(path)
    assert "\n" not in str(caught.value)
    np.testing.assert_array_equal(stream.observer.twin.read_states(), before)


def test_between_is_linear_and_holds_across_gaps():
    time = np.array([0.0, 0.1, 0.6])
    inputs, measured = np.array([[0.0], [1.0], [5.0]]), np.array([[0.0], [2.0], [9.0]])
    at = np.array([0.0, 0.05, 0.1, 0.3, 0.6])
    u, y = between(at, time, inputs, measured, 1e-6)
    np.testing.assert_allclose(u[:, 0], [0.0, 0.5, 1.0, 1.0, 5.0])
    np.testing.assert_allclose(y[:, 0], [0.0, 1.0, 2.0, np.nan, 9.0])


def test_rolling_radius_is_a_little_less_than_the_tyres():
    assert 0.34 < rolling_radius(Observer(Twin(VEHICLE), [])) < 0.38
