import json
from dataclasses import replace

import numpy as np
import pytest
from weigh_trips import ideal

from estimators.weigh.losses import TERMS, fit_trip
from estimators.weigh.samples import samples_of
from scenarios.__main__ import main
from scenarios.weighing.car import car_of
from scenarios.weighing.simulated import Surroundings, simulated_trip
from scenarios.weighing.twin_answer import twin_answer
from twin import Twin, Vehicle

MINUTES = 3.0
PERFECT = Surroundings(
    torque_scale=1.0,
    regeneration_loss=0.0,
    scale_sd=0.0,
    acceleration_sd=0.0,
    offset_sd=0.0,
    speed_step=1e-9,
    wind=0.0,
)


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle.load("bmw_i3")


@pytest.fixture(scope="module")
def trip(vehicle):
    return simulated_trip(vehicle, 150.0, 1, MINUTES)


def lever(vehicle):
    """A torque pushes with the height of the hub; the log's force is that at the rolling radius."""
    twin = Twin(vehicle)
    twin.reset(0.0)
    return float(twin.data.xpos[twin.car.wheel_body[2:], 2].mean())


def apparent(vehicle, load, around):
    samples = samples_of(simulated_trip(vehicle, load, 1, MINUTES, around))
    return fit_trip(samples, np.zeros(len(TERMS))).mass


def test_log_has_what_a_bus_shows(trip):
    assert trip.rate == pytest.approx(10.0)
    assert trip.brake is None
    assert trip.speed * 36.0 == pytest.approx(np.round(trip.speed * 36.0), abs=1e-6)
    assert trip.force.min() < 0.0 < trip.force.max()
    assert 0.3 < np.mean(trip.pedal > 0.02) < 1.0


def test_trip_of_a_seed_is_always_the_same(vehicle, trip):
    again = simulated_trip(vehicle, 150.0, 1, MINUTES)
    np.testing.assert_array_equal(again.force, trip.force)
    other = simulated_trip(vehicle, 150.0, 2, MINUTES)
    assert not np.array_equal(other.force, trip.force)


def test_force_over_acceleration_is_the_mass_and_hills_cancel(vehicle):
    car = car_of(vehicle)
    inertial = (car.mass + 150.0 + car.rotating_mass) * lever(vehicle) / car.radius
    for hills in (0.0, 0.04):
        found = apparent(vehicle, 150.0, replace(PERFECT, hills=hills))
        assert found == pytest.approx(inertial, rel=0.015)


def test_load_is_seen_as_the_difference_of_the_apparent_masses(vehicle):
    loaded, empty = (apparent(vehicle, load, PERFECT) for load in (200.0, 0.0))
    assert loaded - empty == pytest.approx(200.0, abs=25.0)


def test_twin_weighs_a_trip_of_its_own_car(vehicle):
    car = car_of(vehicle)
    calibration = ideal(car.mass, car.rotating_mass)
    scatter = replace(calibration.scatter, scale=lever(vehicle) / car.radius)
    own = simulated_trip(vehicle, 150.0, 1, MINUTES, PERFECT)
    answer = twin_answer(vehicle, own, replace(calibration, scatter=scatter))
    assert answer.mass == pytest.approx(car.mass + 150.0, abs=20.0)
    assert 0.0 < answer.sd < 60.0


@pytest.mark.slow
def test_intervals_hold_the_load_on_simulated_trips(tmp_path):
    path = tmp_path / "weigh.json"
    assert main(["run", "weigh", "--seeds", "20", "--json", str(path)]) == 0
    rows = {
        (row["estimator"], row["metric"]): row["median"]
        for row in json.loads(path.read_text())["rows"]
    }
    assert rows["weigh", "coverage"] >= 0.9
    assert rows["weigh", "half_width"] < 35.0
