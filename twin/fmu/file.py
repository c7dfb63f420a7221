"""Opens a co-simulation FMU of FMI 2.0 through FMPy and checks that it is one."""

import contextlib
import platform
import shutil
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twin.errors import TwinError

Variables = Mapping[str, Any]  # FMPy's ScalarVariable by name


def fmpy() -> Any:
    """The package FMPy.

    Raises:
        TwinError: it is not installed.
    """
    try:
        import fmpy
        import fmpy.fmi2
    except ImportError as error:
        raise TwinError(
            "FMPy, which runs FMUs, is not installed: pip install 'twin-in-the-loop[fmi]'"
        ) from error
    return fmpy


def describe(path: Path) -> Any:
    """FMPy's description of the model, of a file that runs here.

    Raises:
        TwinError: there is no such file, it is no FMU, or none that runs here.
    """
    library = fmpy()
    if not path.is_file():
        raise TwinError(f"{path}: there is no such file")
    try:
        description = library.read_model_description(str(path))
        platforms = library.supported_platforms(str(path))
    except Exception as error:  # FMPy raises no narrower one
        raise TwinError(f"{path}: is not an FMU that can be read: {error}") from error
    if description.fmiVersion != "2.0":
        raise TwinError(f"{path}: is of FMI {description.fmiVersion}; allowed: FMI 2.0")
    if description.coSimulation is None:
        raise TwinError(f"{path}: is for model exchange; allowed: co-simulation")
    if library.platform not in platforms:
        raise TwinError(
            f"{path}: has binaries for {', '.join(platforms) or 'nothing'}; this machine, a "
            f"{platform.machine()}, needs {library.platform}"
        )
    return description


def open_instance(path: Path, description: Any, said: list[str]) -> tuple[Any, Path]:
    """Unpacks an FMU to a temporary folder, loads its code and makes an instance.

    Unpacking goes through `zipfile`, which keeps every entry inside the folder.

    Args:
        path: of the FMU.
        description: from `describe`.
        said: receives what the FMU logs.

    Returns:
        FMPy's FMU2Slave, and the folder; `close` needs both.

    Raises:
        TwinError: the FMU's library cannot be loaded or refuses to start.
    """
    library = fmpy()
    folder = Path(tempfile.mkdtemp(prefix="fmu-"))
    try:
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        with contextlib.chdir("."):  # FMPy stays in the folder if the library does not load
            instance = library.fmi2.FMU2Slave(
                guid=description.guid,
                unzipDirectory=str(folder),
                modelIdentifier=description.coSimulation.modelIdentifier,
                instanceName=path.stem,
            )
        instance.instantiate(callbacks=_callbacks(library, said), loggingOn=True)
    except Exception as error:  # FMPy raises no narrower one
        shutil.rmtree(folder, ignore_errors=True)
        raise TwinError(f"{path}: does not start: {'; '.join([str(error), *said])}") from error
    return instance, folder


def close(instance: Any, folder: Path) -> None:
    """Frees an instance and its code, and removes its folder."""
    instance.freeInstance()
    shutil.rmtree(folder, ignore_errors=True)


def _callbacks(library: Any, said: list[str]) -> Any:
    """FMI's callbacks; messages are kept for the error that may follow."""
    fmi2 = library.fmi2

    def log(environment, name, status, category, message):
        said.append((message or b"").decode("utf-8", "replace").strip())
        del said[:-3]

    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(log)
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(library.calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(library.free)
    return callbacks
