import importlib.util
import re
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner

from scenarios.cli import doctor

ROOT = Path(__file__).parents[1]


def _findings():
    return {finding.subject: finding for finding in doctor.examine()}


def test_every_package_that_the_project_needs_is_named_with_its_version():
    needed = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    found = _findings()
    for requirement in needed:
        name = re.match(r"[\w-]+", requirement)[0]
        assert re.match(r"\d", found[name].words), name


def test_every_extra_of_users_is_named():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    assert set(doctor.EXTRAS) == set(extras) - {"test", "check"}


def test_missing_extra_comes_with_the_command_that_mends_it(monkeypatch):
    real = importlib.util.find_spec
    monkeypatch.setattr(
        "importlib.util.find_spec", lambda name: None if name == "asammdf" else real(name)
    )
    finding = _findings()["extra mdf"]
    assert finding.state == "missing"
    assert finding.remedy.endswith("pip install -e '.[mdf]'")


@pytest.mark.parametrize(("free", "status"), [(10e9, 0), (1e6, 2)])
def test_full_disk_is_wrong_and_ends_with_status_2(monkeypatch, free, status):
    usage = type("usage", (), {"free": free})
    monkeypatch.setattr("shutil.disk_usage", lambda path: usage)
    run = CliRunner().invoke(doctor.doctor)
    assert run.exit_code == status
    assert ("wrong" in run.output) == (status == 2)


def test_viewer_without_a_screen_is_said(monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert "no screen" in _findings()["viewer"].words
    monkeypatch.setenv("DISPLAY", ":0")
    assert _findings()["viewer"].state == "ok"
