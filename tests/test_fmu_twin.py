"""An FMU behind the observer. It is made here, from Python, with the binaries of PythonFMU."""

import re
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from pythonfmu.builder import FmuBuilder

from estimators.black_box import BlackBox
from estimators.til.law import ParameterLaw
from estimators.til.observer import Observer
from twin import Drive, FmuNames, FmuTwin, TwinError

LAW = ParameterLaw(parameter="mass", signal="ax", scale=10.0, prior_sd=10.0, noise_density=1e-3)
CART = '''
from pythonfmu import Fmi2Causality as C, Fmi2Slave, Fmi2Variability, Integer, Real


class Cart(Fmi2Slave):
    """A mass that is pushed along a line against drag."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.force, self.v0, self.m, self.length, self.wheels = 0.0, 0.0, 10.0, 1.0, 4
        self.position = self.velocity = 0.0
        self.register_variable(Real("force", causality=C.input))
        self.register_variable(Real("v0", causality=C.parameter, variability=Fmi2Variability.fixed))
        self.register_variable(
            Real("m", causality=C.parameter, variability=Fmi2Variability.tunable)
        )
        self.register_variable(
            Real("length", causality=C.parameter, variability=Fmi2Variability.fixed)
        )
        self.register_variable(Real("a", causality=C.output, getter=self.acceleration))
        self.register_variable(Real("speed", causality=C.output, getter=lambda: self.velocity))
        self.register_variable(Real("position", causality=C.local))
        self.register_variable(Real("velocity", causality=C.local))
        self.register_variable(
            Real("deaf", causality=C.local, getter=lambda: 1.0, setter=lambda value: None)
        )
        self.register_variable(
            Integer("wheels", causality=C.local, variability=Fmi2Variability.discrete)
        )

    def acceleration(self):
        return (self.force - self.velocity) / self.m

    def exit_initialization_mode(self):
        self.position, self.velocity = 0.0, self.v0

    def do_step(self, time, dt):
        if abs(self.velocity) > 1e3:
            raise ValueError("faster than any cart")
        a = self.acceleration()
        self.position += dt * self.velocity
        self.velocity += dt * a
        return True
'''
NAMES = FmuNames(
    dt=0.01,
    inputs={"force": "force"},
    outputs={"ax": "a", "vx": "speed"},
    states={"x": "position", "vx": "velocity"},
    parameters={"mass": "m"},
    speed="v0",
)


class Cart:
    """The same in Python."""

    inputs, outputs, states, parameters = ("force",), ("ax", "vx"), ("x", "vx"), ("mass",)
    dt = 0.01

    def __init__(self):
        self.mass = 10.0
        self.reset()

    def reset(self, speed=0.0):
        self.x = np.array([0.0, speed])

    def step(self, u):
        y = np.array([(u[0] - self.x[1]) / self.mass, self.x[1]])
        self.x += self.dt * np.array([self.x[1], y[0]])
        return y

    def correct(self, dx):
        self.x += dx

    def set_parameters(self, p):
        self.mass = max(10.0 + p[0], 1.0)
        return np.array([self.mass - 10.0])

    def read_states(self):
        return self.x.copy()


def rewritten(fmu, target, edit):
    """A copy of an FMU with its description edited."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(target, "w") as copy:
        for name in source.namelist():
            content = source.read(name)
            if name == "modelDescription.xml":
                content = edit(content.decode()).encode()
            copy.writestr(name, content)
    return target


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    """The cart, whose mass is at least 1 kg."""
    folder = tmp_path_factory.mktemp("fmu")
    script = folder / "cart.py"
    script.write_text(CART)
    made = FmuBuilder.build_FMU(script, dest=folder)
    return rewritten(
        made,
        folder / "bounded.fmu",
        lambda text: re.sub(r'(name="m".*?<Real )', r'\1min="1" ', text, count=1, flags=re.S),
    )


def changed(**changes):
    content = {name: getattr(NAMES, name) for name in NAMES.__slots__}
    return FmuNames(**(content | changes))


def cart_drive(mass):
    """A cart of that mass, as it is."""
    box = Cart()
    box.set_parameters([mass - 10.0])
    force = 20.0 * np.sin(np.arange(500)[:, None] * 0.05)
    return Drive(
        time=0.01 * np.arange(500),
        inputs=force,
        input_names=box.inputs,
        measurements=np.array([box.step(u) for u in force]),
        output_names=box.outputs,
    )


def test_an_fmu_is_a_black_box(fmu):
    box = FmuTwin(fmu, NAMES)
    assert isinstance(box, BlackBox)
    assert (box.inputs, box.outputs) == (("force",), ("ax", "vx"))
    assert (box.states, box.parameters) == (("x", "vx"), ("mass",))
    assert box.nominal.tolist() == [10.0]


def test_observer_over_an_fmu_estimates_to_the_bit_what_it_does_over_the_same_model_in_python(fmu):
    drive = cart_drive(14.0)
    found = []
    for box in (FmuTwin(fmu, NAMES), Cart()):
        observer = Observer(box, [LAW], {("vx", "vx"): 2.0, ("x", "vx"): 0.3})
        observer.reset(1.0, {"mass": -2.0})
        found.append(observer.run(drive))
    theirs, ours = found
    assert np.ptp(theirs["mass"]) > 1.0
    assert theirs["mass"][-1] == pytest.approx(4.0, abs=0.15)
    for name in ("states", "parameters", "outputs"):
        np.testing.assert_array_equal(getattr(theirs, name), getattr(ours, name))


def test_correction_adds_to_the_states(fmu):
    box = FmuTwin(fmu, NAMES)
    box.correct([2.0, -3.0])
    box.correct([0.5, 0.0])
    np.testing.assert_array_equal(box.read_states(), [2.5, -3.0])
    assert box.step([0.0]).tolist() == [0.3, -3.0]


def test_reset_starts_at_a_speed_and_keeps_the_load(fmu):
    box = FmuTwin(fmu, NAMES)
    assert box.set_parameters([10.0]).tolist() == [10.0]
    first = box.step([40.0])
    box.reset(4.0)
    np.testing.assert_array_equal(box.read_states(), [0.0, 4.0])
    assert first.tolist() == [2.0, 0.0]
    assert box.step([40.0]).tolist() == [1.8, 4.0]


def test_parameters_keep_to_the_bounds_that_the_fmu_declares(fmu):
    box = FmuTwin(fmu, NAMES)
    assert box.set_parameters([-20.0]).tolist() == [-9.0]
    assert box.step([40.0])[0] == 40.0


def test_fmus_do_not_share_their_state(fmu):
    moved, still = FmuTwin(fmu, NAMES), FmuTwin(fmu, NAMES)
    moved.correct([5.0, 5.0])
    moved.set_parameters([3.0])
    assert still.read_states().tolist() == [0.0, 0.0]
    assert still.step([10.0])[0] == 1.0


def test_nothing_is_left_behind(fmu, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    box = FmuTwin(fmu, NAMES)
    assert [path.name.startswith("fmu-") for path in tmp_path.iterdir()] == [True]
    del box
    with pytest.raises(TwinError, match="deaf"):
        FmuTwin(fmu, changed(states={"x": "deaf"}))
    assert list(tmp_path.iterdir()) == []


def test_entries_that_point_outside_stay_inside(fmu, tmp_path, monkeypatch):
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    monkeypatch.setattr(tempfile, "tempdir", str(inner))
    wicked = rewritten(fmu, tmp_path / "wicked.fmu", lambda text: text)
    with zipfile.ZipFile(wicked, "a") as archive:
        archive.writestr("../../outside.txt", "x")
    box = FmuTwin(wicked, NAMES)
    assert not list(tmp_path.glob("outside.txt")) + list(inner.parent.glob("outside.txt"))
    assert box.step([10.0])[0] == 1.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"inputs": {"force": "thrust"}},
            "'thrust', which is no variable of the FMU; allowed: f",
        ),
        (
            {"inputs": {"force": "velocity"}},
            "local, continuous; allowed: an input$",
        ),
        (
            {"parameters": {"mass": "length"}},
            "parameter, fixed; allowed: an input or a tunable",
        ),
        ({"outputs": {"n": "wheels"}}, "'wheels' is of type Integer; allowed: Real"),
        ({"states": {"x": "deaf"}}, "state 'x', its 'deaf', stays 1 when it is set to 2"),
    ],
)
def test_names_that_do_not_fit_are_refused(fmu, changes, message):
    with pytest.raises(TwinError, match=message):
        FmuTwin(fmu, changed(**changes))


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda text: text.replace('fmiVersion="2.0"', 'fmiVersion="1.0"'), "FMI|FMU"),
        (lambda text: text.replace("CoSimulation", "ModelExchange"), "model exchange|FMU"),
        (lambda text: text.replace("</fmiModelDescription>", ""), "is not an FMU"),
    ],
)
def test_files_that_are_no_such_fmu_are_refused(fmu, tmp_path, edit, message):
    bad = rewritten(fmu, tmp_path / "bad.fmu", edit)
    with pytest.raises(TwinError, match=rf"bad\.fmu: .*({message})"):
        FmuTwin(bad, NAMES)


def test_missing_files_and_others_are_refused(tmp_path):
    with pytest.raises(TwinError, match="there is no such file"):
        FmuTwin(tmp_path / "none.fmu", NAMES)
    (tmp_path / "text.fmu").write_text("x")
    with pytest.raises(TwinError, match="is not an FMU that can be read"):
        FmuTwin(tmp_path / "text.fmu", NAMES)


def test_fmus_for_other_machines_are_refused(fmu, tmp_path):
    other = tmp_path / "other.fmu"
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(other, "w") as copy:
        for name in source.namelist():
            if "linux" not in name:
                copy.writestr(name, source.read(name))
    with pytest.raises(TwinError, match=r"has binaries for win64; this machine, a .*, needs linux"):
        FmuTwin(other, NAMES)


def test_a_missing_package_is_one_clear_error(fmu, monkeypatch):
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(TwinError, match=re.escape("pip install 'twin-in-the-loop[fmi]'")):
        FmuTwin(fmu, NAMES)


def test_an_fmu_that_fails_is_one_clear_error_with_what_it_said(fmu):
    box = FmuTwin(fmu, NAMES)
    box.correct([0.0, 2e3])
    with pytest.raises(TwinError, match=r"(?s)fails at t = 0 s: .*faster than any cart"):
        box.step([0.0])
    with pytest.raises(TwinError, match="has failed for good; open it anew"):
        box.reset()


def test_an_fmu_without_a_speed_starts_at_rest_only(fmu):
    box = FmuTwin(fmu, changed(speed=None))
    with pytest.raises(TwinError, match="no variable for the speed"):
        box.reset(3.0)
    box.reset(0.0)


@pytest.mark.parametrize(
    ("method", "values"),
    [("step", [0.0, 0.0]), ("correct", [np.nan, 0.0]), ("set_parameters", [np.inf])],
)
def test_bad_arrays_are_refused(fmu, method, values):
    with pytest.raises(TwinError, match=rf"bounded\.fmu {method}: .*must be \d finite numbers"):
        getattr(FmuTwin(fmu, NAMES), method)(values)


def test_names_are_read_from_a_file(tmp_path):
    file = tmp_path / "names.toml"
    file.write_text(
        'dt = 0.01\nspeed = "v0"\n[inputs]\nforce = "force"\n[outputs]\nax = "a"\nvx = "speed"\n'
        '[states]\nx = "position"\nvx = "velocity"\n[parameters]\nmass = "m"\n'
    )
    assert FmuNames.load(file) == NAMES


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("dt = ", "cannot be read as TOML"),
        ("dt = 0.01\n[inputs]\n", r"lacks \['outputs'\]"),
        ("dt = 0.01\nrate = 1\n[inputs]\n[outputs]\n", r"unknown \['rate'\]; allowed keys: dt"),
        ("dt = 0.01\n[inputs]\n[outputs]\n", "outputs is empty"),
        ("dt = -1\n[inputs]\n[outputs]\nax = 'a'\n", "dt is -1; allowed: 0 to 10 s"),
        ("dt = 0.01\n[inputs]\n[outputs]\nax = 3\n", "outputs.ax is 3; allowed: a variable's name"),
    ],
)
def test_bad_name_files_are_refused(tmp_path, text, message):
    file = tmp_path / "names.toml"
    file.write_text(text)
    with pytest.raises(TwinError, match=rf"names\.toml: .*{message}"):
        FmuNames.load(file)
    with pytest.raises(TwinError, match="cannot be read as TOML"):
        FmuNames.load(Path(tmp_path / "none.toml"))
