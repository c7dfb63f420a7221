import numpy as np
import pytest
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

import twin
from estimators.joint.observer import JointEstimate
from estimators.joint.sensor_errors import SENSOR_ERROR, SENSOR_ERRORS
from scenarios.timeline import timeline
from scenarios.timeline.inertia import uniform_ellipsoid
from scenarios.timeline.joint import write_joint_timeline

RATE = 1000  # [Hz]
ESTIMATED = (*twin.LOAD, *twin.SCALES, *SENSOR_ERRORS)
P = len(ESTIMATED) - len(SENSOR_ERRORS)
NOMINAL = np.array(
    [
        *(2125.0, -0.1, 0.0, 0.05, 800.0, 3600.0, 3900.0, 0.0, 0.0, 0.0),
        *(1.0 for _ in twin.SCALES),
        *(0.0 for _ in twin.FORCES),
    ]
)
DELTA = np.array([200.0, -0.05, 0.01, 0.02, 60.0, 250.0, 300.0, *(5.0,) * 3])
FOUND_AT = (1.0, 1.5)  # [s]: known, and a change of the load


def make(seconds):
    """A drive straight ahead and an estimate of it that wanders about the truth."""
    n = seconds * RATE
    rng = np.random.default_rng(5)
    time = np.arange(n) / RATE
    truth = {name: np.zeros(n) for name in twin.STATES} | {"x": 20.0 * time}
    load = NOMINAL[:10] + DELTA
    truth |= {name: np.full(n, value) for name, value in zip(twin.LOAD, load, strict=True)}
    truth |= {name: np.ones(n) for name in twin.SCALES}
    for wheel in twin.WHEELS:
        truth |= {f"fx_{wheel}": time, f"fy_{wheel}": time, f"fz_{wheel}": 5e3 + time}
    drive = twin.Drive(
        time=time,
        inputs=np.zeros((n, len(twin.INPUTS))),
        input_names=twin.INPUTS,
        measurements=np.zeros((n, len(twin.OUTPUTS))),
        output_names=twin.OUTPUTS,
        truth=truth,
        settings={},
    )
    prior = np.array(
        [
            *(twin.PARAMETER[x].prior_sd for x in ESTIMATED[:P]),
            *(e.prior_sd for e in SENSOR_ERROR.values()),
        ]
    )
    sd = prior * np.exp(0.01 * rng.standard_normal((n, prior.size)))
    parameters = np.zeros((n, len(twin.PARAMETERS)))
    parameters[:, :10] = DELTA
    parameters[:, :P] += 0.1 * prior[:P] * rng.standard_normal((n, P))
    estimate = JointEstimate(
        time=time,
        states=np.zeros((n, len(twin.STATES))),
        parameters=parameters,
        outputs=np.zeros((n, len(twin.OUTPUTS))),
        extended=np.zeros((n, len(twin.EXTENDED))),
        nominal=NOMINAL,
        estimated=ESTIMATED,
        sensor_error_names=SENSOR_ERRORS,
        prior=prior,
        sd=sd,
        valid=np.repeat((time >= FOUND_AT[0])[:, None], prior.size, axis=1),
        changes=(time >= FOUND_AT[1]).astype(np.int64),
        sensor_errors=0.1 * prior[P:] * rng.standard_normal((n, prior.size - P)),
        covariance=np.diag(sd[-1] ** 2),
        information=np.diag(sd[-1] ** -2.0),
    )
    return drive, estimate


def write(path, drive, estimate):
    write_joint_timeline(
        path,
        vehicle=twin.Vehicle.load("suv"),
        drive=drive,
        estimate=estimate,
        faults={"delay": 0.02},
        title="joint: test",
    )
    return path


@pytest.fixture(scope="module")
def run():
    return make(2)


@pytest.fixture(scope="module")
def rows(tmp_path_factory, run):
    """Columns over time by entity."""
    path = write(tmp_path_factory.mktemp("timeline") / "run.rrd", *run)
    (store,) = RrdReader(path).recordings()
    found = {}
    for chunk in RrdReader(path).stream(store=store).to_chunks():
        if not chunk.is_static:
            batch = chunk.to_record_batch()
            found[str(chunk.entity_path)] = {
                name: batch.column(name).to_pylist() for name in batch.schema.names
            }
    return found


def seconds(columns):
    return [time.total_seconds() for time in columns["time"]]


@pytest.mark.parametrize("entity", ["load/mass", "load/Jyz", "model/spring", "sensors/imu_z"])
def test_estimate_stands_in_a_band_of_two_standard_deviations(rows, run, entity):
    _, estimate = run
    drawn = np.array(rows[f"/{entity}/estimate"]["Scalars:scalars"])
    i = ESTIMATED.index(entity.split("/")[1])
    samples = timeline.thinned(estimate.time, 100.0)
    values = np.column_stack([estimate.parameters[:, :P], estimate.sensor_errors])[samples, i]
    np.testing.assert_allclose(drawn[:, 2], values)
    sd = estimate.sd[samples, i]
    np.testing.assert_allclose(drawn[:, :2] - values[:, None], np.outer(sd, (2.0, -2.0)))


def test_truth_is_the_change_from_nominal_and_of_sensors_what_is_given(rows):
    assert rows["/load/mass/truth"]["Scalars:scalars"] == [[200.0], [200.0]]
    assert rows["/model/drag/truth"]["Scalars:scalars"] == [[0.0], [0.0]]
    assert rows["/sensors/delay/truth"]["Scalars:scalars"] == [[0.02], [0.02]]
    assert "/sensors/imu_x/truth" not in rows


@pytest.mark.parametrize("name", ESTIMATED)
def test_each_estimate_is_not_known_and_then_known(rows, name):
    lane = rows[f"/known/{name}"]
    assert lane["StateChange:state"] == [["not known"], ["known"]]
    assert seconds(lane) == pytest.approx([0.0, FOUND_AT[0]])


def test_change_of_the_load_is_a_state_and_a_mark_on_the_estimates(rows, run):
    lane = rows["/known/changes_of_load"]
    assert lane["StateChange:state"] == [["load 1"], ["load 2"]]
    assert seconds(lane) == pytest.approx([0.0, FOUND_AT[1]])
    mark = rows["/load/mass/change"]
    assert seconds(mark) == pytest.approx([FOUND_AT[1]])
    at = round(FOUND_AT[1] * RATE)
    assert mark["Scalars:scalars"] == [[pytest.approx(run[1]["mass"][at])]]


def test_ellipsoids_stand_at_the_cm_of_estimate_and_truth(rows, run):
    drive, estimate = run
    shown = timeline.frames(drive.time)
    place = {
        "estimate": NOMINAL[1:4] + estimate.parameters[shown, 1:4],
        "truth": np.tile(NOMINAL[1:4] + DELTA[1:4], (len(shown), 1)),
    }
    for name, expected in place.items():
        entity = f"/world/chassis/inertia/{name}"
        arrow = rows[f"{entity}/cm"]
        tip = np.add(arrow["Arrows3D:origins"], arrow["Arrows3D:vectors"])[:, 0]
        np.testing.assert_allclose(tip, expected, atol=1e-6)
        centres = np.array(rows[entity]["Ellipsoids3D:centers"])[:, 0]
        np.testing.assert_allclose(centres, expected, atol=1e-6)


def test_a_uniform_ellipsoid_is_found_from_its_mass_and_inertia():
    axes, mass = np.array([2.0, 1.1, 0.7]), 1800.0
    moments = mass / 5.0 * ((axes**2).sum() - axes**2)
    turn = np.linalg.qr(np.random.default_rng(6).standard_normal((3, 3)))[0]
    inertia = turn @ np.diag(moments) @ turn.T
    load = [mass, 0.0, 0.0, 0.0, *np.diag(inertia), *inertia[[0, 0, 1], [1, 2, 2]]]
    found, quaternions = uniform_ellipsoid(np.array([load]))
    np.testing.assert_allclose(np.sort(found[0])[::-1], axes)
    # The directions turn the ellipsoid's inertia back into the body's
    directions = Rotation.from_quat(quaternions[0], scalar_first=True).as_matrix()
    own = mass / 5.0 * ((found**2).sum() - found[0] ** 2)
    np.testing.assert_allclose(directions @ np.diag(own) @ directions.T, inertia, rtol=1e-9)


def test_an_inertia_that_no_body_has_gives_a_flat_ellipsoid():
    load = np.array([[1000.0, 0.0, 0.0, 0.0, 100.0, 100.0, 900.0, 0.0, 0.0, 0.0]])
    assert uniform_ellipsoid(load)[0].min() == 0.0


def test_a_minute_at_1_khz_stays_below_12_mb(tmp_path):
    """Of noise, which does not compress; two minutes stay below 25 MB."""
    assert write(tmp_path / "long.rrd", *make(60)).stat().st_size < 12e6
