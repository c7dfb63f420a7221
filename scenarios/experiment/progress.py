"""Progress on standard error, and work spread over processes or a cluster under it."""

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import NoReturn, TypeVar, cast

import joblib
from tqdm import tqdm

Item = TypeVar("Item")
Output = TypeVar("Output")

DELAY = 2.0  # [s] before a bar appears
TIMEOUT = 10.0  # [s] for a cluster to answer
# After Ctrl-C the process that cleans up behind joblib's workers tells of what it cleans up. It
# takes its filters from the environment; a user can mend nothing there.
QUIET = "ignore:resource_tracker:UserWarning"


def progress(items: Iterable[Item], label: str, total: int | None = None) -> Iterator[Item]:
    """Passes the items on under a bar, which only a terminal shows and only once it takes long."""
    yield from tqdm(items, label, total, leave=False, delay=DELAY, disable=None)


def bar(label: str, total: int) -> "tqdm[NoReturn]":
    """A bar that the caller moves on, shown as that of `progress`."""
    return tqdm(desc=label, total=total, leave=False, delay=DELAY, disable=None)


def parallel(
    function: Callable[[Item], Output], items: Iterable[Item], jobs: int, label: str
) -> list[Output]:
    """The function of each item, in their order, by so many jobs side by side.

    Without a label there is no bar.

    No backend is named: one chosen with `joblib.parallel_config` (Dask, Ray) takes over.
    """
    items = list(items)
    if QUIET not in os.environ.get("PYTHONWARNINGS", ""):
        os.environ["PYTHONWARNINGS"] = f"{os.environ.get('PYTHONWARNINGS', '')},{QUIET}".strip(",")
    run = joblib.Parallel(n_jobs=jobs, return_as="generator")
    outputs = cast(Iterator[Output], run(joblib.delayed(function)(item) for item in items))
    return list(progress(outputs, label, len(items)) if label else outputs)


@contextmanager
def cluster(address: str | None) -> Iterator[None]:
    """Inside, `parallel` works on the Dask cluster of that scheduler, whatever its jobs.

    Args:
        address: of the scheduler, as in "tcp://127.0.0.1:8786"; None: no cluster.

    Raises:
        TwinError: Dask is not installed, or neither scheduler nor a worker answers in time.
    """
    if address is None:
        yield
        return
    from twin.errors import TwinError  # not at the top: twin imports MuJoCo and numba

    try:
        from distributed import Client
        from distributed.comm.addressing import get_address_host_port
    except ImportError:
        raise TwinError(
            "--dask: a cluster needs Dask: pip install 'twin-in-the-loop[dask]'"
        ) from None
    client = None
    try:
        get_address_host_port(address)  # a client of no address complains when it is collected
        client = Client(address, timeout=TIMEOUT)
        client.wait_for_workers(1, timeout=TIMEOUT)
    except (OSError, ValueError) as error:
        if client:
            client.close()
        raise TwinError(
            f"--dask: {address} is no cluster that answers within {TIMEOUT:g} s: {error}; allowed: "
            "the address of a Dask scheduler with a worker, as in tcp://127.0.0.1:8786"
        ) from error
    with client, joblib.parallel_config(backend="dask"):
        yield
