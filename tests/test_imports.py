import ast
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
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
# What a function may import itself: extras that may be missing, and libraries that take their time
OPTIONAL = {
    *("asammdf", "can", "cantools", "distributed", "fmpy", "h5py", "libxrk", "lz4", "matplotlib"),
    *("mcap", "mcap_ros2", "pandas", "polars", "pyarrow", "rerun", "scipy", "skopt"),
}
# Modules of ours that import such, and that not every command or scenario needs: at the file's top
# they would delay the rest
DELAYED = {
    ("scenarios/__main__.py", "twin.errors.TwinError"),
    ("scenarios/cli/doctor.py", "twin.compiled"),
    ("scenarios/cli/log_commands.py", "scenarios.experiment.progress.cluster"),
    ("scenarios/experiment/plants.py", "scenarios.plants.commonroad"),
    ("scenarios/experiment/progress.py", "twin.errors.TwinError"),
    ("scenarios/experiment/result.py", "numpy"),
}
HEAVY = {"skopt", "rerun", "pyarrow", "matplotlib", "scipy.optimize"}


def imported_names(source, package):
    """Dotted names that a source file of a package imports, each down to the imported name."""
    for node in ast.walk(ast.parse(source)):
        yield from names_of(node, package)


def names_of(node, package):
    """Dotted names that a node imports; none if it is no import."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        parents = package.split(".")[: len(package.split(".")) - node.level + 1]
        base = [*(parents if node.level else []), *([node.module] if node.module else [])]
        yield from (".".join([*base, alias.name]) for alias in node.names)


def names_within_functions(source, package):
    """What the functions of a source file import."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            for inner in ast.walk(node):
                yield from names_of(inner, package)


def names_as_module(source, package):
    """What a source file imports, but for what it does when it is run as a program."""
    tree = ast.parse(source)
    program = {
        inner
        for node in tree.body
        if isinstance(node, ast.If) and "__name__" in ast.unparse(node.test)
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if node not in program:
            yield from names_of(node, package)


def module_of(name):
    """The module that a dotted name lies in, or is; None if it is none of ours."""
    parts = name.split(".")
    if parts[0] not in ROOMS:
        return None
    while not (
        ROOT.joinpath(*parts).with_suffix(".py").is_file() or (ROOT / "/".join(parts)).is_dir()
    ):
        parts.pop()
    return ".".join(parts)


def files():
    return [file for room in ROOMS for file in sorted((ROOT / room).rglob("*.py"))]


def dotted(file):
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def import_graph(depth):
    """Modules, or with a depth of 2 sub-folders and root modules, and what each imports."""
    graph = {}
    for file in files():
        inside = ".".join(dotted(file).split(".")[:depth])
        for name in names_as_module(file.read_text(), _package(file)):
            module = module_of(name)
            if module is not None:
                graph.setdefault(inside, set()).add(".".join(module.split(".")[:depth]))
    return {name: found - {name} for name, found in graph.items()}


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


@pytest.mark.parametrize(("depth", "nodes"), [(2, 60), (9, 250)])
def test_imports_of_folders_and_of_modules_have_no_circle(depth, nodes):
    graph = import_graph(depth)
    assert len(graph) > nodes
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the circle


def test_circle_of_imports_is_found():
    found = import_graph(9)
    found["twin.errors"] = {"twin.twin"}
    with pytest.raises(CycleError, match=r"twin\.errors"):
        TopologicalSorter(found).prepare()


def test_functions_import_only_what_is_optional_or_slow():
    found = {
        (str(file.relative_to(ROOT)), name)
        for file in files()
        for name in names_within_functions(file.read_text(), _package(file))
        if name.split(".")[0] not in OPTIONAL
    }
    assert found == DELAYED


def test_import_of_twin_loads_nothing_that_only_some_commands_use():
    code = "import sys, twin; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    modules = set(run.stdout.split())
    assert "twin" in modules
    assert modules & HEAVY == set()


def _package(file):
    return ".".join(file.relative_to(ROOT).parent.parts)
