"""Several twins side by side, of our own cars or of any other black box."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators.black_box import BlackBox, nominal_of, settle
from estimators.ensemble.black_box_calls import BOX_DTYPE, CalledBox, error_of, places
from twin import (
    EXTENDED,
    INPUTS,
    OUTPUTS,
    PARAMETERS,
    STATES,
    TYRE_OUTPUTS,
    WHEELS,
    Drive,
    Ensemble,
    Snapshot,
    Twin,
    TwinError,
    Vehicle,
    check_inputs,
)

Array = NDArray[np.float64]
Source = Vehicle | Callable[[], BlackBox]
"""Of what the twins of an estimator are made: a vehicle, or what makes a black box."""

EXTENDED_SHAPE = (len(WHEELS), len(TYRE_OUTPUTS))


class Twins:
    """Twins of one kind that a compiled loop steps together.

    Args:
        source: what each is made of.
        size: how many.

    Attributes:
        twins: the simulators themselves.
        cars: (n,) records for compiled loops, see `estimators.ensemble.stepping`.
        nominal: (np,) of `twin.PARAMETERS`; NaN where the black box does not say.
        dt: step [s].

    Raises:
        TwinError: the vehicle's files are broken.
    """

    def __init__(self, source: Source, size: int) -> None:
        self._boxes: tuple[CalledBox, ...] = ()
        self._ensemble: Ensemble | None = None
        self.nominal = np.full(len(PARAMETERS), np.nan)
        if isinstance(source, Vehicle):
            self._ensemble = Ensemble(source, size)
            self.twins: Sequence[Any] = self._ensemble.twins
            self.cars = self._ensemble.cars
            self.nominal[:] = self.twins[0].car.nominal
        else:
            self._boxes = tuple(CalledBox(source()) for _ in range(size))
            self.twins = tuple(one.box for one in self._boxes)
            self.cars = np.zeros(size, np.dtype((np.record, BOX_DTYPE)))
            self.cars["box"] = [one.number for one in self._boxes]
            own, ours = places(self.parameters, PARAMETERS)
            self.nominal[ours] = nominal_of(self.twins[0])[own]
        self.dt = float(self.twins[0].dt)

    def __len__(self) -> int:
        """Number of twins."""
        return len(self.twins)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Parameters that the twins have, of `twin.PARAMETERS`."""
        return tuple(name for name in PARAMETERS if name in self.twins[0].parameters)

    def require(self, what: str, parameters: Sequence[str]) -> None:
        """Refuses parameters that the twins do not have.

        Args:
            what: the estimator.
            parameters: names.

        Raises:
            TwinError: one is unknown, or given twice.
        """
        if not set(parameters) <= set(self.parameters) or len(set(parameters)) < len(parameters):
            raise TwinError(
                f"{what}: parameters are {', '.join(parameters)}; allowed: each at most once of "
                f"{', '.join(self.parameters)}"
            )

    def set_parameters(self, twin: int, p: Array) -> None:
        """Sets the parameters (np,) of `twin.PARAMETERS` of one twin, as far as it has them."""
        own, ours = places(self.twins[twin].parameters, PARAMETERS)
        deltas = np.zeros(len(self.twins[twin].parameters))
        deltas[own] = p[ours]
        self.twins[twin].set_parameters(deltas)

    def settle(self, speed: float, road: ArrayLike | None = None) -> None:
        """Settles all twins under their parameters.

        Args:
            speed: [m/s].
            road: (4,) height under each wheel [m].
        """
        for twin in self.twins:
            settle(twin, speed, road)

    def check(self) -> None:
        """Raises TwinError if a twin has blown up."""
        if self._ensemble is None:
            self._raise()
            return
        for twin in self.twins:
            twin.check()

    def blown_up(self, time: float) -> TwinError:
        """The error of a drive on which a twin has blown up at a time [s]."""
        self._raise()
        return TwinError(f"drive: a twin blew up at t = {time:.3f} s")

    def _raise(self) -> None:
        error = error_of(self._boxes)
        if error is not None:
            raise error

    def check_inputs(self, inputs: Array, what: str) -> None:
        """Refuses inputs (n, nu) that are not finite or out of range; a black box has no ranges.

        Raises:
            TwinError: one is.
        """
        if self.twins[0].inputs == INPUTS:
            check_inputs(inputs, what)
        elif not np.isfinite(inputs).all():
            raise TwinError(f"{what}: an input is not finite; allowed: finite numbers")

    def given_by(self, drive: Drive) -> tuple[Array, Array]:
        """Inputs (N, nu) and measurements (N, ny) of `twin.OUTPUTS`, NaN where there are none.

        Raises:
            TwinError: the drive has other inputs than the twins, or another sample time.
        """
        twin = self.twins[0]
        if abs(drive.dt - self.dt) > 1e-9:
            raise TwinError(f"drive: has samples every {drive.dt} s, the twin steps {self.dt} s")
        if drive.input_names != twin.inputs:
            raise TwinError(
                f"drive: has inputs {', '.join(drive.input_names)}; allowed: those of the twin, "
                f"{', '.join(twin.inputs)}"
            )
        self.check_inputs(drive.inputs, "drive")
        own, ours = places(drive.output_names, OUTPUTS)
        measurements = np.full((len(drive), len(OUTPUTS)), np.nan)
        measurements[:, ours] = drive.measurements[:, own]
        return np.ascontiguousarray(drive.inputs), measurements

    def used(self, noise_sd: ArrayLike, what: str) -> Array:
        """(ny,) standard deviations of `twin.OUTPUTS`, NaN: not used, as one the twins lack.

        Args:
            noise_sd: (ny,) of a sample's white noise; NaN: not used.
            what: the estimator.

        Raises:
            TwinError: it has another shape, or a number is not above zero.
        """
        sd = np.asarray(noise_sd, dtype=np.float64)
        if sd.shape != (len(OUTPUTS),) or not (np.isnan(sd) | (sd > 0.0)).all():
            raise TwinError(
                f"{what}: noise_sd is {sd.tolist()}; allowed: {len(OUTPUTS)} numbers above zero, "
                "NaN for a channel that is not used"
            )
        return np.where(np.isin(OUTPUTS, self.twins[0].outputs), sd, np.nan)

    def histories(self, states: Array, parameters: Array, outputs: Array, extended: Array) -> dict:
        """The fields of an `Estimate` that say what the twins did: what they have of each table.

        Args:
            states: (N, nx) of `twin.STATES`.
            parameters: (N, np) of `twin.PARAMETERS`.
            outputs: (N, ny) of `twin.OUTPUTS`.
            extended: (N, 4, 9).
        """
        twin, found = self.twins[0], {}
        kept = EXTENDED if isinstance(twin, Twin) else ()
        for field, table, names, own in (
            ("state", states, STATES, twin.states),
            ("parameter", parameters, PARAMETERS, twin.parameters),
            ("output", outputs, OUTPUTS, twin.outputs),
            ("extended", extended.reshape(len(states), -1), EXTENDED, kept),
        ):
            columns = [i for i, name in enumerate(names) if name in own]
            plain = "extended" if field == "extended" else f"{field}s"
            found[plain] = table if len(columns) == len(names) else table[:, columns]
            found[f"{field}_names"] = tuple(names[i] for i in columns)
        columns = [i for i, name in enumerate(PARAMETERS) if name in twin.parameters]
        return found | {"nominal": self.nominal[columns]}

    def snapshot(self) -> tuple[Snapshot, ...]:
        """Everything that decides the twins' future.

        Raises:
            TwinError: they are not our own twins.
        """
        self._require_own()
        return tuple(twin.snapshot() for twin in self.twins)

    def restore(self, snapshots: Sequence[Snapshot]) -> None:
        """Goes back to snapshots.

        Raises:
            TwinError: the twins are not our own.
        """
        self._require_own()
        for twin, kept in zip(self.twins, snapshots, strict=True):
            twin.restore(kept)

    def _require_own(self) -> None:
        if self._ensemble is None:
            raise TwinError("snapshot: this black box has none; allowed: twins of a vehicle")


def parameters_of(source: Source, wanted: Sequence[str]) -> tuple[str, ...]:
    """Those of some parameters that the twins have.

    Args:
        source: what the twins are made of.
        wanted: names.
    """
    if isinstance(source, Vehicle):
        return tuple(wanted)
    own = source().parameters
    return tuple(name for name in wanted if name in own)
