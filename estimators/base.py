"""What every estimator offers, and what it returns."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.export import Curve, frame_of, plot_curves, save_columns
from twin import EXTENDED, OUTPUTS, PARAMETERS, STATES, Drive, TwinError

Array = NDArray[np.float64]
SLOWEST = 1e-3  # [m/s], below which the sideslip is computed for this forward speed


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """The result of an estimator over a drive of N samples.

    Attributes:
        time: (N,) [s].
        states: (N, nx) before each sample's correction.
        parameters: (N, np) deltas from the nominal values, after each sample's correction.
        outputs: (N, ny) the outputs that the estimator's model predicts.
        extended: (N, ne) further variables of the model, such as tyre forces and slips.
        nominal: (np,) nominal values of the parameters; NaN where a black box has none to give.
        state_names, parameter_names, output_names, extended_names: of the columns; by default
            those of `twin.Twin`.
        estimated: p names: the parameters that were estimated, then the sensor errors.
        sensor_error_names: b names.
        sensor_errors: (N, b) estimated biases, delay and position of the sensors.
        sd: (N, p) standard deviations of `estimated`; None if the estimator has none.
        states_sd: (N, nx) standard deviations of the states; None if the estimator has none.
        sideslip_sd: (N,) standard deviation of the sideslip [rad]; None if the estimator has none.
        valid: (N, p) whether each of `estimated` may be relied on; None if it is not assessed.
        reason: (N, p) index into `reasons`: why a value is not valid.
        trustworthy: (N,) false while measurements in use are rejected or missing, and for a while
            after; None if the measurements are not validated.
        trust_reason: (N,) index into `reasons`: why a sample is not trustworthy.
        reasons: sentences; the first is empty.
        notes: sentences about the whole drive.
    """

    time: Array
    states: Array
    parameters: Array
    outputs: Array
    extended: Array
    nominal: Array
    state_names: tuple[str, ...] = STATES
    parameter_names: tuple[str, ...] = PARAMETERS
    output_names: tuple[str, ...] = OUTPUTS
    extended_names: tuple[str, ...] = EXTENDED
    estimated: tuple[str, ...] = ()
    sensor_error_names: tuple[str, ...] = ()
    sensor_errors: Array | None = None
    sd: Array | None = None
    states_sd: Array | None = None
    sideslip_sd: Array | None = None
    valid: NDArray[np.bool_] | None = None
    reason: NDArray[np.uint8] | None = None
    trustworthy: NDArray[np.bool_] | None = None
    trust_reason: NDArray[np.uint8] | None = None
    reasons: tuple[str, ...] = ("",)
    notes: tuple[str, ...] = ()

    def _tables(self) -> tuple[tuple[tuple[str, ...], Array], ...]:
        errors = np.empty((self.time.size, 0)) if self.sensor_errors is None else self.sensor_errors
        return (
            (self.parameter_names, self.parameters),
            (self.sensor_error_names, errors),
            (self.state_names, self.states),
            (self.output_names, self.outputs),
            (self.extended_names, self.extended),
        )

    def __getitem__(self, name: str) -> Array:
        """The (N,) history of a parameter (as a delta), sensor error, state, output or force.

        Raises:
            TwinError: there is no such name.
        """
        for names, table in self._tables():
            if name in names:
                return table[:, names.index(name)]
        allowed = ", ".join(dict.fromkeys(name for names, _ in self._tables() for name in names))
        raise TwinError(f"estimate: has no {name!r}; has {allowed}")

    def has(self, name: str) -> bool:
        """Whether there is a history of that name."""
        return any(name in names for names, _ in self._tables())

    def absolute(self, name: str) -> Array:
        """The (N,) history of a parameter: nominal value plus delta."""
        return self.nominal[self.parameter_names.index(name)] + self[name]

    def sd_of(self, name: str) -> Array:
        """The (N,) standard deviation of a parameter or sensor error; NaN where there is none."""
        if self.sd is None or name not in self.estimated:
            return np.full(self.time.size, np.nan)
        return self.sd[:, self.estimated.index(name)]

    def valid_of(self, name: str) -> NDArray[np.bool_]:
        """(N,) whether an estimate may be relied on; true where validity is not assessed."""
        if self.valid is None or name not in self.estimated:
            return np.ones(self.time.size, dtype=np.bool_)
        return self.valid[:, self.estimated.index(name)]

    def reason_of(self, name: str, sample: int = -1) -> str:
        """Why an estimate is not valid; empty if it is or nothing is known.

        Args:
            name: of `estimated`.
            sample: index of the sample, the last by default.
        """
        if self.reason is None or name not in self.estimated:
            return ""
        return self.reasons[self.reason[sample, self.estimated.index(name)]]

    @property
    def sideslip(self) -> Array:
        """(N,) sideslip angle at the origin of the states [rad]; NaN where there is none."""
        if "sideslip" in self.output_names:
            return self["sideslip"]
        if not {"vx", "vy"} <= set(self.state_names):
            return np.full(self.time.size, np.nan)
        vx, vy = (self.states[:, self.state_names.index(name)] for name in ("vx", "vy"))
        return np.arctan2(vy, np.maximum(vx, SLOWEST))

    @property
    def mass(self) -> Array:
        """(N,) estimated mass of the chassis with its load [kg]; the load is `estimate["mass"]`."""
        return self.absolute("mass")

    def columns(self) -> dict[str, NDArray[Any]]:
        """(N,) histories by name: time, what was estimated and its sd, sideslip, states, outputs.

        Parameters are changes from nominal. Standard deviations are called `<name>_sd`.
        """
        found: dict[str, NDArray[Any]] = {"time": self.time}
        for name in self.estimated:
            found[name] = self[name]
            if self.sd is not None:
                found[f"{name}_sd"] = self.sd_of(name)
        if np.isfinite(self.sideslip).any():
            found["sideslip"] = self.sideslip
        if self.sideslip_sd is not None:
            found["sideslip_sd"] = self.sideslip_sd
        for names in (self.state_names, self.output_names):
            found |= {name: self[name] for name in names if name not in found}
        if self.trustworthy is not None:
            found["trustworthy"] = self.trustworthy
        return found

    def to_frame(self) -> Any:
        """The `columns` as a DataFrame of pandas, with the time [s] as its index.

        Raises:
            TwinError: pandas is not installed.
        """
        return frame_of(self.columns())

    def save(self, path: str | Path) -> None:
        """Writes the `columns` as Parquet or CSV, by the name's ending, whole or not at all.

        Raises:
            TwinError: the ending is unknown, or the file cannot be written.
        """
        save_columns(self.columns(), path)

    def plot(self, *names: str) -> Any:
        """A figure of matplotlib: histories in bands of two sd; grey where not trustworthy.

        Args:
            names: what is drawn, [SI]; by default what was estimated, and the sideslip.

        Raises:
            TwinError: there is no such name, or matplotlib is not installed.
        """
        chosen = names or (*(n for n in self.estimated if n in self.parameter_names), "sideslip")
        curves = [self._curve(name) for name in chosen]
        return plot_curves(self.time, curves, self.trustworthy)

    def _curve(self, name: str) -> Curve:
        if name == "sideslip":
            sd = self.sideslip_sd
            return Curve(
                "sideslip [deg]", np.degrees(self.sideslip), None if sd is None else np.degrees(sd)
            )
        return Curve(name, self[name], self.sd_of(name) if name in self.estimated else None)


def sideslip_estimate(time: Array, sideslip: Array, sd: Array | None = None) -> Estimate:
    """An estimate of the sideslip alone.

    Args:
        time: (N,) [s].
        sideslip: (N,) [rad].
        sd: (N,) its standard deviation [rad]; None: there is none.
    """
    nothing = np.empty((time.size, 0))
    return Estimate(
        time=time,
        states=nothing,
        parameters=nothing,
        outputs=sideslip[:, None],
        extended=nothing,
        nominal=np.empty(0),
        state_names=(),
        parameter_names=(),
        output_names=("sideslip",),
        extended_names=(),
        sideslip_sd=sd,
    )


@runtime_checkable
class Estimator(Protocol):
    """What every estimator offers."""

    def reset(
        self,
        speed: float,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """Starts anew.

        Args:
            speed: at the start of the drive [m/s].
            parameters: initial deltas from the nominal values by name; zero where not given.
            road: (4,) height under each wheel at the start [m]; zero if not given. What has no
                road ignores it.
        """
        ...

    def run(self, drive: Drive) -> Estimate:
        """Estimates over a whole drive, from the state that the estimator is in.

        Raises:
            TwinError: the drive lacks a channel, or the estimator has diverged.
        """
        ...


@runtime_checkable
class OnlineEstimator(Estimator, Protocol):
    """An estimator that takes one sample at a time."""

    def update(self, u: ArrayLike, y: ArrayLike) -> Array:
        """Takes one sample of inputs (nu,) and measurements (ny,); returns the parameters (np,)."""
        ...
