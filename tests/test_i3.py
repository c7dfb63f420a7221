import os

import numpy as np
import pytest
from weigh_trips import MASS, ROTATING, made_up_trip

from estimators.weigh.calibration import Reference
from estimators.weigh.samples import samples_of
from estimators.weigh.trip import Trip
from scenarios import i3
from scenarios.__main__ import main
from scenarios.weighing.car import Car
from scenarios.weighing.study import (
    by_regression,
    cross_validated,
    everything,
    regression_of,
    seconds_to_stay,
)

CAR = Car(name="made up", mass=MASS, rotating_mass=ROTATING, radius=0.34)
has_data = pytest.mark.skipif(not os.environ.get(i3.VARIABLE), reason="needs the trips of BMW_I3")


@pytest.fixture(scope="module")
def trips():
    return [made_up_trip(seed, minutes=10.0) for seed in range(200, 206)]


def test_each_trip_is_weighed_without_itself(trips):
    weighings, calibrations = cross_validated(CAR, trips, 1)
    assert [w.name for w in weighings] == [trip.name for trip in trips]
    assert all(abs(w.load) < w.half_width for w in weighings)
    # a trip that is off moves every scale but the one that it is weighed by
    moved = Trip(
        name="off", time=trips[0].time, force=1.01 * trips[0].force, speed=trips[0].speed,
        acceleration=trips[0].acceleration, pedal=trips[0].pedal,
    )  # fmt: skip
    _, others = cross_validated(CAR, [moved, *trips[1:]], 1)
    scales = np.array([[c.scatter.scale for c in one] for one in (calibrations, others)])
    assert scales[0, 0] == scales[1, 0]
    assert (scales[0, 1:] != scales[1, 1:]).all()


def test_baseline_weighs_by_the_other_trips(trips):
    loaded = made_up_trip(300, 200.0, minutes=10.0)
    found = by_regression(CAR, trips, [loaded])
    assert set(found) == {trip.name for trip in [*trips, loaded]}
    assert found[loaded.name] == regression_of(CAR, trips, [loaded])[0]
    assert found[loaded.name].load == pytest.approx(200.0, abs=100.0)


def test_time_until_the_load_stays_close_is_that_of_the_last_start_that_is_off(trips):
    calibration = everything(
        CAR, [Reference(name=trip.name, samples=samples_of(trip)) for trip in trips]
    )
    loaded = made_up_trip(301, 100.0, minutes=10.0)
    seconds = seconds_to_stay(loaded, calibration, 100.0)
    assert 30.0 <= seconds <= 600.0
    assert seconds_to_stay(loaded, calibration, 500.0) == np.inf


def test_without_the_trips_a_sentence_says_where_they_are_looked_for(monkeypatch, capsys):
    monkeypatch.delenv(i3.VARIABLE, raising=False)
    assert main(["run", "i3"]) == 2
    assert "BMW_I3: is ''; allowed: a folder with the trips" in capsys.readouterr().err


def test_noise_and_duration_are_refused(monkeypatch, capsys):
    assert main(["run", "i3", "--snr", "20"]) == 2
    assert "its noise is given" in capsys.readouterr().err
    assert main(["run", "i3", "--duration", "60"]) == 2
    assert "weighed whole" in capsys.readouterr().err


@has_data
def test_trips_are_read_by_the_map_that_ships():
    car, trips, held_out = i3.load_trips()
    assert len(trips) >= 40
    assert {trip.name for trip in held_out} == set(i3.HELD_OUT)
    one = next(trip for trip in trips if trip.name == "TripA01")
    assert one.rate == pytest.approx(10.0)
    assert one.force.max() == pytest.approx(174.42 * 9.665 / car.radius, rel=1e-3)
    assert one.pedal is not None
    assert one.brake is None
