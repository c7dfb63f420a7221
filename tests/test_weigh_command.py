import json

import numpy as np
import pytest
from weigh_trips import made_up_trip

from scenarios.__main__ import main
from scenarios.weighing.calibration_file import read_calibration
from scenarios.weighing.car import car_of
from scenarios.weighing.logs import Log
from twin import Drive, TwinError, Vehicle

WHEELS = ("fl", "fr", "rl", "rr")


@pytest.fixture(scope="module")
def car():
    return car_of(Vehicle.load("bmw_i3"))


def saved(folder, name, seed, car, load=0.0, **settings):
    """A made-up trip as a drive of ours; returns its path."""
    trip = made_up_trip(seed, load, **settings)
    torque = 0.5 * trip.force * car.radius
    zero = np.zeros_like(torque)
    drive = Drive(
        time=trip.time,
        inputs=np.column_stack((zero, zero, torque, torque)),
        input_names=tuple(f"drive_torque_{w}" for w in WHEELS),
        measurements=np.column_stack((trip.acceleration, trip.speed, trip.pedal)),
        output_names=("ax", "vx", "accelerator_pedal"),
    )
    path = folder / f"{name}.parquet"
    drive.save(path)
    return str(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, car):
    """References r0 to r4, a loaded trip, one in a wrong unit, and a calibration of the former."""
    folder = tmp_path_factory.mktemp("weigh")
    references = [saved(folder, f"r{k}", 100 + k, car) for k in range(5)]
    saved(folder, "loaded", 7, car, 150.0)
    saved(folder, "unit", 8, car, scale=1.2 / 9.665)
    options = [part for path in references for part in ("--reference", path)]
    out = str(folder / "i3.toml")
    assert main(["weigh", "--vehicle", "bmw_i3", *options, "--calibrate", out]) == 0
    return folder


def test_weigh_tells_the_load_of_each_trip_and_why_one_is_not_believed(folder, capsys):
    logs = [str(folder / f"{name}.parquet") for name in ("loaded", "unit")]
    options = ["--vehicle", "bmw_i3", "--calibration", str(folder / "i3.toml"), "--json", "-"]
    assert main(["weigh", *logs, *options]) == 0
    result = json.loads(capsys.readouterr().out)
    loaded, unit = result["logs"]
    total, load = loaded["estimates"]
    assert (total["name"], load["name"]) == ("total_mass", "load")
    assert load["valid"]
    assert load["low_95"] < 150.0 < load["high_95"]
    assert total["value"] == pytest.approx(load["value"] + 1270.0)
    assert not unit["estimates"][0]["valid"]
    assert "another unit" in unit["estimates"][0]["reason"]


def test_weigh_shows_a_line_for_each_trip_and_goes_on_after_a_bad_log(folder, capsys):
    bad = folder / "bad.parquet"
    bad.write_text("no log")
    logs = [str(bad), str(folder / "loaded.parquet")]
    options = ["--vehicle", "bmw_i3", "--calibration", str(folder / "i3.toml")]
    assert main(["weigh", *logs, *options]) == 2
    shown = capsys.readouterr()
    assert any(
        line.startswith("loaded ") and line.endswith("yes") for line in shown.out.split("\n")
    )
    assert "bad.parquet" in shown.err


def test_weigh_draws_all_trips_with_their_notes(folder):
    pytest.importorskip("matplotlib")
    notes = folder / "notes.csv"
    notes.write_text("loaded,+150 kg\n")
    picture = folder / "trips.png"
    logs = [str(folder / f"{name}.parquet") for name in ("r0", "loaded", "unit")]
    options = ["--vehicle", "bmw_i3", "--calibration", str(folder / "i3.toml")]
    assert main(["weigh", *logs, *options, "--notes", str(notes), "--png", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_references_of_known_load_move_the_scale_less_than_they_ask_for(folder, capsys):
    logs = [str(folder / "loaded.parquet")]
    options = ["--vehicle", "bmw_i3", "--calibration", str(folder / "i3.toml")]
    reference = ["--reference", f"{folder / 'r0.parquet'}=20"]
    assert main(["weigh", *logs, *options, *reference]) == 0
    sentence = capsys.readouterr().out.strip().split("\n")[-1]
    assert sentence.startswith("The scale moves by -")


def test_calibration_comes_back_as_it_was_written(folder):
    calibration = read_calibration(folder / "i3.toml")
    assert calibration.mass == 1270.0
    assert calibration.scatter.scale == pytest.approx(1.2, rel=0.05)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("tau = ", "tau = -"), "scatter.tau"),
        (("noise = ", "noises = "), "ranges.noises is unknown"),
        (("phi = ", "# phi = "), "scatter.phi is missing"),
    ],
)
def test_broken_calibration_is_refused_by_its_field(folder, tmp_path, change, words):
    path = tmp_path / "broken.toml"
    path.write_text((folder / "i3.toml").read_text().replace(*change))
    with pytest.raises(TwinError, match=words):
        read_calibration(path)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--vehicle", "bmw_i3"], "there is no LOG"),
        (["x.parquet", "--vehicle", "suv"], "has no calibration for weighing"),
        (["x.parquet", "--vehicle", "bmw_i3", "--reference", "x.parquet=y"], "load is 'y'"),
    ],
)
def test_mistakes_of_the_user_are_one_line(arguments, words, capsys):
    assert main(["weigh", *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_calibration_of_another_car_is_refused(folder, capsys):
    options = ["--vehicle", "suv", "--calibration", str(folder / "i3.toml")]
    assert main(["weigh", str(folder / "loaded.parquet"), *options]) == 2
    assert "suv: mass is" in capsys.readouterr().err


def test_calibration_that_ships_is_of_the_car_that_ships(car):
    calibration = read_calibration(Vehicle.load("bmw_i3").source.parent / "weighing/bmw_i3.toml")
    assert calibration.mass == pytest.approx(car.mass)
    assert calibration.rotating_mass == pytest.approx(car.rotating_mass, abs=0.01)


def test_name_of_a_reference_may_carry_its_load(tmp_path):
    assert Log.parse("a/b.csv=80").load == 80.0
    assert Log.parse("a/b.csv").load == 0.0
    odd = tmp_path / "odd=1.csv"
    odd.write_text("")
    assert Log.parse(str(odd)).path == odd
