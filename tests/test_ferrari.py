import os

import numpy as np
import pytest

from scenarios import ferrari
from scenarios.__main__ import main
from scenarios.calibration import ferrari_log
from scenarios.driving.manoeuvres import swept_steer
from scenarios.driving.record import record
from scenarios.experiment import engine
from scenarios.experiment.engine import draw, estimate_on, run_experiment, runs
from scenarios.logs.free_parameters import FREE, GAINS
from twin import Twin, TwinError, Vehicle

HAS_LOG = bool(os.environ.get(ferrari_log.VARIABLE))
needs_log = pytest.mark.skipif(
    not HAS_LOG, reason=f"the log is not shipped; {ferrari_log.VARIABLE} names its folder"
)


def write(folder, **changes):
    """Six seconds of the project's own car, written as the log is."""
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    manoeuvre = swept_steer(0.002, 6.0, speed=25.0, amplitude=0.05, highest=1.0, sweep=6.0)
    drive = record(Vehicle.load(ferrari.VEHICLE), manoeuvre)
    columns = {
        "t": drive.time + 287.0,
        **{"vx": drive.truth["vx"], "vy": drive.truth["vy"], "delta": drive.inputs[:, 0]},
        "yawRate": drive.channel("yaw_rate"),
        **{"axCG": drive.channel("ax"), "ayCG": drive.channel("ay")},
        "beta_true": drive.truth["sideslip"],
    }
    rows = {name: values[::5].copy() for name, values in columns.items()} | changes
    path = folder / ferrari_log.FILE
    pq.write_table(pa.table({k: v for k, v in rows.items() if v is not None}), path)
    return path, rows


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    return write(tmp_path_factory.mktemp("log"))


def test_wheels_carry_the_car_of_the_log():
    """982 kg, centre of mass 1.33 m behind the front axle of a wheelbase of 2.40 m."""
    twin = Twin(Vehicle.load(ferrari.VEHICLE))
    twin.reset(0.0)
    front, _, rear, _ = twin.tyre_forces()[:, 2] / 9.81
    assert 2.0 * (front + rear) == pytest.approx(982.0, abs=0.5)
    assert front / (front + rear) == pytest.approx(1.07 / 2.40, abs=2e-3)
    assert twin.car.wheelbase == pytest.approx(2.40)
    assert twin.car.track == pytest.approx(1.35)


def test_two_milliseconds_are_fine_enough(tmp_path):
    """At half the step the sideslip of a swerve at 0.9 g is the same within a hundredth of it."""
    source = Vehicle.load(ferrari.VEHICLE).source
    text = source.read_text()
    assert 'timestep="0.002"' in text
    fine = tmp_path / "fine.xml"
    fine.write_text(text.replace('timestep="0.002"', 'timestep="0.001"'))
    sideslip = []
    for dt, vehicle in ((0.002, Vehicle.load(source)), (0.001, Vehicle.load(fine))):
        manoeuvre = swept_steer(dt, 4.0, speed=25.0, amplitude=0.045, highest=1.0)
        drive = record(vehicle, manoeuvre)
        assert np.abs(drive.channel("ay")).max() > 8.0
        sideslip.append(drive.truth["sideslip"][:: round(0.01 / dt)])
    difference = np.abs(sideslip[0] - sideslip[1]).max()
    assert difference < 0.01 * np.abs(sideslip[1]).max()


def test_log_becomes_a_drive_without_torques(own):
    path, rows = own
    drive = ferrari.log_of(path)
    assert drive.dt == pytest.approx(0.002)
    assert not any("torque" in name for name in drive.input_names)
    np.testing.assert_allclose(drive.channel("yaw_rate")[::5], rows["yawRate"], atol=1e-12)
    assert (
        "wheel_speed_fl" not in drive.output_names
        or np.isnan(drive.channel("wheel_speed_fl")).all()
    )


def test_spikes_of_the_steering_go(own, tmp_path):
    _, rows = own
    spiked = rows["delta"].copy()
    spiked[100:500:100] = 1.0  # beyond any steering
    spiked[150:500:100] += 0.1  # and within it
    path, _ = write(tmp_path, delta=spiked)
    clean = ferrari.log_of(own[0]).channel("steering_wheel_angle")
    steering = ferrari.log_of(path).channel("steering_wheel_angle")
    np.testing.assert_allclose(steering, clean, atol=2e-3)


def test_truth_is_no_measurement(own):
    drive = ferrari.log_of(own[0])
    assert set(drive.truth) == {"sideslip"}
    assert not set(drive.truth) & set(drive.output_names)


def test_estimates_do_not_see_the_truth(own, monkeypatch):
    """With another truth over the last third every estimate over it stays the same."""
    monkeypatch.setattr(ferrari, "BICYCLE_FREE", ("front_stiffness",))  # a short log tells one
    drive = ferrari.log_of(own[0])
    last = ferrari_log.part(drive, ferrari.SCORED_ON)
    other = {name: values.copy() for name, values in drive.truth.items()}
    for values in other.values():
        values[last] = 7.0
    for run in runs(ferrari.EXPERIMENT, [0]):
        name = run.estimator
        seen, unseen = (
            estimate_on(run, one).estimate.sideslip for one in (drive, drive.replace(truth=other))
        )
        np.testing.assert_array_equal(seen[last], unseen[last], err_msg=name)


def test_parts_share_the_log(own):
    drive = ferrari.log_of(own[0])
    known, scored = (ferrari_log.part(drive, name) for name in ferrari_log.PARTS)
    assert (known.start, known.stop, scored.stop) == (0, scored.start, len(drive))
    assert known.stop == pytest.approx(2 * len(drive) / 3, abs=1)


def test_scenario_scores_every_estimator_and_draws(own, tmp_path, monkeypatch):
    monkeypatch.setenv(ferrari_log.VARIABLE, str(own[0].parent))
    monkeypatch.setattr(ferrari, "_log", lambda file: ferrari.log_of(own[0]))
    monkeypatch.setattr(ferrari, "BICYCLE_FREE", ("front_stiffness",))
    result = run_experiment(ferrari.EXPERIMENT, seeds=[0, 1])
    assert {row.seeds for row in result.rows} == {1}
    rmse = [row for row in result.rows if row.metric == "rmse"]
    found = {(row.case, row.estimator): row.median for row in rmse}
    assert {estimator for _, estimator in found} == set(ferrari.RECIPES)
    coverage = [row.median for row in result.rows if row.metric == "coverage"]
    assert coverage
    assert all(0.0 <= share <= 1.0 for share in coverage)
    assert found["last third", "static-map"] < found["last third", "zero"]
    draw(ferrari.EXPERIMENT, tmp_path / "ferrari.png", seed=0)
    assert (tmp_path / "ferrari.png").stat().st_size > 10_000


def test_calibration_that_ships_lies_within_its_bounds():
    values = ferrari.calibrated().values
    assert set(GAINS) & set(values)
    assert not ferrari.calibrated().scheduled
    for name, value in values.items():
        assert FREE[name].low <= value <= FREE[name].high, name


@pytest.mark.parametrize("folder", [None, "nowhere"])
def test_missing_log_is_one_line(folder, monkeypatch, capsys):
    monkeypatch.setattr(engine, "_DONE", {})
    monkeypatch.delenv(ferrari_log.VARIABLE, raising=False)
    if folder:
        monkeypatch.setenv(ferrari_log.VARIABLE, folder)
    assert main(["run", "ferrari"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("til: ferrari: ")
    assert error.count("\n") == 1
    assert ferrari_log.VARIABLE in error


def test_file_that_is_no_such_log_is_refused(tmp_path):
    path, _ = write(tmp_path, ayCG=None)
    with pytest.raises(TwinError, match="ayCG"):
        ferrari.log_of(path)
    path.write_text("nonsense")
    with pytest.raises(TwinError, match="Parquet"):
        ferrari.log_of(path)


@pytest.mark.parametrize(
    ("changes", "message"), [({"snr": 10.0}, "snr"), ({"duration": 9.0}, "duration")]
)
def test_setting_that_a_log_has_not_is_refused(changes, message):
    with pytest.raises(TwinError, match=message):
        run_experiment(ferrari.EXPERIMENT, seeds=[0], **changes)


@needs_log
@pytest.mark.slow
def test_twin_knows_the_sideslip_of_the_last_third_within_a_quarter_of_a_degree():
    found = {
        row.estimator: row.median
        for row in run_experiment(ferrari.EXPERIMENT, seeds=[0]).rows
        if row.case == "last third" and row.metric == "rmse"
    }
    assert found["til"] <= 0.24
    assert found["til"] < min(value for name, value in found.items() if name != "til")
