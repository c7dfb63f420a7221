import numpy as np
from rerun.chunk import RrdReader

from scenarios import lane_change
from scenarios.experiment.engine import first_trials
from scenarios.timeline import laps as timeline_laps
from scenarios.timeline.write import write

DURATION = 3.0


def test_timeline_has_both_observers_gates_and_the_ghost(tmp_path):
    path = tmp_path / "laps.rrd"
    write(lane_change.EXPERIMENT, path, seed=0, duration=DURATION)
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
    (trial,) = first_trials(lane_change.EXPERIMENT, 0, duration=DURATION)
    open_ = timeline_laps.gates(trial.drive, trial.estimate)
    both = open_["straight ahead"] * open_["speeding up or braking"]
    np.testing.assert_array_equal(open_["mass is corrected"], both)
    assert 0.0 < both.mean() < 1.0
