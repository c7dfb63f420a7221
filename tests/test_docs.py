"""The pages of the documentation, each run from its first block to its last in an empty folder."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs").glob("*.md"))
BLOCK = re.compile(r"^```(\w+)( slow)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LONGEST = 1800.0  # [s]


def blocks(page):
    """(language, whether it takes minutes, text) of each fenced block."""
    return [(kind, bool(slow), text) for kind, slow, text in BLOCK.findall(page.read_text())]


def follow(page, folder, *, slow):
    """Does what a page says: runs its commands and programs, writes its files."""
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
    }
    programs = ""
    for kind, takes_minutes, text in blocks(page):
        if takes_minutes and not slow:
            continue
        if kind == "toml":
            (folder / text.splitlines()[0].removeprefix("# ")).write_text(text)
            continue
        assert kind in ("sh", "python"), f"{page.name}: who runs {kind}?"
        programs += text if kind == "python" else ""  # a later program knows the earlier ones
        command = ["bash", "-ec", text] if kind == "sh" else [sys.executable, "-c", programs]
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=LONGEST
        )
        assert done.returncode == 0, f"{page.name}: {text}\n{done.stdout}\n{done.stderr}"


def test_there_are_the_pages_that_the_readme_names():
    named = set(re.findall(r"\(docs/([\w-]+\.md)\)", (ROOT / "README.md").read_text()))
    assert named == {page.name for page in PAGES}


def test_python_of_the_readme_estimates_the_load(tmp_path):
    ((_, _, text),) = blocks(ROOT / "README.md")
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", text], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    load, sd = map(float, re.findall(r"(-?\d+) kg", done.stdout))
    assert abs(load - 355.0) < 2.0 * sd < 50.0
    assert (tmp_path / "estimate.csv").is_file()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_can_be_followed(page, tmp_path):
    follow(page, tmp_path, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [page for page in PAGES if any(b[1] for b in blocks(page))], ids=lambda page: page.stem
)
def test_page_can_be_followed_to_the_end(page, tmp_path):
    follow(page, tmp_path, slow=True)
