import ast
import subprocess
import sys
from pathlib import Path

import pytest

import twin

ROOT = Path(__file__).parents[1]
# Each room imports only those to its left.
ROOMS = ("models", "twin", "estimators", "scenarios")
# Besides the public names of twin, what an observer's compiled loop may call
BOUNDARY = {
    f"twin.kernel.{name}"
    for name in ("Car", "step", "correct", "set_parameters", "read_states", "is_sound")
}
PUBLIC = {f"twin.{name}" for name in twin.__all__} | BOUNDARY
HEAVY = {"skopt", "rerun", "pyarrow", "matplotlib", "scipy.optimize"}


def imported_names(source, package):
    """Dotted names that a source file of a package imports, each down to the imported name."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = [*(parents if node.level else []), *([node.module] if node.module else [])]
            yield from (".".join([*base, alias.name]) for alias in node.names)


def violations(source, package):
    """The imports of a source file that the rule for its room forbids."""
    room = package.split(".")[0]
    to_the_right = ROOMS[ROOMS.index(room) + 1 :]
    for name in imported_names(source, package):
        top = name.split(".")[0]
        black_box_opened = room == "estimators" and (
            top == "mujoco" or (top == "twin" and name not in PUBLIC)
        )
        if top in to_the_right or black_box_opened:
            yield name


@pytest.mark.parametrize("room", ROOMS)
def test_room_imports_only_what_lies_to_its_left(room):
    files = sorted((ROOT / room).rglob("*.py"))
    assert files
    found = {
        str(file.relative_to(ROOT)): names
        for file in files
        if (names := list(violations(file.read_text(), _package(file))))
    }
    assert found == {}


@pytest.mark.parametrize(
    ("package", "line", "name"),
    [
        ("models", "import twin", "twin"),
        ("twin", "from estimators.kalman import KalmanBucy", "estimators.kalman.KalmanBucy"),
        ("twin", "def f():\n    import scenarios", "scenarios"),
        ("estimators", "import mujoco", "mujoco"),
        ("estimators", "from mujoco import MjData", "mujoco.MjData"),
        ("estimators", "import twin", "twin"),
        ("estimators", "import twin.car.vehicle as v", "twin.car.vehicle"),
        ("estimators", "from twin import kernel", "twin.kernel"),
        ("estimators", "from twin import *", "twin.*"),
        ("estimators", "from twin.car.vehicle import Vehicle", "twin.car.vehicle.Vehicle"),
        ("estimators", "from twin.kernel import tyre_forces", "twin.kernel.tyre_forces"),
        ("estimators", "from scenarios import lap", "scenarios.lap"),
    ],
)
def test_forbidden_import_is_found(package, line, name):
    assert list(violations(line, package)) == [name]


@pytest.mark.parametrize(
    ("package", "line"),
    [
        ("twin", "import models, mujoco"),
        ("estimators", "from twin import Drive, TwinError"),
        ("estimators", "from twin.kernel import Car, correct, set_parameters, step"),
        ("estimators", "from .kalman import KalmanBucy\nfrom . import score\nimport twins"),
        ("scenarios", "import estimators.score, mujoco, twin.car.vehicle"),
    ],
)
def test_allowed_import_is_left_alone(package, line):
    assert list(violations(line, package)) == []


def test_import_of_twin_loads_nothing_that_only_some_commands_use():
    code = "import sys, twin; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    modules = set(run.stdout.split())
    assert "twin" in modules
    assert modules & HEAVY == set()


def _package(file):
    return ".".join(file.relative_to(ROOT).parent.parts)
