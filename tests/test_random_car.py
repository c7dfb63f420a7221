import numpy as np
import pytest

from scenarios.driving.drivers import limits_of
from scenarios.driving.joint_drives import mixed
from scenarios.driving.manoeuvres import lane_changes
from scenarios.driving.record import Manoeuvre, record
from scenarios.plants.random_car import properties, random_car, real_car
from scenarios.plants.real_record import record_real
from scenarios.plants.real_sensors import told
from twin import Drive, TwinError, Vehicle

DT = 0.001
SECONDS = 4.0


def short_drive():
    """Speeds up, brakes hard and steers within four seconds."""
    time = np.arange(round(SECONDS / DT)) * DT
    speed = np.interp(time, [0.0, 1.5, 2.0, 4.0], [15.0, 19.0, 19.0, 8.0])
    steering = 0.6 * np.sin(2.0 * np.pi * time)
    road = np.zeros((time.size, 4))
    return Manoeuvre(name="short", dt=DT, speed=speed, steering=steering, road=road)


@pytest.fixture(scope="module")
def suv():
    return Vehicle.load("suv_loaded")


@pytest.fixture(scope="module")
def drives(suv):
    """Told drives of a car, noise-free, by the properties that differ."""

    def drive(real) -> Drive:
        clean = record_real(suv, real, short_drive())
        return told(clean, real, np.inf, np.random.default_rng(0))

    return drive


def test_car_without_differences_drives_as_its_file_says(suv):
    plain = record(suv, mixed(duration=SECONDS))
    real = record_real(suv, real_car(), mixed(duration=SECONDS))
    np.testing.assert_array_equal(real.measurements, plain.measurements)
    np.testing.assert_array_equal(real.inputs, plain.inputs)


def test_at_least_25_properties_differ_at_once():
    car, other = random_car(1), random_car(2)
    assert len(car.values) >= 25
    for name, values in car.values:
        assert values != properties()[name].nominal
        assert values != dict(other.values)[name]


@pytest.mark.parametrize("name", sorted(properties()))
def test_each_property_alone_changes_the_drive(name, drives, same):
    seed = 5  # of which the soft tyre is soft
    drive = drives(random_car(seed, only=(name,)))
    changed, before = (np.hstack([one.inputs, one.measurements]) for one in (drive, same))
    assert np.isfinite(changed).all()
    moves = before.std(axis=0) > 0.0
    change = np.abs(changed - before)[:, moves].max(axis=0) / before[:, moves].std(axis=0)
    assert change.max() > 1e-4


@pytest.fixture(scope="module")
def same(drives):
    return drives(real_car())


def test_property_alone_has_the_value_it_has_among_all():
    everything, alone = random_car(7), random_car(7, only=("toe",))
    np.testing.assert_array_equal(alone["toe"], everything["toe"])
    assert alone.number("steering_ratio") == 1.0


def test_drives_of_one_car_are_equal(drives, suv):
    one, two = (drives(random_car(3)) for _ in range(2))
    np.testing.assert_array_equal(one.measurements, two.measurements)


def test_random_car_follows_a_course(suv):
    manoeuvre = lane_changes(duration=10.0, limits=limits_of(Vehicle.load("sports_car")))
    drive = record_real(suv, random_car(4), manoeuvre)
    assert np.abs(drive.measurements[:, 1]).max() > 3.0


def test_load_is_what_is_on_board_whatever_the_car(suv, drives):
    truth = drives(random_car(6)).truth
    body = suv.chassis()
    assert truth["mass"][0] == pytest.approx(body.mass)
    assert truth["Jzz"][0] == pytest.approx(body.inertia[2, 2])


def test_road_is_told_only_where_it_is_known(suv):
    real = random_car(8)
    manoeuvre = mixed(duration=SECONDS)
    clean = record_real(suv, real, manoeuvre)
    rng = np.random.default_rng(0)
    assert not told(clean, real, 20.0, rng).inputs[:, 9:].any()
    known = told(clean, real, 20.0, rng, knows=("road",))
    np.testing.assert_array_equal(known.inputs[:, 9:], manoeuvre.road)
    assert known.settings["knows"] == ["road"]
    assert "noise_sd" not in known.settings


def test_unknown_property_is_refused():
    with pytest.raises(TwinError, match="'tyre_preasure' is unknown"):
        real_car(tyre_preasure=1.1)
    with pytest.raises(TwinError, match="allowed: 2 finite numbers"):
        real_car(toe=0.1)
    with pytest.raises(TwinError, match="'colour' is unknown"):
        random_car(1, only=("colour",))


def test_every_range_has_its_source():
    for name, one in properties().items():
        assert one.source, name
        assert one.text, name
        assert any(one.spread) or one.low != one.high, name
