"""Progress on standard error, and work spread over processes under it."""

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar, cast

import joblib
from tqdm import tqdm

Item = TypeVar("Item")
Output = TypeVar("Output")

DELAY = 2.0  # [s] before a bar appears


def progress(items: Iterable[Item], label: str, total: int | None = None) -> Iterator[Item]:
    """Passes the items on under a bar, which only a terminal shows and only once it takes long."""
    yield from tqdm(items, label, total, leave=False, delay=DELAY, disable=None)


def parallel(
    function: Callable[[Item], Output], items: Iterable[Item], jobs: int, label: str
) -> list[Output]:
    """The function of each item, in their order, by so many jobs side by side.

    No backend is named: one chosen with `joblib.parallel_config` (Dask, Ray) takes over.
    """
    items = list(items)
    run = joblib.Parallel(n_jobs=jobs, return_as="generator")
    outputs = cast(Iterator[Output], run(joblib.delayed(function)(item) for item in items))
    return list(progress(outputs, label, len(items)))
