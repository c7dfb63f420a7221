"""The driver on the circuit and in lane changes: he keeps to the line, and to the limits."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from scenarios.driving.double_lane_change import lanes, length, stretch
from scenarios.driving.driver import drive_along, new_memory
from scenarios.driving.drivers import LIMITS, driver_of, limits_of
from scenarios.driving.manoeuvres import lane_changes, laps
from scenarios.driving.record import record
from twin import INPUTS, STATES, PointMass, Twin, Vehicle

G = 9.81
LAP = 106.0  # [s], of the sports car
STRAIGHT = 150.0
CHANGES = {
    "sports_car": (1.0, (25.0, 35.0)),
    "suv": (0.55, (18.0, 22.0)),
    "bmw_320i": (0.55, (18.0, 22.0)),
}
WIDTHS = {"sports_car": 1.84, "suv": 1.84, "bmw_320i": 1.61}  # of the body geoms


def aside(course, truth):
    """How far left of the line [m], every hundredth sample."""
    x, y = truth["x"][::100], truth["y"][::100]
    _, place = cKDTree(np.column_stack([course.x, course.y])).query(np.column_stack([x, y]))
    heading = course.heading[place]
    return (y - course.y[place]) * np.cos(heading) - (x - course.x[place]) * np.sin(heading)


def drive(car, manoeuvre):
    return record(Vehicle.load(car), manoeuvre).truth


@pytest.fixture(scope="module")
def lap():
    manoeuvre = laps(duration=LAP, limits=limits_of(Vehicle.load("sports_car")))
    return manoeuvre, record(Vehicle.load("sports_car"), manoeuvre)


def test_sports_car_keeps_within_a_metre_or_so_of_the_line(lap):
    manoeuvre, made = lap
    assert np.abs(aside(manoeuvre.course, made.truth)).max() < 1.2


def test_sports_car_laps_at_its_limits_without_a_spin(lap):
    truth = lap[1].truth
    assert 225.0 < 3.6 * truth["vx"].max() < 235.0
    assert 1.35 * G < np.abs(truth["ay"]).max() < 1.55 * G
    assert np.degrees(np.abs(truth["sideslip"]).max()) < 8.0
    assert np.hypot(truth["x"][-1], truth["y"][-1]) < 400.0  # round, on the straight again


def test_sports_car_brakes_and_speeds_up_on_straights(lap):
    truth = lap[1].truth
    straight = np.abs(truth["yaw_rate"]) < np.radians(3.0)
    assert truth["ax"][straight].min() < -1.1 * G
    assert truth["ax"][straight].max() > 0.5 * G
    assert np.mean(np.abs(truth["ax"][straight]) > 1.5) > 0.5


def test_hand_wheel_and_pedals_move_smoothly(lap):
    made = lap[1]
    turned = np.diff(made.inputs[:, 0]) / made.dt
    assert np.degrees(np.abs(turned).max()) < 300.0  # a person reaches some 1000 deg/s
    assert np.abs(np.diff(made.inputs[:, 1:9], axis=0)).max() < 20.0  # N m in a millisecond


def test_limited_slip_differential_drives_the_slower_wheel_harder(lap):
    made = lap[1]
    drive, speed = made.inputs[:, 3:5], made.measurements[:, 8:10]
    cornering = (np.abs(made.truth["ay"]) > 0.5 * G) & (drive.sum(axis=1) > 100.0)
    slower = np.argmin(speed[cornering], axis=1)
    share = np.take_along_axis(drive[cornering], slower[:, None], 1)[:, 0] / drive[cornering].sum(1)
    assert share.min() >= 0.5
    assert share.max() == pytest.approx(0.7)
    assert not made.inputs[:, 1:3].any()


@pytest.mark.parametrize("car", ["suv", "bmw_320i"])
def test_other_cars_keep_to_the_line_of_the_circuit_at_their_limits(car):
    manoeuvre = laps(duration=60.0, limits=limits_of(Vehicle.load(car)))
    truth = drive(car, manoeuvre)
    assert np.abs(aside(manoeuvre.course, truth)).max() < 0.5
    assert 0.55 * G < np.abs(truth["ay"]).max() < 0.8 * G


@pytest.mark.parametrize("car", CHANGES)
def test_lane_changes_touch_no_cone(car):
    lateral, speeds = CHANGES[car]
    truth = drive(
        car,
        lane_changes(
            limits=limits_of(Vehicle.load(car)), lateral=lateral, speeds=speeds, straight=STRAIGHT
        ),
    )
    begin = 0.0
    for speed in speeds:
        stretched, begin = stretch(speed, lateral * G), begin + STRAIGHT
        for start, end, right, left in lanes(WIDTHS[car], stretched):
            within = (truth["x"] > begin + start) & (truth["x"] < begin + end)
            for side in (0.5, -0.5):
                y = truth["y"][within] + side * WIDTHS[car] * np.cos(truth["yaw"][within])
                assert right < y.min() <= y.max() < left
        begin += length(stretched)
    assert np.abs(truth["ay"]).max() == pytest.approx(lateral * G, rel=0.2)


def test_driver_called_from_other_code_does_what_he_does_in_a_recording():
    manoeuvre = laps(duration=0.6, limits=limits_of(Vehicle.load("suv")), start=30.0)
    expected = record(Vehicle.load("suv"), manoeuvre).inputs
    car, memory, u = Twin(Vehicle.load("suv")), new_memory(), np.zeros(len(INPUTS))
    driver = driver_of(Vehicle.load("suv"))
    car.reset(manoeuvre.course.speed[0])
    for row in expected:
        state = dict(zip(STATES, car.read_states(), strict=True))
        drive_along(
            driver, manoeuvre.course, memory, state["x"], state["y"], state["yaw"],
            state["vx"], state["vy"], state["yaw_rate"], car.read_states()[24:], car.dt, u,
        )  # fmt: skip
        np.testing.assert_array_equal(u, row)
        car.step(u)


def test_driver_finds_back_to_the_line():
    manoeuvre = laps(duration=10.0, limits=limits_of(Vehicle.load("suv")), start=20.0)
    moved = manoeuvre.course._replace(y=manoeuvre.course.y + 1.0)
    truth = drive("suv", type(manoeuvre)(
        name="moved", dt=manoeuvre.dt, course=moved, road=manoeuvre.road
    ))  # fmt: skip
    assert truth["y"][0] == 0.0
    assert truth["y"][-1] == pytest.approx(1.0, abs=0.01)
    assert truth["y"].max() < 1.2


@pytest.mark.parametrize("car", LIMITS)
def test_limits_keep_the_engine_a_reserve(car):
    vehicle = Vehicle.load(car)
    assert limits_of(vehicle).power <= driver_of(vehicle).power


@pytest.mark.parametrize("changed", [{"tyre_friction": 0.8}, {"drag": 1.2}])
def test_driver_knows_the_car_by_its_files_only(changed):
    vehicle = Vehicle.load("suv")
    trunk = PointMass(name="trunk", mass=200.0, position=np.array([-1.5, 0.0, 0.0]))
    other = vehicle.scaled(**changed).with_loads([trunk])
    assert driver_of(other) == driver_of(vehicle)
    assert limits_of(other) == limits_of(vehicle)


VAN = """
[chassis]
mass = 1800
cm_to_front_axle = 1.3
cm_height = 0.7
Jxx = 700
Jyy = 3200
Jzz = 3300
[geometry]
wheelbase = 3.0
[steering]
ratio = 14
[drivetrain]
drive_front = 1.0
power = 90e3
"""


def test_users_car_drives_laps_with_no_more_than_its_file(tmp_path):
    path = tmp_path / "van.toml"
    path.write_text(VAN)
    vehicle = Vehicle.load(path)
    manoeuvre = laps(duration=40.0, limits=limits_of(vehicle))
    made = record(vehicle, manoeuvre)
    assert np.abs(aside(manoeuvre.course, made.truth)).max() < 1.0
    assert np.abs(made.truth["ay"]).max() > 0.4 * G
    assert not made.inputs[:, 3:5].any()  # front drive, as the file says
