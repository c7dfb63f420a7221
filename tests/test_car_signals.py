"""Signals as cars have them become ours: pressures, motors, gears, angles, speeds, gravity."""

import numpy as np
import pytest

from twin import WHEELS, Drive, TwinError, Vehicle
from twin.car.signals import signals_of
from twin.car.template import template
from twin.logs.car_signals import CarSignals
from twin.logs.units import GRAVITY

N = 60
TIME = 0.1 * np.arange(N)
CAR = {
    "driven": "rear", "final_drive": 3.0, "gear_ratios": [4.0, 2.0, 1.0], "efficiency": 0.9,
    "brake_torque_per_bar_front": 60.0, "brake_torque_per_bar_rear": 40.0, "steering_ratio": 16.0,
    "radius": 0.35,
}  # fmt: skip
INPUTS = {"steering_wheel_angle": 0.0, "drive_torque": 0.0, "brake_torque": 0.0, "road_height": 0.0}


def made(signals, car=CAR, constants=INPUTS, **more):
    """The drive of signals by (unit, values)."""
    given = {"steering_wheel_angle": "road_wheel", "drive_torque": "motor", "brake_torque": "brake"}
    left = {
        k: v
        for k, v in constants.items()
        if not any(s.startswith(given.get(k, "?")) for s in signals)
    }
    frame = {"t": TIME} | {name: np.broadcast_to(v, N) for name, (_, v) in signals.items()}
    content = {
        "rate": 10,
        "channels": {name: {"name": name, "unit": unit} for name, (unit, _) in signals.items()},
        "constants": left,
        **more,
    }
    if car is not None:
        content["car"] = car
    return Drive.from_frame(frame, content)


def test_motor_torque_goes_through_gear_final_drive_and_losses_to_the_driven_axle():
    torque = np.where(np.arange(N) < 30, 100.0, -50.0)
    drive = made({"motor_torque": ("N m", torque), "gear": ("1", 2.0)})
    expected = np.where(torque > 0, 0.9, 1 / 0.9) * 2.0 * 3.0 * torque / 2.0
    for wheel in WHEELS:
        values = drive.channel(f"drive_torque_{wheel}")
        np.testing.assert_allclose(values, expected if wheel[0] == "r" else 0.0)
    assert "driven: rear" in " ".join(drive.settings["log"]["done"])


def test_neutral_and_reverse_are_gears():
    gear = np.repeat([0.0, -1.0, 1.0], N // 3)
    torque = made({"motor_torque": ("N m", 100.0), "gear": ("1", gear)}).channel("drive_torque_rl")
    np.testing.assert_allclose(torque[[5, 25, 50]], [0.0, -540.0, 540.0])


def test_all_wheels_share_and_two_motors_add():
    car = {"driven": "all", "front_share": 0.4, "final_drive": 9.0}
    drive = made({"motor_torque": ("N m", 100.0)}, car)
    np.testing.assert_allclose(drive.channel("drive_torque_fl"), 0.4 * 450.0)
    np.testing.assert_allclose(drive.channel("drive_torque_rr"), 0.6 * 450.0)
    two = made({"motor_torque_front": ("N m", 10.0), "motor_torque_rear": ("N m", 20.0)}, car)
    np.testing.assert_allclose(two.channel("drive_torque_fr"), 45.0)
    np.testing.assert_allclose(two.channel("drive_torque_rl"), 90.0)


@pytest.mark.parametrize(("unit", "per"), [("bar", 1.0), ("MPa", 10.0), ("kPa", 0.01)])
def test_pressure_becomes_brake_torques(unit, per):
    drive = made({"brake_pressure": (unit, 20.0 / per)})
    np.testing.assert_allclose(drive.channel("brake_torque_fl"), 600.0)
    np.testing.assert_allclose(drive.channel("brake_torque_rr"), 400.0)
    axles = made({"brake_pressure_front": ("bar", 20.0), "brake_pressure_rear": ("bar", -1.0)})
    np.testing.assert_allclose(axles.channel("brake_torque_fr"), 600.0)
    np.testing.assert_allclose(axles.channel("brake_torque_rl"), 0.0)


def test_road_wheel_angle_and_one_speed():
    drive = made({"road_wheel_angle": ("deg", 2.0), "speed": ("km/h", 72.0)}, axes="SAE")
    np.testing.assert_allclose(drive.channel("steering_wheel_angle"), -16.0 * np.radians(2.0))
    for wheel in WHEELS:
        np.testing.assert_allclose(drive.channel(f"wheel_speed_{wheel}"), 20.0 / 0.35)


def test_road_wheel_angle_is_the_mean_of_both_wheels():
    signals = {"road_wheel_angle_left": ("deg", 2.0), "road_wheel_angle_right": ("deg", 1.0)}
    drive = made(signals, axes="SAE")
    np.testing.assert_allclose(drive.channel("steering_wheel_angle"), -16.0 * np.radians(1.5))
    with pytest.raises(TwinError, match="without the other wheel's"):
        made({"road_wheel_angle_left": ("deg", 2.0)})


def test_course_over_ground_gives_the_yaw_rate():
    course = np.degrees(0.1 * TIME + 6.2) % 360.0  # clockwise: to the right
    drive = made({"course": ("deg", course), "vx": ("m/s", 10.0)})
    np.testing.assert_allclose(drive.channel("yaw_rate")[1:-1], -0.1, atol=1e-6)
    stands = made({"course": ("deg", course), "vx": ("m/s", 0.0)})
    assert np.isnan(stands.channel("yaw_rate")).all()


def test_accelerations_free_of_gravity_become_specific_forces():
    signals = {"ax": ("m/s2", 1.0), "ay": ("g", 0.0), "az": ("m/s2", 0.0), "slope": ("%", 10.0)}
    drive = made(signals, free_of_gravity=True)
    np.testing.assert_allclose(drive.channel("ax"), 1.0 + GRAVITY * np.sin(0.1))
    np.testing.assert_allclose(drive.channel("az"), GRAVITY * np.cos(0.1))
    level = made({"az": ("m/s2", 0.0)}, free_of_gravity=True)
    np.testing.assert_allclose(level.channel("az"), GRAVITY)
    assert "of a level road, as no slope is mapped" in " ".join(level.settings["log"]["done"])


@pytest.mark.parametrize(
    ("signals", "car", "message"),
    [
        ({"motor_torque": ("N m", 1.0)}, None, "motor_torque needs the car's final_drive"),
        ({"motor_torque": ("N m", 1.0)}, {"final_drive": 3.0}, "needs the car's driven axle"),
        ({"motor_torque": ("N m", 1.0)}, CAR, "needs channels.gear, as the car has 3 gears"),
        ({"motor_torque": ("N m", 1.0), "gear": ("1", 7.0)}, CAR, "gear is 7; allowed: up to 3"),
        ({"brake_pressure": ("bar", 1.0)}, {}, "needs the car's brake_torque_per_bar_front"),
        ({"brake_pressure": ("m/s", 1.0)}, CAR, "unit is 'm/s'; allowed: bar, Pa"),
        ({"speed": ("m/s", 1.0)}, None, "speed needs the car's radius"),
        ({"ax": ("g", 1.0)}, {"gears": 3}, "car.gears is unknown; allowed: brake_torque"),
        ({"ax": ("g", 1.0)}, {"gear_ratios": []}, "gear_ratios is .*allowed: up to 20 numbers"),
        (
            {"speed": ("m/s", 1.0), "wheel_speed_fl": ("rad/s", 1.0)},
            CAR,
            "channels.wheel_speed_fl is given beside channels.speed",
        ),
    ],
)
def test_signal_that_the_car_does_not_explain_is_refused(signals, car, message):
    with pytest.raises(TwinError, match=message):
        made(signals, car)


def test_car_file_says_what_its_signals_mean(tmp_path):
    text = template("mine").replace("# final_drive = 9.1", "final_drive = 7.0")
    text = text.replace('# driven = "rear"', 'driven = "front"')
    (tmp_path / "mine.toml").write_text(text)
    car = signals_of(Vehicle.load(tmp_path / "mine.toml"))
    assert (car.driven, car.final_drive, car.steering_ratio) == ("front", 7.0, 16.0)
    assert signals_of(Vehicle.load("suv")).radius == pytest.approx(0.3609, rel=0.005)
    (tmp_path / "mine.toml").write_text(text.replace('"front"', '"left"'))
    with pytest.raises(TwinError, match=r"signals.driven is 'left'; allowed: front, rear, all"):
        Vehicle.load(tmp_path / "mine.toml")


def test_map_comes_before_the_car_file(tmp_path):
    (tmp_path / "log.csv").write_text("t,m\n" + "".join(f"{t:g},100\n" for t in TIME))
    constants = "".join(f"{k} = 0\n" for k in INPUTS if k != "drive_torque")
    (tmp_path / "map.toml").write_text(
        '[channels.motor_torque]\nname = "m"\nunit = "N m"\n[constants]\n'
        + constants
        + "[car]\nfinal_drive = 5\n"
    )
    car = CarSignals(driven="front", final_drive=9.0)
    drive = Drive.load(tmp_path / "log.csv", tmp_path / "map.toml", car)
    np.testing.assert_allclose(drive.channel("drive_torque_fl"), 250.0)
