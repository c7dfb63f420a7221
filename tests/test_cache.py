import subprocess
import sys
from pathlib import Path

import pytest

from twin.compiled.cache import stamp

ROOT = Path(__file__).parents[1]
CALLER = """
from numba import njit
import room.compiled
from room import (
    called,  # a name that a package offers
)

@njit(cache=True)
def caller():
    return called() + 1
"""


CALLED = """
from numba import njit

@njit(cache=True)
def called():
    return 1
"""


@pytest.fixture
def project(tmp_path):
    """A project of one room with this project's cache, whose caller calls another file."""
    files = {
        "room/__init__.py": "from room.callee import called\nfrom room.other import unused\n",
        "room/caller.py": CALLER,
        "room/callee.py": CALLED,
        "room/other.py": "unused = 1\n",
        "room/compiled/__init__.py": "from room.compiled.cache import install\ninstall()\n",
        "room/compiled/cache.py": (ROOT / "twin/compiled/cache.py").read_text(),
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def _result(project):
    code = "from room.caller import caller; print(caller(), sum(caller.stats.cache_hits.values()))"
    run = subprocess.run([sys.executable, "-c", code], cwd=project, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run.stdout.split()


def test_edited_callee_is_compiled_anew_and_an_unchanged_one_is_not(project):
    assert _result(project) == ["2", "0"]
    assert _result(project) == ["2", "1"]
    callee = project / "room/callee.py"
    callee.write_text(callee.read_text().replace("return 1", "return 5"))
    assert _result(project) == ["6", "0"]


def test_stamp_ignores_what_the_package_offers_besides(project):
    before = stamp(project / "room/caller.py", project)
    (project / "room/other.py").write_text("unused = 2\n")
    assert stamp(project / "room/caller.py", project) == before


def test_cache_of_an_older_source_is_removed_unread(project):
    _result(project)
    (index,) = (project / "room/__pycache__").glob("caller.caller-*.nbi")
    index.write_bytes(b"no pickle of any version")
    caller = project / "room/caller.py"
    caller.write_text(caller.read_text().replace("+ 1", "+ 2"))
    assert _result(project) == ["3", "0"]
    assert not index.exists()
