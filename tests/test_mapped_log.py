"""Logs of other programs become drives by a map."""

import numpy as np
import pytest

from estimators.til.observer import Observer
from scenarios import mass
from scenarios.driving.manoeuvres import swept_steer
from scenarios.driving.record import record
from twin import FURTHER_OUTPUTS, INPUTS, OUTPUTS, WHEELS, Drive, Twin, TwinError, Vehicle
from twin.logs.map import TORQUES, LogMap
from twin.logs.units import GRAVITY

RADIUS = 0.36

# A log of the SUV as another program might write it: our name, its name, unit there, ours per unit
# and in the axes of SAE
DEG = np.pi / 180.0
SAE = {
    "steering_wheel_angle": ("SteerAng", "deg", -DEG),
    "ax": ("LongAcc", "g", GRAVITY),
    "ay": ("LatAcc", "g", -GRAVITY),
    "az": ("VertAcc", "g", -GRAVITY),
    "roll_rate": ("RollRate", "deg/s", DEG),
    "pitch_rate": ("PitchRate", "deg/s", -DEG),
    "yaw_rate": ("YawRate", "deg/s", -DEG),
    **{f"wheel_speed_{w}": (f"Wheel{w.upper()}", "km/h", 1.0 / (3.6 * RADIUS)) for w in WHEELS},
    **{name: (name.title(), "N m", 1.0) for name in TORQUES},
}
MAP = (
    'axes = "SAE"\n[time]\nname = "Time"\nunit = "ms"\n[constants]\nroad_height = 0.0\n'
    + "".join(
        f'[channels.{ours}]\nname = "{theirs}"\nunit = "{unit}"\n'
        + (f"radius = {RADIUS}\n" if unit == "km/h" else "")
        for ours, (theirs, unit, _) in SAE.items()
    )
)


@pytest.fixture(scope="module")
def suv_drive():
    manoeuvre = swept_steer(duration=3.0, highest=1.0, sweep=3.0)
    manoeuvre.speed[:] = 20.0 + np.sin(2.0 * np.arange(3000) * 1e-3)
    return record(Vehicle.load("suv_loaded"), manoeuvre)


def write_csv(path, columns, delimiter=","):
    header = delimiter.join(columns)
    np.savetxt(
        path,
        np.column_stack(list(columns.values())),
        "%.10g",
        delimiter,
        header=header,
        comments="",
    )
    return path


def sae_columns(drive):
    columns = {"Time": 1e3 * drive.time}
    return columns | {name: drive.channel(ours) / per for ours, (name, _, per) in SAE.items()}


def written(path, text):
    path.write_text(text)
    return path


@pytest.fixture
def log(tmp_path, suv_drive):
    """The SUV's log in SAE axes, and its map."""
    path = write_csv(tmp_path / "log.csv", sae_columns(suv_drive))
    return path, written(tmp_path / "map.toml", MAP)


def simple(tmp_path, columns, text="", inputs="steering_wheel_angle = 0.0"):
    """The drive of a small log; the map's text stands before the inputs it declares."""
    path = write_csv(tmp_path / "log.csv", columns)
    constants = f"[constants]\n{inputs}\ndrive_torque = 0\nbrake_torque = 0\nroad_height = 0\n"
    return Drive.load(path, written(tmp_path / "map.toml", text + constants))


def refusal(load, *args, **options):
    with pytest.raises(TwinError) as caught:
        load(*args, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def done(drive):
    return "\n".join(drive.settings["log"]["done"])


def test_log_in_sae_axes_and_everyday_units_is_the_drive_it_was_recorded_from(log, suv_drive):
    drive = Drive.load(*log)
    assert (drive.input_names, drive.output_names) == (INPUTS, OUTPUTS)
    np.testing.assert_allclose(drive.time, suv_drive.time, atol=1e-9)
    np.testing.assert_allclose(drive.inputs, suv_drive.inputs, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(drive.measurements, suv_drive.measurements, rtol=1e-7, atol=1e-8)
    assert drive.truth == {}


def test_estimate_from_the_mapped_log_is_that_from_the_drive(log, suv_drive):
    estimates = []
    for drive in (suv_drive, Drive.load(*log)):
        observer = Observer(Twin(Vehicle.load("suv")), mass.EXPERIMENT.estimators["til"].laws)
        observer.reset(speed=20.0)
        estimates.append(observer.run(drive)["mass"])
    assert np.ptp(estimates[0]) > 10.0
    np.testing.assert_allclose(estimates[1], estimates[0], atol=1e-3)


def test_log_says_what_was_done_to_it(log):
    text = done(Drive.load(*log))
    assert "ay: from 'LatAcc' in g at 1000 Hz, sign turned." in text
    assert "wheel_speed_fl: from 'WheelFL' in km/h at 1000 Hz, over a radius of 0.36 m." in text
    assert "road_height_fl: 0 m throughout, as the map declares." in text
    assert "3000 samples at 1000 Hz" in text


def test_channel_is_scaled_shifted_and_brought_forward(tmp_path):
    time = np.arange(100) * 0.01
    channel = (
        '[channels.ax]\nname = "a"\nunit = "g"\nsign = -1\nfactor = 2\noffset = 1\ndelay = 0.1\n'
    )
    drive = simple(tmp_path, {"t": time, "a": time}, channel)
    expected = -2.0 * GRAVITY * (drive.time + 0.1 - 1.0)
    inside = drive.time <= 0.89 - 1e-9
    np.testing.assert_allclose(drive.channel("ax")[inside], expected[inside], atol=1e-9)


def test_missing_measurement_is_nan_and_its_estimates_are_named(tmp_path):
    drive = simple(
        tmp_path, {"t": [0, 1, 2], "a": [0, 1, 2]}, '[channels.ax]\nname="a"\nunit="g"\n'
    )
    assert np.isnan(drive.channel("yaw_rate")).all()
    assert "Not in the log, hence NaN: ay, az, roll_rate" in done(drive)
    assert "Jzz cannot be estimated without yaw_rate, steering_wheel_angle." in done(drive)
    assert "mass cannot be estimated without drive_torque_*, brake_torque_*." in done(drive)


def test_further_measurements_stand_behind_the_twins_outputs(tmp_path):
    channels = '[channels.vx]\nname = "v"\nunit = "km/h"\n[truth.sideslip]\nname="b"\nunit="deg"\n'
    time = np.arange(10.0)
    drive = simple(tmp_path, {"t": time, "v": 36.0 + 0 * time, "b": time}, channels)
    assert drive.output_names == (*OUTPUTS, "vx")
    np.testing.assert_allclose(drive.channel("vx"), 10.0)
    assert drive.truth["sideslip"][-1] == pytest.approx(9.0 * DEG)
    assert set(FURTHER_OUTPUTS) >= {"vx", "vy", "sideslip"}


def test_log_without_torques_has_no_torque_inputs_and_is_marked(tmp_path):
    text = 'follow_speed = true\n[channels.vx]\nname = "v"\nunit = "m/s"\n'
    text += "[constants]\nsteering_wheel_angle = 0\nroad_height = 0\n"
    path = write_csv(tmp_path / "log.csv", {"t": [0, 1, 2], "v": [9, 9, 9]})
    drive = Drive.load(path, written(tmp_path / "map.toml", text))
    assert drive.input_names == ("steering_wheel_angle", *(f"road_height_{w}" for w in WHEELS))
    assert drive.settings["log"]["follow_speed"] is True
    assert "the twin is to follow the measured vx" in done(drive)
    assert "mass cannot be estimated without ax, drive_torque_*, brake_torque_*." in done(drive)


def test_gap_in_a_measurement_is_nan_and_short_ones_are_bridged(tmp_path):
    time = np.arange(0.0, 10.0, 0.01)
    time = time[(time < 2.0) | (time > 2.05)]
    time = time[(time < 5.0) | (time > 6.0)]
    drive = simple(tmp_path, {"t": time, "a": time}, '[channels.ax]\nname="a"\nunit="m/s2"\n')
    missing = drive.time[np.isnan(drive.channel("ax"))]
    assert 4.99 < missing[0] < 5.01
    assert 5.99 < missing[-1] < 6.02
    good = np.isfinite(drive.channel("ax"))
    np.testing.assert_allclose(drive.channel("ax")[good], drive.time[good], atol=1e-9)


@pytest.mark.parametrize("end", [5.8, 7.0])
def test_gap_in_an_input_is_bridged_or_cut_out(tmp_path, end):
    time = np.concatenate([np.arange(0, 5, 0.01), np.arange(end, 9, 0.01)])
    path = write_csv(tmp_path / "log.csv", {"t": time, "s": time})
    text = '[channels.steering_wheel_angle]\nname="s"\nunit="deg"\n'
    text += "[constants]\ndrive_torque = 0\nbrake_torque = 0\nroad_height = 0\n"
    drive = Drive.load(path, written(tmp_path / "map.toml", text))
    assert f"missing from 4.991 to {end - 0.001:g} s" in done(drive)
    assert ("that time is left out" in done(drive)) == (end == 7.0)
    assert np.diff(drive.time).max() == pytest.approx(0.001 if end < 6.0 else 2.01)
    assert "samples missing in 1 gap." in done(drive)


def test_input_that_is_never_there_beside_the_others_is_refused(tmp_path):
    time = np.arange(0, 9, 0.01)
    drive, steer = np.where(time < 4, 1.0, np.nan), np.where(time > 5, 1.0, np.nan)
    path = write_csv(tmp_path / "log.csv", {"t": time, "s": steer, "d": drive})
    text = '[channels.steering_wheel_angle]\nname="s"\nunit="deg"\n'
    text += '[channels.drive_torque_fl]\nname="d"\nunit="N m"\n[constants]\nroad_height = 0\n'
    text += "".join(f"drive_torque_{w} = 0\n" for w in ("fr", "rl", "rr")) + "brake_torque = 0\n"
    message = refusal(Drive.load, path, written(tmp_path / "map.toml", text))
    assert "no two samples have all inputs" in message


def test_log_faster_than_the_drive_is_averaged_not_picked(tmp_path):
    time = np.arange(20_000) / 2e4
    tone = np.sin(2.0 * np.pi * 1010.0 * time)  # picked at 1 kHz it would be one of 10 Hz
    drive = simple(tmp_path, {"t": time, "a": tone}, '[channels.ax]\nname="a"\nunit="m/s2"\n')
    assert np.nanmax(np.abs(drive.channel("ax")[2:-2])) < 0.05
    assert "averaged over each sample of the drive" in done(drive)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "input steering_wheel_angle is missing; allowed: [channels.steering_wheel_angle], a"),
        ("axes = 1", "axes is 1; allowed: ISO, SAE"),
        ("rate = 0", "rate is 0; allowed: a number from 1 to 10000"),
        ("rate = true", "rate is True; allowed: a number"),
        ("speed = 3", "speed is unknown; allowed: axes, rate"),
        ("channels = 3", "channels is 3; allowed: a table"),
        ("[channels.a_x]", "channels.a_x is unknown; allowed: steering_wheel_angle"),
        ("[channels.ax]\nunit='g'", "channels.ax.name is missing; allowed: the name of a channel"),
        ("[channels.ax]\nname='a'\nunit='rpm'", "channels.ax.unit is 'rpm'; allowed: m/s2"),
        (
            "[channels.ax]\nname='a'\nsign=2",
            "channels.ax.sign is 2; allowed: a number from -1 to 1",
        ),
        ("[channels.ax]\nname='a'\nfactor=0", "channels.ax.factor is 0; allowed: a number that is"),
        ("[channels.ax]\nname='a'\nradius=1", "channels.ax.radius is 1; allowed: none, but for"),
        ("[channels.wheel_speed_fl]\nname='a'\nunit='km/h'", "which needs the wheel's radius"),
        ("[constants]\nax = 0", "constants.ax is unknown"),
        ("[constants]\nroad_height = 0\nroad_height_fl = 0", "constants.road_height_fl is 0"),
        ("follow_speed = true", "follow_speed needs channels.vx"),
        ("[time]\nunit = 'ticks'", "time.unit is 'ticks'; allowed: s, ms"),
        ("rate = \n", "is no TOML: Invalid value (at line 1, column 8)"),
    ],
)
def test_fault_of_a_map_is_one_line_that_names_it(tmp_path, text, message):
    assert message in refusal(LogMap.load, written(tmp_path / "map.toml", text))


def test_channel_that_the_log_lacks_is_named_with_what_it_has(log):
    path, map_path = log
    map_path.write_text(MAP.replace('"LatAcc"', '"Lat"'))
    message = refusal(Drive.load, path, map_path)
    assert "channel 'Lat', mapped to ay, is not there; it has SteerAng, LongAcc" in message


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("t,a\n0,1\n2,1\n1,1\n", "time 't' runs backwards, from 2 to 1 s at sample 2"),
        ("t,a\n0,1\n,1\n,1\n", "time 't' is nan at sample 1; allowed: finite times"),
        ("t,a\n0,1\n", "has 1 samples; allowed: at least 2"),
        ("t,a\n0,1\n1,left\n", "channel 'a', mapped to ax, cannot be used: it is \"left\""),
        ("t,a\n0,1\n1\n", "has 1 samples; allowed: at least 2"),
        ("t,a\n0,1\n1\n2\n", "2 of 3 rows have not the 2 cells of the row of names"),
        ("t,a,a\n0,1,1\n1,1,1\n", "channel 'a', mapped to ax, occurs twice"),
        ("x,a\n0,1\n1,1\n", "no column is called time; allowed: [time] with its name"),
        ("", "is no table of text"),
        ("t,a\n0,1\n1e10,1\n", "too few for a drive of 1000 Hz"),
    ],
)
def test_fault_of_a_log_is_one_line_that_names_it(tmp_path, content, message):
    path = written(tmp_path / "log.csv", content)
    text = '[channels.ax]\nname="a"\nunit="g"\n[constants]\nsteering_wheel_angle=0\n'
    text += "drive_torque=0\nbrake_torque=0\nroad_height=0\n"
    assert message in refusal(Drive.load, path, written(tmp_path / "map.toml", text))
