"""A wrong map of a good log is found, named with the line that mends it, and not trusted."""

import numpy as np
import pytest
from wrong_maps import WRONG, good_log, outcomes, the_map

from scenarios.logs.checks import checks
from scenarios.logs.findings import findings
from twin import Drive, Vehicle

# What a finding of each wrong map has to say; the others are known to change nothing that shows
SAID = {
    "ax in g called m/s2": 'ax is in g, not in m/s2; in the map: [channels.ax] unit = "g"',
    "ay in g called m/s2": 'ay is in g, not in m/s2; in the map: [channels.ay] unit = "g"',
    "ax in m/s2 called g": '[channels.ax] unit = "m/s2"',
    "yaw rate in deg/s called rad/s": '[channels.yaw_rate] unit = "deg/s"',
    "yaw rate in rad/s called deg/s": '[channels.yaw_rate] unit = "rad/s"',
    "all rates in deg/s": "roll_rate, pitch_rate, yaw_rate are in deg/s",
    "steering in deg called rad": '[channels.steering_wheel_angle] unit = "deg"',
    "steering at the road wheel": "is that of the road wheels",
    "wheel speeds in km/h called rad/s": 'unit = "km/h", radius = 0.361',
    "wheel speeds in m/s called rad/s": 'unit = "m/s", radius = 0.361',
    "wheel speeds in rpm called rad/s": '[channels.wheel_speed_*] unit = "rpm"',
    "torques in kN m called N m": 'unit = "kN m"',
    "torques times 2.5": "cannot be under any load",
    "torques of one wheel for all": "cannot be under any load",
    "brakes times 3": "[channels.brake_torque_*] factor = 0.32",
    "brakes in bar, 1/20": "[channels.brake_torque_*] factor = 19",
    "drive torques at the engine, 1/4": "[channels.drive_torque_*] factor = 4.1",
    "sign of ax": "[channels.ax] sign = -1",
    "sign of ay": "[channels.ay] sign = -1",
    "sign of az": "[channels.az] sign = -1",
    "sign of the yaw rate": "[channels.yaw_rate] sign = -1",
    "sign of the pitch rate": "[channels.pitch_rate] sign = -1",
    "sign of the roll rate": "[channels.roll_rate] sign = -1",
    "sign of the steering": "[channels.steering_wheel_angle] sign = -1",
    "sign of the drive torques": "[channels.drive_torque_*] sign = -1",
    "sign of ay, yaw rate and steering": "their y axis points to the right",
    "left and right wheels swapped": "wheel_speed_* left and right are swapped",
    "left and right front wheels swapped": "wheel_speed_fl, wheel_speed_fr left and right",
    "front and rear wheels swapped": "front and rear wheel speeds are swapped",
    "front and rear brakes swapped": "front and rear are swapped",
    "ax and ay swapped": "names of [channels.ax] and [channels.ay] exchanged",
    "IMU turned by 90 degrees": "the IMU is turned to the left by 90 degrees",
    "roll and pitch rate swapped": "roll and pitch are swapped",
    "ax and az swapped": "names of [channels.ax] and [channels.az] exchanged",
    "ax late by 0.4 s": "[channels.ax] delay = 0.4",
    "ax late by 0.2 s": "[channels.ax] delay = 0.2",
    "yaw rate late by 0.2 s": "[channels.yaw_rate] delay = 0.2",
    "wheel speeds late by 0.3 s": "wheel_speed_* are 0.3",
    "torques late by 0.3 s": "drive_torque_*, brake_torque_* are 0.28 s late",
    "all inputs late by 0.3 s": "steering_wheel_angle, drive_torque_*, brake_torque_* are 0.2",
    "clock of the inputs 0.2 % slow": "come by another clock, 0.2",
    "clock of the inputs 1 % slow": "come by another clock, 1",
    "ax off by 1 m/s2": "[channels.ax] offset = -0.9",
    "yaw rate off by 3 deg/s": "[channels.yaw_rate] offset = -0.05",
    "steering off by 15 deg": "[channels.steering_wheel_angle] offset = -0.2",
    "torques off by 200 N m": "an offset of one of them",
    "az without gravity": "free_of_gravity = true",
}


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return good_log(tmp_path_factory.mktemp("log"))


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle.load("suv")


def drive_by(log, **changes):
    path = log.with_name("map.toml")
    path.write_text(the_map(**changes))
    return Drive.load(log, path)


def test_right_map_has_no_finding(log, vehicle):
    drive = drive_by(log)
    assert findings(drive, vehicle) == []
    assert findings(drive) == []
    made = [check for check in checks(drive, vehicle) if check.fit is not None]
    assert len(made) >= 8
    assert {check.verdict for check in made} == {"good"}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_map_is_found_with_the_line_that_mends_it(log, vehicle, name):
    found = findings(drive_by(log, **WRONG[name]), vehicle)
    assert found
    assert all(finding.severity == "fault" for finding in found)
    assert SAID[name] in " ".join(map(str, found))


def test_frozen_wheel_is_found(log, vehicle):
    drive = drive_by(log)
    measured = drive.measurements.copy()
    column = drive.output_names.index("wheel_speed_rl")
    measured[20_000:50_000, column] = measured[20_000, column]
    found = findings(drive.replace(measurements=measured), vehicle)
    assert "wheel_speed_rl is frozen for" in " ".join(map(str, found))


def test_rate_and_length_that_no_log_has_are_asked_about(log):
    drive = drive_by(log)
    settings = drive.settings | {"log": drive.settings["log"] | {"rate": 0.05}}
    assert "0.05 samples a second: is its unit of time right?" in str(
        findings(drive.replace(settings=settings))[0]
    )
    slow = drive.replace(time=drive.time * 40_010.0)
    assert "hours: is its unit of time right?" in " ".join(map(str, findings(slow)))


@pytest.mark.slow
def test_no_estimate_that_is_off_is_called_trustworthy():
    table = list(outcomes())
    right = table[0]
    assert right.trustworthy
    assert not right.off
    assert [one.name for one in table if one.off and one.trustworthy] == []
    assert np.sum([bool(one.found) for one in table[1:]]) == len(WRONG) >= 40
