"""Cars and tyres made from a few figures, and the guesses that remain."""

import numpy as np
import pytest

from scenarios.__main__ import main
from twin import Twin, TwinError, Vehicle
from twin.car.guesses import ABSOLUTE, RELATIVE, car_guesses
from twin.car.rules import Figures
from twin.car.template import write_template
from twin.car.toml_car import read_car
from twin.tyre.interface import stiffness
from twin.tyre.size import parse_size, tyre_text
from twin.tyre.tir import read_tyre

GOLF = Figures(
    mass=1400.0,
    wheelbase=2.65,
    track=1.53,
    front_share=0.6,
    drive_front=1.0,
    tyre=parse_size("205/55R16 91V"),
)


@pytest.fixture
def golf(tmp_path):
    return write_template(str(tmp_path / "golf"), GOLF)


def test_size_has_the_radius_and_capacity_of_the_standards():
    """ETRTO lists 632 mm for a 205/55 R16; ISO 4000-1 615 kg for 91 and 1000 kg for 108."""
    size = parse_size("205/55 R16 91V")
    assert 2.0 * size.radius == pytest.approx(0.632, abs=5e-4)
    assert size.capacity / 9.81 == pytest.approx(615.0, rel=0.015)
    assert parse_size("255/55R18", 108).capacity / 9.81 == pytest.approx(1000.0, rel=0.015)
    assert parse_size("P255/35ZR19 96Y") == parse_size("255/35R19", 96)


@pytest.mark.parametrize("text", ["205-55-16", "", "205/55B16 91", "999/55R16 91", "205/55R99 91"])
def test_what_is_no_size_is_refused(text):
    with pytest.raises(TwinError, match="tyre size is"):
        parse_size(text)


def test_size_without_load_index_is_refused():
    with pytest.raises(TwinError, match="load index of '205/55R16' is missing; allowed: 50 to 130"):
        parse_size("205/55R16")


def test_tyre_of_a_size_is_read_and_has_its_figures(tmp_path):
    size = parse_size("205/55R16 91V")
    (tmp_path / "new.tir").write_text(tyre_text(size, "205/55R16"))
    tyre = read_tyre(tmp_path / "new.tir")
    load = float(tyre["fnomin"])
    assert load == pytest.approx(4000.0, rel=0.02)
    assert tyre["unloaded_radius"] == pytest.approx(size.radius, rel=1e-5)
    assert 180e3 < tyre["vertical_stiffness"] < 260e3
    assert stiffness(tyre, load, 0.0)[1] / load == pytest.approx(15.2, rel=1e-4)


def test_car_of_a_few_figures_weighs_and_stands_as_they_say(golf):
    twin = Twin(Vehicle.load(golf))
    loads = twin.tyre_forces()[:, 2]
    assert loads.sum() == pytest.approx(1400.0 * 9.81, rel=1e-3)
    assert loads[:2].sum() / loads.sum() == pytest.approx(0.6, abs=2e-3)
    states = twin.read_states()
    assert abs(states[4]) < 0.005  # pitch
    assert states[2] == pytest.approx(read_car(golf)["imu"]["height"], abs=2e-3)


def test_driven_axle_is_the_one_that_was_named(golf):
    assert Vehicle.load(golf).figures.drive_front == 1.0


def test_figures_are_known_and_rules_are_guesses(golf):
    guesses, total = car_guesses(golf)
    names = {guess.name for guess in guesses}
    known = {"chassis.mass", "chassis.cm_to_front_axle", "geometry.wheelbase"}
    known |= {"geometry.track_front", "geometry.track_rear", "drivetrain.drive_front"}
    known |= {"tyre.front.radius", "tyre.rear.radius"}
    assert len(guesses) == total - len(known)
    assert names.isdisjoint(known)
    assert {"chassis.Jzz", "suspension.front.stiffness", "steering.ratio"} <= names
    assert all(guess.sd > 0.0 for guess in guesses if guess.value != 0.0)


def test_field_that_is_changed_is_no_guess_any_more(golf):
    text = golf.read_text()
    line = next(line for line in text.splitlines() if line.startswith("Jzz = "))
    golf.write_text(text.replace(line, "Jzz = 2000.0"))
    assert "chassis.Jzz" not in {guess.name for guess in car_guesses(golf)[0]}
    assert np.isfinite(Vehicle.load(golf).compile().body_mass).all()


def test_figure_that_nobody_gave_is_a_guess(tmp_path):
    figures = Figures(mass=1400.0, known=frozenset({"mass"}))
    guesses, _ = car_guesses(write_template(str(tmp_path / "my"), figures))
    names = {guess.name for guess in guesses}
    assert "chassis.mass" not in names
    assert {"geometry.wheelbase", "chassis.cm_to_front_axle"} <= names


def test_every_field_of_an_untouched_template_is_a_guess(tmp_path):
    guesses, total = car_guesses(write_template(str(tmp_path / "my")))
    assert len(guesses) == total
    fields = {guess.name.rpartition(".")[2] for guess in guesses}
    assert fields == set(ABSOLUTE) | set(RELATIVE)


@pytest.mark.parametrize(
    ("figure", "message"),
    [({"mass": 10.0}, "mass is 10; allowed: 300"), ({"front_share": 60.0}, "front-share is 60")],
)
def test_figures_of_no_car_are_refused(figure, message):
    with pytest.raises(TwinError, match=message):
        Figures(**figure)


def test_existing_tyre_is_not_written_over(tmp_path):
    (tmp_path / "golf.tir").write_text("precious")
    with pytest.raises(TwinError, match=r"golf\.tir: is there already"):
        write_template(str(tmp_path / "golf"), GOLF)
    assert (tmp_path / "golf.tir").read_text() == "precious"
    assert not (tmp_path / "golf.toml").exists()


def test_commands_write_a_car_and_a_tyre(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["new-car", "golf", "--mass", "1400", "--tyre", "205/55R16 91V"]) == 0
    assert main(["new-tyre", "195/65R15", "--load-index", "91"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {
        "golf.toml",
        "golf.tir",
        "195_65r15.tir",
    }
    assert main(["new-tyre", "195/65R15"]) == 2
    assert "load index" in capsys.readouterr().err
