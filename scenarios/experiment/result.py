"""The one shape of every result: rows of medians over seeds, as JSON or as a table."""

import json
import math
import platform
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

PACKAGES = ("mujoco", "numpy", "numba", "twin-in-the-loop")
OPTIONAL_COLUMNS = ("paper", "limit")


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One figure of a result.

    Attributes:
        case: the experiment, in the words of the paper's row, or the real vehicle's name.
        quantity: what is estimated.
        metric: how it is scored.
        unit: of median, p90, paper and limit.
        estimator: which observer.
        seeds: how many.
        median: over the seeds.
        p90: 90th percentile over the seeds.
        paper: the paper's figure.
        limit: the Cramer-Rao bound.
    """

    case: str
    quantity: str
    metric: str
    unit: str
    estimator: str
    seeds: int
    median: float
    p90: float
    paper: float | None = None
    limit: float | None = None

    @classmethod
    def over_seeds(
        cls,
        values: "ArrayLike",
        *,
        case: str,
        quantity: str,
        metric: str,
        unit: str,
        estimator: str,
        paper: float | None = None,
        limit: float | None = None,
    ) -> Self:
        """The row of values, shape (seeds,) [unit]; a NaN among them makes the figures NaN."""
        import numpy as np  # not at the top: `til list` is quicker without

        values = np.asarray(values, dtype=np.float64)
        if values.ndim != 1 or values.size == 0:
            raise ValueError(f"values must have shape (seeds,), not {values.shape}")
        # between two infinities there is nothing to interpolate
        p90 = np.quantile(values, 0.9, method="higher" if np.isinf(values).any() else "linear")
        return cls(
            case=case,
            quantity=quantity,
            metric=metric,
            unit=unit,
            estimator=estimator,
            seeds=len(values),
            median=float(np.median(values)),
            p90=float(p90),
            paper=paper,
            limit=limit,
        )


def versions() -> dict[str, str]:
    """Versions of Python and of what decides the figures."""
    return {"python": platform.python_version()} | {p: metadata.version(p) for p in PACKAGES}


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What a scenario, a reproduction or the benchmark gives.

    Attributes:
        name: of the command's subject.
        settings: what it was run with.
        versions: of the software.
        seconds: it took [s].
        rows: the figures.
    """

    name: str
    settings: dict[str, Any]
    versions: dict[str, str] = field(default_factory=versions)
    seconds: float
    rows: Sequence[Row]

    def to_json(self) -> dict[str, Any]:
        """The result in types that JSON has; NaN and infinity become None."""
        return _plain({f.name: getattr(self, f.name) for f in fields(self)})

    def columns(self) -> dict[str, list[Any]]:
        """The rows by column; paper and limit only if a row has one."""
        columns = {f.name: [getattr(row, f.name) for row in self.rows] for f in fields(Row)}
        return {
            name: values
            for name, values in columns.items()
            if name not in OPTIONAL_COLUMNS or any(value is not None for value in values)
        }

    def table(self) -> str:
        """The rows as aligned text, 3 significant digits."""
        return _aligned(self.columns())


def write_json(data: dict[str, Any], path: Path) -> None:
    """Writes one JSON object, whole or not at all."""
    with replacing(path) as partial:
        partial.write_text(json_text(data) + "\n", encoding="utf-8")


def json_text(data: dict[str, Any]) -> str:
    """One JSON object as text that every JSON reader takes: no NaN, no infinity."""
    return json.dumps(data, indent=2, allow_nan=False)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Lends a path beside the given one; what is written there takes its place at the end.

    After an error nothing is left and an older file stays. A device or pipe is lent itself.
    """
    if path.exists() and not path.is_file():
        yield path
        return
    target = path.resolve()  # a symbolic link stays one
    partial = target.with_name(f".{uuid.uuid4().hex}.{target.name}")
    try:
        yield partial
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)


def _plain(value: Any) -> Any:
    if isinstance(value, Row):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):  # NumPy's scalars and arrays
        return _plain(value.tolist())
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _aligned(columns: dict[str, list[Any]]) -> str:
    """Text to the left, numbers to the right, headings and values in columns."""
    shown = []
    for name, values in columns.items():
        cells = [name, *map(cell, values)]
        width = max(map(len, cells))
        is_text = any(isinstance(value, str) for value in values)
        shown.append([text.ljust(width) if is_text else text.rjust(width) for text in cells])
    lines = ["  ".join(line).rstrip() for line in zip(*shown, strict=True)]
    rule = "  ".join("-" * len(column[0]) for column in shown)
    return "\n".join([lines[0], rule, *lines[1:]])


def cell(value: Any) -> str:
    """A value of a row as text, 3 significant digits."""
    if value is None:
        return "-"
    if isinstance(value, str | int):
        return str(value)
    text = f"{value:#.3g}".rstrip(".")
    return f"{float(text):.0f}" if 1e3 <= abs(float(text)) < 1e6 else text
