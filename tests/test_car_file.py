"""Cars described in TOML."""

import numpy as np
import pytest
from cars import inputs, run, times

import models
from twin import Twin, TwinError, Vehicle
from twin.car.fields import SECTIONS
from twin.car.template import template, write_template
from twin.tyre.magic_formula import magic_formula, relaxation_lengths, slip_stiffnesses

FIELDS = [(section, field) for section in SECTIONS for field in section.fields]
NUMBERS = [(s, f) for s, f in FIELDS if not isinstance(f.default, str)]


@pytest.fixture
def car(tmp_path):
    """A function that loads a car from a TOML text."""

    def load(text):
        path = tmp_path / "car.toml"
        path.write_text(text)
        return Vehicle.load(path)

    return load


def test_template_is_the_suv(tmp_path, monkeypatch):
    """Its arrays, but for what the MJCF rounds to 0.1 mm and the IMU's place."""
    monkeypatch.chdir(tmp_path)
    written, suv = Vehicle.load(write_template("mine")).compile(), Vehicle.load("suv").compile()
    same = ("body_mass", "body_inertia", "body_pos", "body_ipos", "dof_damping", "jnt_stiffness")
    same += ("tendon_stiffness", "tendon_lengthspring", "numeric_data", "geom_pos", "geom_size")
    for name in same:
        np.testing.assert_allclose(
            getattr(written, name), getattr(suv, name), rtol=1e-12, atol=1e-12, err_msg=name
        )
    for name in ("jnt_axis", "qpos_spring"):
        np.testing.assert_allclose(getattr(written, name), getattr(suv, name), atol=5e-5)
    assert written.opt.timestep == suv.opt.timestep
    assert (written.opt.disableflags, written.nv) == (suv.opt.disableflags, suv.nv)


def test_suv_as_toml_answers_a_step_of_steering_as_the_mjcf_does(car):
    """To 3e-4 of each peak: the MJCF's springs are rounded to 0.1 mm."""
    step = np.where(times(2.0) > 0.2, 0.6, 0.0)
    answers = []
    for vehicle in (car(template("suv")), Vehicle.load("suv")):
        twin = Twin(vehicle)
        twin.reset(20.0)
        answers.append(run(twin, inputs(2.0, steering=step)).outputs)
    scale = np.abs(answers[1]).max(axis=0)
    assert (
        np.abs((answers[0] - answers[1]) / scale).max() < 3e-4
    )  # of its peak; the MJCF's springs are rounded


def test_every_field_of_the_template_is_written_with_its_default_unit_and_range():
    text = template("mine")
    for section, field in FIELDS:
        part = text.split(f"[{section.name}]\n")[1].split("\n\n")[0]
        (line,) = [
            line for line in part.splitlines() if line.lstrip("# ").startswith(field.name + " =")
        ]
        assert isinstance(field.default, str) or f"{field.least:g} to {field.largest:g}" in line
        assert field.unit in ("", "1") or f" {field.unit}" in line


@pytest.mark.parametrize(("section", "field"), NUMBERS, ids=lambda part: part.name)
def test_every_number_of_the_file_reaches_the_car(car, section, field):
    """A changed field changes the model or the tyres."""
    value = field.default * 1.05 + (0.01 if field.default == 0.0 else 0.0)
    plain = _arrays(car(""))
    changed = _arrays(car(f"[{section.name}]\n{field.name} = {value!r}\n"))
    assert any(changed[name] != plain[name] for name in plain)


def _arrays(vehicle):
    """All numbers of a compiled car and its tyres."""
    model = vehicle.compile()
    arrays = {name: getattr(model, name) for name in dir(model) if name != "names"}
    arrays = {name: a.tobytes() for name, a in arrays.items() if isinstance(a, np.ndarray)}
    return arrays | {"tyres": vehicle.tyres().tobytes()}


def test_car_stands_level_at_its_heights(car):
    twin = Twin(car("[chassis]\nmass = 900\ncm_to_front_axle = 1.0\n[geometry]\nwheelbase = 2.4\n"))
    assert abs(twin.read_states()[4]) < 0.005  # pitch [rad]: tyres of one height carry two loads
    loads = twin.tyre_forces()[:, 2]
    share = 1.0 - 1.0 / 2.4
    assert loads[:2].sum() == pytest.approx(9.81 * (900 * share + 106), rel=1e-2)


def test_imu_elsewhere_feels_the_turning_body(car):
    rates = []
    for text in ("", "[imu]\nto_front_axle = 0.25\n"):
        twin = Twin(car(text))
        twin.reset(15.0)
        rates.append(run(twin, inputs(1.0, steering=0.5 * np.sin(6.0 * times(1.0)))).outputs)
    yaw_acceleration = np.gradient(rates[0][:, 5], 1e-3)
    difference = rates[1][:, 1] - rates[0][:, 1]
    np.testing.assert_allclose(difference[50:], yaw_acceleration[50:], atol=0.02)


def test_figures_of_a_tyre_are_those_of_the_car_that_has_it(car):
    tyre = car(
        "[tyre.front]\nnominal_load = 4000\nfriction = 1.2\nload_sensitivity = 0.2\n"
        "cornering_coefficient = 20\nrelaxation_length = 0.3\nradius = 0.31\n"
    ).tyres()[0]
    assert slip_stiffnesses(tyre, 4000.0, 0.0)[1] == pytest.approx(20 * 4000, rel=1e-9)
    assert relaxation_lengths(tyre, 4000.0, 0.0)[1] == pytest.approx(0.3, rel=1e-9)
    angles = np.linspace(-0.5, 0.5, 2001)
    for load, friction in ((4000.0, 1.2), (8000.0, 0.96)):
        peaks = [magic_formula(tyre, load, 0.0, a, 0.0, 20.0, 1.0)[1] / load for a in angles]
        offset = (tyre["pvy1"] + tyre["pvy2"] * (load / 4000.0 - 1.0)) * tyre["lmuy"]
        assert max(peaks) - offset == pytest.approx(friction, rel=1e-3)


def test_defaults_of_tyre_figures_are_those_of_the_shipped_tyre(car):
    figures = "".join(
        f"{field.name} = {field.default!r}\n"
        for section, field in NUMBERS
        if section.name == "tyre.front"
    )
    scaled, shipped = car(f"[tyre.front]\n{figures}").tyres()[0], Vehicle.load("suv").tyres()[0]
    for name in scaled.dtype.names:
        assert scaled[name] == pytest.approx(shipped[name], rel=2e-3, abs=1e-12), name


def test_tyre_file_beside_the_car_is_read(car, tmp_path):
    text = (
        models.path("tyres/suv.tir").read_text().replace("PDX1                = 1.05", "PDX1 = 1.5")
    )
    (tmp_path / "own.tir").write_text(text)
    tyres = car('[tyre.rear]\nfile = "own.tir"\n').tyres()
    assert tyres["pdx1"].tolist() == [1.05, 1.05, 1.5, 1.5]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("chasis = 1", "chasis is unknown; allowed: aerodynamics, chassis"),
        ("[chassis]\nweight = 1", "chassis.weight is unknown; allowed: mass, cm_to_front_axle"),
        ("[chassis]\nmass = 'much'", "chassis.mass is 'much'; allowed: a number from 100 to 50000"),
        ("[chassis]\nmass = true", "chassis.mass is True; allowed: a number"),
        ("[chassis]\nmass = 1", "chassis.mass is 1; allowed: a number from 100 to 50000"),
        ("[chassis]\nmass = nan", "chassis.mass is nan; allowed: a number from 100 to 50000"),
        ("chassis = 1", "chassis is 1; allowed: a table"),
        ("[suspension]\nstiffness = 1", "suspension.stiffness is unknown; allowed: front, rear"),
        ("[tyre.front]\nfile = 3", "tyre.front.file is 3; allowed: a text"),
        ("[tyre.front]\nfile = 'no.tir'", "no.tir': cannot read the tyre file"),
        ("[tyre.front]\nfile = '/etc/passwd'", "tyre is '/etc/passwd'; allowed: a file in the"),
        ("[tyre.front]\nfile = '../a.tir'", "tyre is '../a.tir'; allowed: a file in the car's"),
        ("[chassis]\nJxx = 20000", "inertia"),
        ("[chassis", "is no TOML"),
        ("a = " + "[" * 5000, "is no TOML"),
        ("#" * 100_001, "more than 100000 bytes"),
    ],
)
def test_fault_of_a_car_is_one_line_that_names_it(car, text, message):
    with pytest.raises(TwinError) as caught:
        car(text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_template_is_never_written_over(tmp_path):
    path = write_template(str(tmp_path / "mine"))
    path.write_text("precious")
    with pytest.raises(TwinError, match=r"mine\.toml: is there already; allowed: a name"):
        write_template(str(tmp_path / "mine"))
    assert path.read_text() == "precious"
