"""What this installation has and lacks: `til doctor`."""

import importlib.util
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Literal

import click

PROJECT = "twin-in-the-loop"
# What each extra is for, and the module by which its presence is known
EXTRAS = {
    "plots": ("matplotlib", "pictures (--png, `til reproduce`)"),
    "dask": ("distributed", "many runs on a Dask cluster (--dask)"),
    "mdf": ("asammdf", "logs in MDF 4"),
    "can": ("cantools", "raw CAN logs"),
    "aim": ("libxrk", "logs of AiM's loggers"),
    "ros": ("mcap_ros2", "logs in MCAP, of ROS 2"),
    "mat": ("h5py", "logs in MATLAB 7.3"),
    "commonroad": ("vehiclemodels", "CommonRoad's multi-body car as the real vehicle"),
    "fmi": ("fmpy", "an FMU as the twin"),
}
LEAST_CORES, LEAST_DISK = 2, 1e9  # [-], [bytes]; chosen: two jobs, some timelines


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One line of the report.

    Attributes:
        subject: what was looked at.
        state: "ok"; "missing" where something optional is; "wrong" where the program cannot work.
        words: what was found.
        remedy: the command or action that mends it; empty where nothing is to be done.
    """

    subject: str
    state: Literal["ok", "missing", "wrong"]
    words: str
    remedy: str = ""


def examine() -> Iterator[Finding]:
    """Looks at Python, packages, compiled code, cores, disk, viewer and extras."""
    checks: tuple[Callable[[], Iterator[Finding]], ...] = (
        _python,
        _packages,
        _compiled_code,
        _machine,
        _viewer,
        _extras,
    )
    for check in checks:
        yield from check()


@click.command()
def doctor() -> None:
    """Show versions, cores, compile cache, viewer and extras, and what mends what is missing."""
    wrong = False
    for finding in examine():
        wrong = wrong or finding.state == "wrong"
        colour = {"ok": "green", "missing": "yellow", "wrong": "red"}[finding.state]
        mark = click.style(f"{finding.state:8}", fg=colour)
        click.echo(f"{mark}{finding.subject:22}{finding.words}")
        if finding.remedy:
            click.echo(f"{'':8}{'':22}-> {finding.remedy}")
    if wrong:
        raise click.exceptions.Exit(2)


def _python() -> Iterator[Finding]:
    version = platform.python_version()
    words = f"{version}, {platform.system()} {platform.machine()}, {sys.executable}"
    yield Finding(subject="python", state="ok", words=words)


def _packages() -> Iterator[Finding]:
    """The packages that this project declares, each with its version."""
    for line in metadata.requires(PROJECT) or ():
        if "extra ==" in line:
            continue
        name = line.split(";")[0].split(">")[0].split("=")[0].split("<")[0].strip()
        try:
            yield Finding(subject=name, state="ok", words=metadata.version(name))
        except metadata.PackageNotFoundError:
            remedy = f"pip install '{line.split(';')[0]}'"
            yield Finding(subject=name, state="wrong", words="not installed", remedy=remedy)


def _compiled_code() -> Iterator[Finding]:
    """Whether compiled code can be kept, and how much of it is."""
    import twin.compiled  # not at the top: it imports numba

    folder = Path(twin.compiled.__file__).parents[1]
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        yield Finding(
            subject="compile cache",
            state="missing",
            words=f"{folder} cannot be written ({error.strerror}): every start compiles anew",
            remedy="set NUMBA_CACHE_DIR to a folder that can be written",
        )
        return
    files = [file for room in folder.parent.glob("*/") for file in room.rglob("*.nbc")]
    size = sum(file.stat().st_size for file in files) / 1e6
    words = f"{len(files)} functions, {size:.0f} MB" if files else "empty: the first run compiles"
    yield Finding(subject="compile cache", state="ok", words=words)


def _machine() -> Iterator[Finding]:
    cores = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    words = f"{cores}, --jobs {cores} uses them all" if cores >= LEAST_CORES else f"{cores}"
    yield Finding(subject="cores", state="ok", words=words)
    free = shutil.disk_usage(Path.cwd()).free
    words = f"{free / 1e9:.0f} GB free in {Path.cwd()}"
    if free >= LEAST_DISK:
        yield Finding(subject="disk", state="ok", words=words)
    else:
        remedy = "free some: a timeline takes 5 to 100 MB"
        yield Finding(subject="disk", state="wrong", words=words, remedy=remedy)


def _viewer() -> Iterator[Finding]:
    """Whether the Rerun viewer is there and has a screen."""
    folder = Path(sys.executable).parent
    program = shutil.which("rerun", path=f"{folder}{os.pathsep}{os.environ.get('PATH', '')}")
    if program is None:
        remedy = "pip install --force-reinstall rerun-sdk"
        yield Finding(subject="viewer", state="wrong", words="no `rerun`", remedy=remedy)
    elif sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        yield Finding(
            subject="viewer",
            state="missing",
            words=f"{program}, but no screen here: --view will not open a window",
            remedy="write the timeline with --rrd FILE and open it elsewhere: rerun FILE",
        )
    else:
        yield Finding(subject="viewer", state="ok", words=program)


def _extras() -> Iterator[Finding]:
    for extra, (module, purpose) in EXTRAS.items():
        if importlib.util.find_spec(module):
            yield Finding(subject=f"extra {extra}", state="ok", words=purpose)
        else:
            remedy = f"from the folder of the project: pip install -e '.[{extra}]'"
            yield Finding(subject=f"extra {extra}", state="missing", words=purpose, remedy=remedy)
