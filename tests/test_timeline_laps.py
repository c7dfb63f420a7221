import numpy as np
import pytest
from rerun.chunk import RrdReader

from scenarios.experiment.state_study import Run, observe
from scenarios.timeline import laps as timeline_laps
from twin import TwinError

RUNS = [
    Run(case="mismatched", drive="lane-change", estimator=name, duration=3.0)
    for name in ("til", "double-track")
]


def test_timeline_has_both_observers_gates_and_the_ghost(tmp_path):
    path = tmp_path / "laps.rrd"
    timeline_laps.write(path, RUNS, title="lane changes")
    (store,) = RrdReader(path).recordings()
    found = RrdReader(path).stream(store=store).to_chunks()
    entities = {str(chunk.entity_path) for chunk in found}
    wanted = {
        *("/sideslip/til", "/sideslip/double_track", "/sideslip/truth", "/mass/double_track"),
        *("/gates/mass_is_corrected", "/world/chassis", "/world/twin/chassis", "/world/road"),
    }
    assert wanted <= entities
    assert list(tmp_path.iterdir()) == [path]


def test_gate_is_open_only_straight_ahead_and_under_force():
    drive, belief = observe(RUNS[0])
    open_ = timeline_laps.gates(drive, belief.estimate)
    both = open_["straight ahead"] * open_["speeding up or braking"]
    np.testing.assert_array_equal(open_["mass is corrected"], both)
    assert 0.0 < both.mean() < 1.0


def test_timeline_without_the_default_observer_is_refused(tmp_path):
    with pytest.raises(TwinError, match="a timeline needs a run of til"):
        timeline_laps.write(tmp_path / "x.rrd", RUNS[1:], title="lane changes")
