import dataclasses
import resource
import signal
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from rerun.chunk import RrdReader

import twin
from estimators.base import Estimate
from estimators.ensemble.staged import Stage, StagedEstimate
from scenarios.timeline import scene as timeline_3d
from scenarios.timeline import timeline
from scenarios.timeline.timeline import view, write_timeline

SAMPLES = 2000
ROAD = (0.05, 0.01, -0.02, 0.03)


@pytest.fixture(scope="module")
def vehicle():
    load = twin.PointMass(name="boot", mass=200.0, position=np.array([-2.0, 0.0, 0.1]))
    return twin.Vehicle.load("suv").with_loads([load])


def make_drive(**changes):
    """Two seconds at 1 kHz of a car that slides along a curve; what it does obeys no physics."""
    rng = np.random.default_rng(1)
    time = np.arange(SAMPLES) * 1e-3
    truth = {name: 0.01 * rng.standard_normal(SAMPLES) for name in twin.STATES}
    truth |= {"x": 20.0 * time, "y": time**2, "z": np.full(SAMPLES, 0.64), "ax": np.sin(time)}
    truth |= {"mass": np.full(SAMPLES, 2325.0)}
    for wheel in twin.WHEELS:
        truth |= {f"fx_{wheel}": time, f"fy_{wheel}": time, f"fz_{wheel}": 5e3 + time}
    content = {
        "time": time,
        "inputs": np.zeros((SAMPLES, len(twin.INPUTS))),
        "input_names": twin.INPUTS,
        "measurements": rng.standard_normal((SAMPLES, len(twin.OUTPUTS))),
        "output_names": twin.OUTPUTS,
        "truth": truth,
        "settings": {
            "scenario": "mass",
            "snr": 10.0,
            "seats": ["front", "rear"],
            "versions": {"mujoco": "4.0.0"},
        },
    }
    return twin.Drive(**(content | changes))


def make_estimate(**changes):
    rng = np.random.default_rng(2)
    content = {
        "time": np.arange(SAMPLES) * 1e-3,
        "states": 0.01 * rng.standard_normal((SAMPLES, len(twin.STATES))),
        "parameters": rng.standard_normal((SAMPLES, len(twin.PARAMETERS))),
        "outputs": rng.standard_normal((SAMPLES, len(twin.OUTPUTS))),
        "extended": np.zeros((SAMPLES, len(twin.EXTENDED))),
        "nominal": np.array([2125.0, *(0.0,) * 3, 800.0, 3600.0, 3900.0, *(0.0,) * 3, *(1.0,) * 5]),
    }
    return Estimate(**(content | changes))


def write(path, vehicle, **changes):
    content = {
        "vehicle": vehicle,
        "drive": make_drive(),
        "estimate": make_estimate(),
        "parameters": ["mass"],
        "title": "mass: test",
    }
    write_timeline(path, **(content | changes))
    return path


def chunks(path, store=None):
    """Every chunk of a recording or blueprint: (entity, is static, columns by their name)."""
    for chunk in RrdReader(path).stream(store=store).to_chunks():
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if name != "log_time"]
        columns = {name: batch.column(name).to_pylist() for name in names}
        yield str(chunk.entity_path), chunk.is_static, columns


def temporal(path):
    return {entity: columns for entity, static, columns in chunks(path) if not static}


def column(path, entity, name):
    """(n, ...) values of one component over time."""
    return np.array([row[0] for row in temporal(path)[entity][name]])


@pytest.fixture(scope="module")
def rrd(tmp_path_factory, vehicle):
    return write(tmp_path_factory.mktemp("timeline") / "run.rrd", vehicle)


def test_entities_hold_the_plots_and_the_car(rrd):
    bodies = {"chassis", "boot", *(f"wheel_{wheel}" for wheel in twin.WHEELS)}
    assert set(temporal(rrd)) == {
        *(f"/parameters/mass/{name}" for name in ("estimate", "truth", "upper", "lower")),
        *(f"/signals/ax/{name}" for name in ("measured", "vehicle", "twin")),
        *("/speed/vehicle", "/speed/twin", "/world/tyre_forces"),
        *(f"/world/{body}" for body in bodies),
    }


def test_plots_have_at_most_100_samples_a_second_and_poses_30(rrd):
    rows = {entity: len(columns["time"]) for entity, columns in temporal(rrd).items()}
    # Two seconds, and the last sample
    assert {n for entity, n in rows.items() if not entity.startswith("/world")} == {201}
    assert {n for entity, n in rows.items() if entity.startswith("/world")} == {61}


def test_a_slow_log_keeps_every_sample():
    np.testing.assert_array_equal(timeline.thinned(np.arange(50) * 0.02, 100.0), np.arange(50))


def test_samples_of_an_unsteady_log_keep_the_rate_and_both_ends():
    time = np.cumsum(np.random.default_rng(3).uniform(1e-4, 3e-3, 5000))
    samples = timeline.thinned(time, 100.0)
    assert (samples[0], samples[-1]) == (0, 4999)
    assert len(samples) <= np.ceil((time[-1] - time[0]) * 100.0) + 1
    assert np.diff(time[samples]).max() < 0.02


def test_band_is_a_tenth_of_the_variation_around_the_truth(rrd):
    def value(name):
        return column(rrd, f"/parameters/mass/{name}", "Scalars:scalars")

    np.testing.assert_allclose(value("truth"), 200.0)
    np.testing.assert_allclose(value("upper"), 220.0)
    np.testing.assert_allclose(value("lower"), 180.0)
    samples = timeline.thinned(make_drive().time, 100.0)
    np.testing.assert_array_equal(value("estimate"), make_estimate()["mass"][samples])


def test_series_are_named(rrd):
    names = {e: c["SeriesLines:names"][0][0] for e, _, c in chunks(rrd) if "SeriesLines:names" in c}
    assert names["/signals/ax/vehicle"] == "vehicle, without noise"
    assert names["/parameters/mass/upper"] == "+10% of the variation"


def test_blueprint_has_one_view_for_each_plot_and_an_eye_that_follows_the_car(rrd):
    (blueprint,) = RrdReader(rrd).blueprints()
    contents = [columns for _, _, columns in chunks(rrd, blueprint)]
    origins = [
        c["ViewBlueprint:space_origin"][0][0] for c in contents if "ViewBlueprint:space_origin" in c
    ]
    assert sorted(o.strip("/") for o in origins) == [
        "parameters/mass",
        "signals/ax",
        "speed",
        "world",
    ]
    (eye,) = [c for c in contents if "EyeControls3D:tracking_entity" in c]
    drawn = {entity for entity, _, columns in chunks(rrd) if "Boxes3D:half_sizes" in columns}
    assert "/" + eye["EyeControls3D:tracking_entity"][0][0].strip("/") in drawn


def test_settings_and_versions_are_properties(rrd):
    properties = {e.removeprefix("/__properties"): c for e, _, c in chunks(rrd) if "__prop" in e}
    assert properties["/drive"]["scenario"] == [["mass"]]
    assert properties["/drive"]["snr"] == [[10.0]]
    assert properties["/drive"]["seats"] == [['["front", "rear"]']]
    assert properties["/versions"]["mujoco"] == [["4.0.0"]]


def test_title_names_the_recording(rrd):
    names = [c["RecordingInfo:name"] for _, _, c in chunks(rrd) if "RecordingInfo:name" in c]
    assert names == [[["mass: test"]]]


def test_car_stands_where_the_truth_says(rrd):
    drive = make_drive()
    samples = timeline.thinned(drive.time, 30.0)
    truth = np.stack([drive.truth[name][samples] for name in "xyz"], axis=1)
    np.testing.assert_allclose(
        column(rrd, "/world/chassis", "Transform3D:translation"), truth, atol=1e-5
    )


def test_a_log_without_truth_shows_the_twin(tmp_path, vehicle):
    path = write(tmp_path / "log.rrd", vehicle, drive=make_drive(truth={}, settings={}))
    entities = set(temporal(path))
    assert {e for e in entities if not e.startswith("/world")} == {
        *("/parameters/mass/estimate", "/signals/ax/measured", "/signals/ax/twin", "/speed/twin"),
    }
    assert "/world/tyre_forces" not in entities
    states = make_estimate().states[timeline.thinned(make_drive().time, 30.0)]
    np.testing.assert_allclose(
        column(path, "/world/chassis", "Transform3D:translation"), states[:, :3], atol=1e-6
    )


def test_states_that_the_truth_lacks_come_from_the_twin():
    truth = make_drive().truth | {"wheel_angle_fl": np.full(SAMPLES, np.nan)}
    frames = np.array([0, 7])
    moved = timeline_3d.motion(make_drive(truth=truth), make_estimate(), frames)
    angle = twin.STATES.index("wheel_angle_fl")
    np.testing.assert_array_equal(moved.states[:, angle], make_estimate().states[frames, angle])
    np.testing.assert_array_equal(moved.states[:, 0], truth["x"][frames])


@pytest.fixture(scope="module")
def driven(vehicle):
    """A twin in a bend on an uneven road, and the motion at its last step."""
    car = twin.Twin(vehicle)
    car.reset(15.0, road=ROAD)
    u = np.array([1.5, *[100.0] * 4, *[0.0] * 4, *ROAD])
    for _ in range(400):
        states = car.read_states()
        car.step(u)
    moved = timeline_3d.Motion(
        time=np.zeros(1),
        states=states[None],
        steering=u[:1],
        road=u[None, 9:],
        forces=car.tyre_forces()[None, :, :3],
    )
    return car, moved


def test_bodies_stand_where_the_twin_has_them(driven, vehicle):
    car, moved = driven
    placed = timeline_3d.poses(vehicle.compile(), moved)
    # xpos after a step are those of the state before it
    np.testing.assert_allclose(placed.positions[0], car.data.xpos, atol=1e-9)
    sign = np.sign(np.sum(placed.quaternions[0] * car.data.xquat, axis=1, keepdims=True))
    np.testing.assert_allclose(sign * placed.quaternions[0], car.data.xquat, atol=1e-9)


def test_tyre_forces_are_those_that_the_twin_applies(driven, vehicle):
    car, moved = driven
    placed = timeline_3d.poses(vehicle.compile(), moved)
    points, axes = timeline_3d.contacts(placed, moved.road)
    forces = np.einsum("wi,wij->wj", moved.forces[0], axes[0])
    moments = np.einsum("wi,wij->wj", car.tyre_forces()[:, 3:6], axes[0])
    chassis = car.model.body("chassis").id
    drag = -0.5 * 1.2 * car.car.drag_area * moved.states[0, twin.STATES.index("vx")] ** 2
    ahead = car.data.xmat[chassis].reshape(3, 3)[:, 0]

    expected = np.zeros(car.model.nv)
    for body, *wrench in zip(placed.wheels, forces, moments, points[0], strict=True):
        mujoco.mj_applyFT(car.model, car.data, *wrench, body, expected)
    origin = car.data.xpos[chassis]
    mujoco.mj_applyFT(car.model, car.data, drag * ahead, np.zeros(3), origin, chassis, expected)
    compared = [*range(6), *car.car.travel_dof]  # motors and brakes turn the wheels as well
    np.testing.assert_allclose(
        car.data.qfrc_applied[compared], expected[compared], rtol=1e-3, atol=5.0
    )


def test_force_arrows_are_a_metre_for_5_kn_from_the_road(rrd):
    arrows = temporal(rrd)["/world/tyre_forces"]
    vectors, origins = (
        np.array(arrows[f"Arrows3D:{name}"], dtype=float) for name in ("vectors", "origins")
    )
    assert vectors.shape == origins.shape == (61, 4, 3)
    np.testing.assert_allclose(vectors[..., 2], 1.0, rtol=1e-3)
    np.testing.assert_allclose(origins[..., 2], 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"parameters": ["weight"]},
            r"run.rrd: parameter 'weight' is unknown; allowed: mass, cm_x",
        ),
        ({"estimate": make_estimate(time=np.arange(3.0))}, r"has 3 samples.* 2000"),
    ],
)
def test_a_mistake_is_named_and_leaves_no_file(tmp_path, vehicle, changes, message):
    with pytest.raises(twin.TwinError, match=message):
        write(tmp_path / "run.rrd", vehicle, **changes)
    assert not list(tmp_path.iterdir())


def test_another_ending_is_refused(tmp_path, vehicle):
    with pytest.raises(twin.TwinError, match=r"run.json: .* '.json'; allowed: '.rrd'"):
        write(tmp_path / "run.json", vehicle)


def test_a_missing_folder_is_one_line(tmp_path, vehicle):
    with pytest.raises(
        twin.TwinError, match=r"run.rrd: cannot be written: .*No such file"
    ) as error:
        write(tmp_path / "nowhere" / "run.rrd", vehicle)
    assert "\n" not in str(error.value)


def test_a_full_disk_is_told_and_keeps_the_old_file(tmp_path, vehicle):
    path = write(tmp_path / "run.rrd", vehicle)
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) - 10_000, limits[1]))
    try:
        with pytest.raises(twin.TwinError, match=r"run.rrd: cannot be written"):
            write(path, vehicle)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("missing", [1, 30, 5000])
def test_a_file_without_its_end_is_noticed(tmp_path, rrd, missing):
    path = tmp_path / "cut.rrd"
    path.write_bytes(rrd.read_bytes()[:-missing])
    with pytest.raises(OSError, match="end is missing"):
        timeline._check_whole(path)


def test_two_minutes_at_1_khz_stay_below_15_mb(tmp_path, vehicle):
    samples = 120_000
    rng = np.random.default_rng(4)
    drive, estimate = make_drive(), make_estimate()
    repeats = samples // SAMPLES
    time = np.arange(samples) * 1e-3
    truth = {name: rng.standard_normal(samples) for name in drive.truth}
    drive = drive.replace(
        time=time,
        inputs=np.tile(drive.inputs, (repeats, 1)),
        measurements=rng.standard_normal((samples, len(twin.OUTPUTS))),
        truth=truth,
    )
    estimate = dataclasses.replace(
        estimate,
        time=time,
        **{
            name: rng.standard_normal((samples, getattr(estimate, name).shape[1]))
            for name in ("states", "parameters", "outputs")
        },
    )
    parameters = twin.PARAMETERS[:20]  # as many as an estimator finds at a time
    path = write(
        tmp_path / "run.rrd", vehicle, drive=drive, estimate=estimate, parameters=parameters
    )
    assert path.stat().st_size < 15e6


def test_every_parameter_can_be_drawn(tmp_path, vehicle):
    path = write(tmp_path / "run.rrd", vehicle, parameters=twin.PARAMETERS)
    drawn = {entity.split("/")[2] for entity in temporal(path) if entity.startswith("/parameters/")}
    assert drawn == set(twin.PARAMETERS)


def test_importing_the_timeline_leaves_rerun_alone():
    code = "import sys, scenarios.timeline.timeline; sys.exit('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_viewer_is_reachable_from_this_machine_only(monkeypatch):
    commands = []

    def run(command, **_):
        commands.append(command)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(subprocess, "run", run)
    view("run.rrd")
    (command,) = commands
    assert command[command.index("--bind") + 1] == "127.0.0.1"


def test_a_viewer_that_gives_up_is_told(monkeypatch):
    monkeypatch.setattr(subprocess, "run", lambda c, **_: subprocess.CompletedProcess(c, 1))
    with pytest.raises(twin.TwinError, match=r"run.rrd: the Rerun viewer gave up \(status 1\)"):
        view("run.rrd")


def test_stages_of_a_staged_observer_are_drawn(tmp_path, vehicle):
    plain = make_estimate()
    stage = np.repeat(list(Stage), SAMPLES // len(Stage))
    staged = StagedEstimate(
        **{field.name: getattr(plain, field.name) for field in dataclasses.fields(plain)}
        | {"stage": stage, "estimated": ("mass",), "sd": np.ones((SAMPLES, 1))},
    )
    without = write(tmp_path / "without.rrd", vehicle)
    path = write(tmp_path / "with.rrd", vehicle, estimate=staged)
    assert "/stage/stage" in {entity for entity, *_ in chunks(path)}
    assert "/stage/stage" not in {entity for entity, *_ in chunks(without)}


def test_sideslip_of_a_log_has_its_band_truth_error_and_trust(tmp_path, vehicle):
    slip, sd = np.linspace(-0.1, 0.1, SAMPLES), np.full(SAMPLES, 0.01)
    trusted = np.arange(SAMPLES) < SAMPLES // 2
    estimate = make_estimate(
        outputs=np.column_stack([make_estimate().outputs, slip]),
        output_names=(*twin.OUTPUTS, "sideslip"),
        sideslip_sd=sd,
        trustworthy=trusted,
        trust_reason=np.where(trusted, 0, 1).astype(np.uint8),
        reasons=("", "the yaw rate does not agree"),
    )
    drive = make_drive(truth={"sideslip": slip + 0.005}, settings={"log": "drive.csv"})
    path = write(tmp_path / "log.rrd", vehicle, estimate=estimate, drive=drive, parameters=[])
    values = {
        name: column(path, f"/{name}", "Scalars:scalars").ravel()
        for name in ("sideslip/upper", "sideslip/lower", "sideslip/truth", "sideslip_error/error")
    }
    band = values["sideslip/upper"] - values["sideslip/lower"]
    np.testing.assert_allclose(band, np.degrees(0.04), rtol=1e-6)
    np.testing.assert_allclose(values["sideslip_error/error"], -np.degrees(0.005), rtol=1e-6)
    states = [row[0] for row in temporal(path)["/trust"]["StateChange:state"]]
    assert states == ["trustworthy", "the yaw rate does not agree"]
