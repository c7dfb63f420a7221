import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("twin", "models", "estimators", "scenarios")


def run(*command, cwd):
    """What a program writes to standard output, away from the checkout."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    build = (sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, ROOT)
    run(*build, cwd=folder)
    (file,) = folder.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def wheel_names(wheel):
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


@pytest.fixture(scope="module")
def borrowing_venv(wheel, tmp_path_factory):
    """The wheel in a fresh environment that borrows the dependencies from this one.

    A path in a .pth file puts the folder on sys.path but does not run the .pth files there: the
    checkout, which an editable install adds by one of those, stays out.
    """
    folder = tmp_path_factory.mktemp("borrowing") / "venv"
    venv.create(folder, with_pip=False)
    pip = (sys.executable, "-m", "pip", "--python", folder)
    run(*pip, "install", "--quiet", "--no-deps", "--no-index", wheel, cwd=folder)
    lenders = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (site_packages,) = folder.glob("lib/python*/site-packages")
    (site_packages / "borrowed.pth").write_text("\n".join(sorted(lenders)) + "\n")
    return folder


def assert_works_outside_the_checkout(environment, cwd):
    code = f"import {', '.join(PACKAGES)}; print(*(p.__file__ for p in ({', '.join(PACKAGES)})))"
    for file in run(environment / "bin" / "python", "-c", code, cwd=cwd).split():
        assert Path(file).is_relative_to(environment)
    til = environment / "bin" / "til"
    assert "mass" in run(til, "list", cwd=cwd)
    assert "mass" in run(til, "run", "mass", "--duration", "5", cwd=cwd)


def test_wheel_holds_the_four_packages_and_nothing_else(wheel, wheel_names):
    name, version = wheel.name.split("-")[:2]
    tops = {entry.split("/")[0] for entry in wheel_names}
    assert tops == {*PACKAGES, f"{name}-{version}.dist-info"}


def test_wheel_holds_every_file_of_the_packages(wheel_names):
    expected = {
        file.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for file in (ROOT / package).rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    assert {"models/suv.xml", "models/tyres/suv.tir", "twin/logs/drive.py"} <= expected
    assert {entry for entry in wheel_names if ".dist-info/" not in entry} == expected


def test_wheel_carries_the_licence(wheel, wheel_names):
    (licence,) = (entry for entry in wheel_names if entry.endswith("licenses/LICENSE"))
    with zipfile.ZipFile(wheel) as archive:
        assert archive.read(licence) == (ROOT / "LICENSE").read_bytes()


def test_wheel_works_in_a_fresh_environment(borrowing_venv, tmp_path):
    assert_works_outside_the_checkout(borrowing_venv, tmp_path)


@pytest.mark.slow
def test_wheel_works_with_what_pypi_gives_it(wheel, tmp_path):
    venv.create(tmp_path / "venv", with_pip=True)
    pip = tmp_path / "venv" / "bin" / "pip"
    run(pip, "install", "--quiet", "--disable-pip-version-check", wheel, cwd=tmp_path)
    assert_works_outside_the_checkout(tmp_path / "venv", tmp_path)
