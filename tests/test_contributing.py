"""Does what CONTRIBUTING.md says in a copy of the project, and counts the files that it takes."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

import models
from scenarios.__main__ import program
from twin import WHEELS

ROOT = Path(__file__).parents[1]
ROOMS = ("models", "twin", "estimators", "scenarios")

ESTIMATOR = '''"""Believes that no car ever slips."""

import numpy as np

from estimators.base import sideslip_estimate
from estimators.entry import Entry


class Straight:
    """See `estimators.base.Estimator`."""

    def reset(self, speed, parameters=None, road=None):
        """Nothing to reset."""

    def run(self, drive):
        return sideslip_estimate(drive.time, np.zeros(len(drive)))


ENTRY = Entry(name="straight", words="no slip", make=lambda _: Straight(), gives=("sideslip",))
'''
SCENARIO = '''"""A sports car drives gently."""

from scenarios.experiment import sideslip_and_mass
from scenarios.experiment.experiment import Experiment, Recipe

EXPERIMENT = Experiment(
    name="gentle",
    cases=(sideslip_and_mass.case("same", "laps"),),
    estimators={"straight": Recipe(estimator="straight")},
    quantities=("sideslip",),
    metrics=sideslip_and_mass.sideslip_and_mass,
)
'''
USE_OF_ESTIMATOR = """
from estimators.entry import Given
from estimators.registry import usable
from scenarios.cli.catalogue import scenario
from scenarios.experiment.engine import recipe
from scenarios.experiment.experiment import Run
assert "straight" in usable(Given(), ())
laps = scenario("laps")
assert recipe(Run(experiment=laps, case=laps.cases[0], estimator="straight")).estimator
assert scenario("gentle").estimators["straight"].estimator == "straight"
"""
TYRE = '''"""A tyre whose side force is -C (alpha - alpha^3)."""

from twin.toml_fields import Field
from twin.tyre.shapes import compiled

FIELDS = (Field("cubic_cornering", "1/rad", 10.0, 1.0, 100.0, "cornering stiffness over load"),)


@compiled
def cubic_forces(tyre, fz, kappa, alpha, gamma, vx, side):
    zero = 0.0 * fz
    return zero, -tyre.cubic_cornering * fz * (alpha - alpha * alpha * alpha), zero, zero, zero


@compiled
def cubic_stiffness(tyre, fz, gamma):
    return 0.0 * fz, tyre.cubic_cornering * fz


@compiled
def cubic_relaxation(tyre, fz, gamma):
    return 0.3 + 0.0 * fz, 0.3 + 0.0 * fz
'''
USE_OF_TYRE = """
from twin.tyre.files import read_tyre_file
from twin.tyre.interface import forces, relaxation, stiffness
tyre = read_tyre_file("cubic.toml")
assert abs(forces(tyre, 1000.0, 0.0, 0.1, 0.0, 20.0, 1.0)[1] + 990.0) < 1e-9
assert stiffness(tyre, 1000.0, 0.0) == (0.0, 1e4)
assert relaxation(tyre, 1000.0, 0.0) == (0.3, 0.3)
"""
# The channel and the parameter in a twin: measured, noisy, corrected by; set, made, estimated
USE_OF_CHANNEL_AND_PARAMETER = """
import numpy as np
from estimators.entry import Given
from estimators.registry import make
from estimators.til.law import ParameterLaw
from twin import INPUTS, OUTPUTS, PARAMETERS, STATES, Drive, P, Twin, Vehicle, X, Y, noise_sd

suv = Vehicle.load("suv")
plain, set_, made = Twin(suv), Twin(suv), Twin(suv.scaled(anti_roll=1.5))
p = np.zeros(len(PARAMETERS))
p[P.anti_roll] = 0.5
assert set_.set_parameters(p)[P.anti_roll] == 0.5
u = np.zeros((300, len(INPUTS)))
u[:, 0] = 1.0
records, rates = [], []
for twin in (plain, set_, made):
    twin.reset(20.0)
    rate = []
    y = []
    for sample in u:
        rate.append(twin.read_states()[X.suspension_rate_fl])
        y.append(twin.step(sample))
    records.append(np.array(y))
    rates.append(rate)
    assert np.allclose(records[-1][:, Y.suspension_rate_fl], rate, atol=1e-9)
assert np.allclose(records[1], records[2], atol=1e-9)
assert np.abs(records[1] - records[0]).max() > 1e-3
drive = Drive(time=0.001 * np.arange(300), inputs=u, input_names=INPUTS, measurements=records[1],
              output_names=OUTPUTS)
sd = noise_sd(drive.measurements, 20.0)
assert sd[Y.suspension_rate_fl] == 0.01
law = ParameterLaw(parameter="anti_roll", signal="suspension_rate_fl", scale=1.0, prior_sd=0.2,
                   noise_density=1.0)
gains = {("suspension_rate_fl", "suspension_rate_fl"): 1.0}
observer = make("til", Given(vehicle=suv, laws=[law], gains=gains))
observer.reset(20.0)
assert np.abs(observer.run(drive)["anti_roll"]).max() > 1e-6
"""


@pytest.fixture
def copy(tmp_path):
    for room in ROOMS:
        ignore = shutil.ignore_patterns("__pycache__", "*.nb[ic]")
        shutil.copytree(ROOT / room, tmp_path / room, ignore=ignore)
    return tmp_path


def edit(path, *pairs):
    """Replaces strings of a file, each of which is there."""
    text = path.read_text()
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new, 1)
    path.write_text(text)


def touched(copy):
    """Files of the copy that are not as in the project."""
    found = []
    for room in ROOMS:
        for file in (copy / room).rglob("*"):
            ours = ROOT / file.relative_to(copy)
            kept = file.suffix in (".py", ".xml", ".toml", ".tir")
            if kept and not (ours.is_file() and ours.read_bytes() == file.read_bytes()):
                found.append(str(file.relative_to(copy)))
    return sorted(found)


def python(copy, *arguments):
    """Runs Python in the copy; what it wrote."""
    done = subprocess.run(
        [sys.executable, *arguments], cwd=copy, env={"PYTHONPATH": str(copy)},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_estimator_is_two_files_and_scenario_one(copy):
    (copy / "estimators/straight.py").write_text(ESTIMATOR)
    edit(
        copy / "estimators/registry.py",
        ("from estimators.base", "from estimators import straight\nfrom estimators.base"),
        ("        static_map.ENTRY,\n", "        static_map.ENTRY,\n        straight.ENTRY,\n"),
    )
    assert touched(copy) == ["estimators/registry.py", "estimators/straight.py"]
    (copy / "scenarios/gentle.py").write_text(SCENARIO)
    assert "A sports car drives gently" in python(copy, "-m", "scenarios", "list")
    python(copy, "-c", USE_OF_ESTIMATOR)


def test_tyre_model_is_two_files(copy):
    (copy / "twin/tyre/cubic.py").write_text(TYRE)
    edits = [
        ("import linear\n", "import cubic, linear\n"),
        ('{"linear"', '{"cubic": (2.0, cubic.FIELDS), "linear"'),
        (
            "from twin.tyre.linear import",
            "from twin.tyre.cubic import cubic_forces, cubic_relaxation, cubic_stiffness\n"
            "from twin.tyre.linear import",
        ),
    ]
    edit(copy / "twin/tyre/interface.py", *edits)
    interface = copy / "twin/tyre/interface.py"
    for function, arguments in (
        ("forces", "tyre, fz, kappa, alpha, gamma, vx, side"),
        ("stiffness", "tyre, fz, gamma"),
        ("relaxation", "tyre, fz, gamma"),
    ):
        head, name, body = interface.read_text().partition(f"def {function}(")
        ours = (
            f"    if _is(tyre, 2.0):\n        out = cubic_{function}({arguments})\n    return out"
        )
        interface.write_text(head + name + body.replace("    return out", ours, 1))
    assert touched(copy) == ["twin/tyre/cubic.py", "twin/tyre/interface.py"]
    (copy / "cubic.toml").write_text('model = "cubic"\nunloaded_radius = 0.3\n')
    python(copy, "-c", USE_OF_TYRE)


def test_channel_is_one_file_beside_the_cars_and_parameter_two(copy):
    edit(
        copy / "twin/channels.py",
        (
            '_TRAVEL_RATES = _channels(_wheels("suspension_rate"), "speed")\n',
            "_TRAVEL_RATES = tuple(\n"
            '    channel for name in _wheels("suspension_rate") for channel in _sensor(\n'
            '        [name], name, sensor_kind="jointvel", quantity="speed",\n'
            "        low=-20.0, high=20.0, noise_floor=0.01, noise_by_snr=False))\n",
        ),
        (
            "_OUTPUTS = (*_ACCELERATIONS, *_RATES, *_WHEEL_SPEEDS)",
            "_OUTPUTS = (*_ACCELERATIONS, *_RATES, *_WHEEL_SPEEDS, *_TRAVEL_RATES)",
        ),
    )
    sensors = "".join(
        f'    <jointvel name="suspension_rate_{wheel}" joint="travel_{wheel}"/>\n'
        for wheel in WHEELS
    )
    edit(copy / "models/suv.xml", ("  </sensor>", f"{sensors}  </sensor>"))
    assert touched(copy) == ["models/suv.xml", "twin/channels.py"]
    edit(
        copy / "twin/parameters.py",
        (
            '        ("damper", 0.15,',
            '        ("anti_roll", 0.2, 0.01, "roll_rate", "the anti-roll bars", "drive bends"),\n'
            '        ("damper", 0.15,',
        ),
    )
    edit(
        copy / "twin/scales.py",
        (
            '    "damper": (',
            '    "anti_roll": (Target("model", "tendon_stiffness"),),\n    "damper": (',
        ),
    )
    assert touched(copy)[2:] == ["twin/parameters.py", "twin/scales.py"]
    python(copy, "-c", USE_OF_CHANNEL_AND_PARAMETER)


def test_car_drives_laps_with_its_file_and_tyres_only(tmp_path):
    (tmp_path / "tyres").mkdir()
    shutil.copy(models.path("tyres/suv.tir"), tmp_path / "tyres/own.tir")
    text = models.path("suv").read_text().replace("tyres/suv.tir", "tyres/own.tir")
    (tmp_path / "own.xml").write_text(text.replace('model="suv"', 'model="own"'))
    command = ["run", "laps", "--duration", "1", "--car", str(tmp_path / "own.xml"), "--json", "-"]
    done = CliRunner().invoke(program, [*command, "--estimator", "til", "--estimator", "zero"])
    assert done.exit_code == 0, done.output
    assert '"estimator": "til"' in done.output


def test_scenario_that_keeps_its_car_says_so():
    done = CliRunner().invoke(program, ["run", "mass", "--car", "sports_car"])
    assert done.exit_code == 2
    assert "mass: car is 'sports_car'; allowed: none" in done.output
