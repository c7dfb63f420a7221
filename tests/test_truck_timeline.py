from dataclasses import replace

import numpy as np
import pytest
from rerun.chunk import RrdReader

from scenarios import truck
from scenarios.experiment.engine import first_trials
from scenarios.timeline.truck import write_truck_timeline
from twin import TwinError
from twin.truck.parameters import SprungMass


@pytest.fixture(scope="module")
def trial():
    return first_trials(truck.EXPERIMENT, 0, duration=1.0, estimators=["kalman-bucy"])[0]


@pytest.fixture(scope="module")
def drive(trial):
    return trial.drive


@pytest.fixture(scope="module")
def found(trial):
    return trial.estimate


@pytest.fixture(scope="module")
def other(found):
    return replace(found, parameters=found.parameters + 1.0)


def read(path):
    """Columns of each entity: over time, and static."""
    moving, static = {}, {}
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        columns = {name: batch.column(name).to_pylist() for name in batch.schema.names}
        into = static if chunk.is_static else moving
        into.setdefault(str(chunk.entity_path), {}).update(columns)
    return moving, static


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, drive, found, other):
    path = tmp_path_factory.mktemp("truck") / "truck.rrd"
    write_truck_timeline(
        path, drive=drive, estimates={"filter": found, "til": other}, title="truck"
    )
    return read(path)


def values(recorded, entity):
    return np.array([row[0] for row in recorded[0][entity]["Scalars:scalars"]])


def test_entities_hold_the_load_the_velocities_and_the_truck(recorded):
    load = ("truth", "filter", "til", "upper", "lower")
    assert set(recorded[0]) == {
        *(f"/parameters/{p}/{line}" for p in ("mass", "Jxx", "Jyy") for line in load),
        *(
            f"/rates/{rate}/{line}"
            for rate in ("vz", "roll_rate", "pitch_rate")
            for line in ("truth", "filter", "measured")
        ),
        *(f"/world/{body}" for body in ("chassis", "front_axle", "rear_axle")),
    }
    assert "/world/road" in recorded[1]


def test_band_is_two_standard_deviations_around_the_first_estimate(recorded, found, other):
    shown = np.append(np.arange(0, 1000, 10), 999)
    jxx, sd = found.absolute("Jxx")[shown], found.sd[shown, 1]
    np.testing.assert_array_equal(values(recorded, "/parameters/Jxx/filter"), jxx)
    np.testing.assert_allclose(values(recorded, "/parameters/Jxx/upper"), jxx + 2 * sd)
    np.testing.assert_allclose(values(recorded, "/parameters/Jxx/lower"), jxx - 2 * sd)
    np.testing.assert_array_equal(
        values(recorded, "/parameters/mass/til"), other.absolute("mass")[shown]
    )
    assert (values(recorded, "/parameters/mass/truth") == SprungMass().mass).all()


def test_truck_rides_along_its_road(recorded, drive):
    poses = recorded[0]["/world/chassis"]["Transform3D:translation"]
    first, last = np.array(poses[0][0]), np.array(poses[-1][0])
    np.testing.assert_allclose(
        last - first, [15.0 * 0.999, 0.0, drive.truth["heave"][-1]], atol=1e-5
    )
    vertices = np.array(recorded[1]["/world/road"]["Mesh3D:vertex_positions"][0])
    assert vertices[:, 0].min() == pytest.approx(-1.685)
    assert vertices[:, 0].max() == pytest.approx(15.0 * 0.999 + 2.4, abs=1e-4)
    heights = drive.inputs
    np.testing.assert_allclose(vertices[:, 2].mean(), heights.mean(), atol=0.5 * np.ptp(heights))
    assert np.ptp(vertices[:, 2]) == pytest.approx(np.ptp(heights), rel=0.5)


def test_an_estimate_without_deviations_still_has_its_curve(tmp_path, drive, found):
    bare = replace(found, sd=None)
    path = tmp_path / "bare.rrd"
    write_truck_timeline(path, drive=drive, estimates={"til": bare}, title="bare")
    assert np.isfinite(values(read(path), "/parameters/mass/til")).all()


def test_a_mistake_is_named_and_leaves_no_file(tmp_path, drive, found):
    with pytest.raises(TwinError, match=r"run.txt: .*'.txt'; allowed: '.rrd'"):
        write_truck_timeline(tmp_path / "run.txt", drive=drive, estimates={"f": found}, title="")
    assert not list(tmp_path.iterdir())
