"""`til check-car`: a car's figures against closed forms, and wrong numbers that it finds."""

import math
import re

import pytest

from scenarios.__main__ import main
from scenarios.car_check.check import RANGES, as_text, check_car
from twin import TwinError
from twin.car.rules import Figures
from twin.car.template import write_template
from twin.car.toml_car import read_car
from twin.tyre.size import parse_size

GOLF = Figures(
    mass=1400.0,
    wheelbase=2.65,
    track=1.53,
    front_share=0.6,
    drive_front=1.0,
    tyre=parse_size("205/55R16 91V"),
)


@pytest.fixture(scope="module")
def golf(tmp_path_factory):
    return write_template(str(tmp_path_factory.mktemp("cars") / "golf"), GOLF)


@pytest.fixture(scope="module")
def checked(golf):
    return check_car(str(golf))


def values(checked):
    return {check.name: check.value for check in checked.checks}


def odd(checked):
    return {check.name for check in checked.checks if not check.good}


def changed(golf, tmp_path, **fields):
    """A copy of the car with other values for some fields, on both axles where there are two."""
    text = golf.read_text()
    for field, value in fields.items():
        text, count = re.subn(rf"(?m)^{field} = \S+", f"{field} = {value}", text)
        assert count
    (tmp_path / "golf.tir").write_bytes((golf.parent / "golf.tir").read_bytes())
    path = tmp_path / "other.toml"
    path.write_text(text)
    return str(path)


def test_car_made_from_usual_figures_is_usual(checked):
    assert odd(checked) == set()
    assert [check.name for check in checked.checks] == list(RANGES)
    assert "Every figure is in the usual range." in as_text(checked)


def test_figures_at_rest_are_those_that_the_car_was_made_from(checked, golf):
    found, file = values(checked), read_car(golf)
    assert found["mass"] == pytest.approx(1400.0, rel=1e-4)
    assert found["weight on the front axle"] == pytest.approx(60.0, abs=0.2)
    assert found["left against right"] == pytest.approx(0.0, abs=1e-3)
    gyration = math.sqrt(file["chassis"]["Jxx"] / file["chassis"]["mass"])
    assert found["roll gyration over track"] == pytest.approx(gyration / 1.53, rel=0.02)


def test_ride_and_hop_are_those_of_a_quarter_car(checked, golf):
    """Two masses on two springs, the axles' mean: the body's on the spring and the tyre in series,
    the wheel's between both."""
    file = read_car(golf)
    axles = [file[f"suspension.{axle}"] for axle in ("front", "rear")]
    spring = sum(axle["stiffness"] for axle in axles) / 2.0
    unsprung = sum(axle["hub_mass"] + axle["wheel_mass"] for axle in axles) / 2.0
    sprung = 1400.0 / 4.0 - unsprung
    load = 1400.0 * 9.81 / 4.0
    tyre = load / (values(checked)["tyre deflection"] / 1000.0)
    ride = math.sqrt(spring * tyre / (spring + tyre) / sprung) / (2.0 * math.pi)
    hop = math.sqrt((spring + tyre) / unsprung) / (2.0 * math.pi)
    assert values(checked)["ride frequency"] == pytest.approx(ride, rel=0.05)
    assert values(checked)["wheel hop"] == pytest.approx(hop, rel=0.1)


def test_roll_gradient_is_stiffness_and_lever(checked, golf):
    """m a h over the roll stiffness less gravity's share, tyres in series."""
    file, found = read_car(golf), values(checked)
    tyre = 1400.0 * 9.81 / 4.0 / (found["tyre deflection"] / 1000.0)
    roll_stiffness = 0.0
    for axle in ("front", "rear"):
        one = file[f"suspension.{axle}"]
        rate = one["stiffness"] + 2.0 * one["anti_roll"]
        roll_stiffness += 2.0 * (rate * tyre / (rate + tyre)) * (1.53 / 2.0) ** 2
    chassis = file["chassis"]
    axles = [file[f"suspension.{axle}"] for axle in ("front", "rear")]
    centre = sum(axle["roll_centre_height"] for axle in axles) / 2.0
    moment = chassis["mass"] * 9.81 * (chassis["cm_height"] - centre)
    gradient = math.degrees(moment / (roll_stiffness - moment))
    assert found["roll gradient"] == pytest.approx(gradient, rel=0.15)


def test_brakes_and_engine_do_what_their_figures_say(checked):
    found = values(checked)
    assert found["braking by 0.4 g"] == pytest.approx(0.4, rel=0.05)
    speed = 100.0 / 3.6
    least = 0.5 * 1400.0 * speed**2 / 250e3  # all the power from the first moment on
    assert least < found["0 to 100 km/h"] < 4.0 * least


@pytest.mark.parametrize(
    ("fields", "names"),
    [
        ({"Jyy": 700.0, "Jzz": 700.0}, {"yaw inertia over m a b"}),
        ({"damping": 175.0}, {"ride damping", "roll damping"}),
        ({"damping": 9000.0}, {"ride frequency", "wheel hop"}),
        ({"stiffness": 212970.0}, {"ride damping", "pitch frequency"}),
        ({"anti_roll": 0.0}, {"roll gradient"}),
        ({"cm_to_front_axle": 1.9}, {"weight on the front axle", "understeer gradient"}),
        ({"cm_height": 0.9}, {"static stability factor", "load left inside then"}),
        ({"cm_left": 0.4}, {"left against right"}),
        ({"ratio": 1.5}, {"steering ratio"}),
        ({"power": 15000.0}, {"0 to 100 km/h"}),
        ({"wheel_mass": 160.0}, {"wheel hop"}),
    ],
)
def test_wrong_number_is_found(golf, tmp_path, fields, names):
    checked = check_car(changed(golf, tmp_path, **fields))
    assert names <= odd(checked)
    text = as_text(checked)
    assert "Outside the usual range" in text
    assert all(f"{name} " in text for name in names)


def test_guesses_of_the_file_are_counted(checked):
    few, total = checked.guesses
    assert 0 < few < total
    assert f"{few} of {total} fields of the file are guesses." in as_text(checked)


def test_command_prints_the_checks_and_draws(tmp_path, capsys, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    main(["check-car", "suv"])
    assert "understeer gradient" in capsys.readouterr().out
    assert (tmp_path / "suv.check.png").read_bytes().startswith(b"\x89PNG")
    main(["check-car", "suv", "--no-png"])
    assert "shows it" not in capsys.readouterr().out


def test_car_that_cannot_stand_is_refused_in_one_line(golf, tmp_path, capsys):
    assert main(["check-car", changed(golf, tmp_path, stiffness=3000.0)]) == 2
    said = capsys.readouterr().err
    assert re.fullmatch(r"til: .*other.toml: the car does not settle on its wheels .*\n", said)


def test_inertia_that_no_body_has_is_named_in_the_words_of_the_file(golf, tmp_path):
    with pytest.raises(TwinError, match=r"other.toml: chassis: no body has .* Jzz 182 "):
        check_car(changed(golf, tmp_path, Jzz=182.0))
