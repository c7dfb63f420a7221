"""The result of a log for its user: absolute values and changes, intervals, trust and why not."""

from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from estimators.score import rms_pct
from scenarios.logs.candidate import SLOWEST
from scenarios.logs.estimators import Found
from scenarios.logs.pieces import lacking, measured
from scenarios.logs.trust_spans import Span, trust_spans
from twin import PARAMETER, SCALES, Vehicle

Array = NDArray[np.float64]

NORMAL_95 = 1.96  # standard deviations of a 95 % interval
# The law of the mass alone: beyond this share of the prior's standard deviation it learnt nothing
_LEARNT = 0.5
_PRIOR_SHARE = 0.2  # of the car's mass, the prior of `default_observer`
_WORDS = {
    "mass": "total mass",
    "cm_x": "centre of mass, forward of the IMU",
    "cm_y": "centre of mass, left of the IMU",
    "cm_z": "centre of mass, above the IMU",
    "Jxx": "roll inertia Jxx",
    "Jyy": "pitch inertia Jyy",
    "Jzz": "yaw inertia Jzz",
    "Jxy": "product of inertia Jxy",
    "Jxz": "product of inertia Jxz",
    "Jyz": "product of inertia Jyz",
}


class Shown(NamedTuple):
    """In which unit a parameter is shown, and how many of it an SI unit is."""

    unit: str
    per_si: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """An estimate at the end of a log.

    Attributes:
        name: of `twin.PARAMETERS`.
        words: for people.
        unit: of all numbers: kg, mm, kg m2, % of what the car's file says.
        value: absolute; of the mass that of the whole car.
        change: from what the car's file says; of the mass the load.
        sd: standard deviation; None if the estimator has none.
        low, high: 95 % interval of the change; None without sd.
        valid: whether the estimate may be relied on by itself.
        reason: why not; empty if it may.
    """

    name: str
    words: str
    unit: str
    value: float
    change: float
    sd: float | None
    low: float | None
    high: float | None
    valid: bool = True
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sideslip:
    """Sideslip over a log [deg], where the car moves.

    Attributes:
        end: at the last sample.
        largest: in either direction.
        band: half width of the 95 % band, rms over the drive; None if the estimator has none.
    """

    end: float
    largest: float
    band: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What is known after a log.

    Attributes:
        duration: of the log [s].
        quantities: estimates at the end.
        sideslip: None where the log lacks what it needs.
        speed: at the end [m/s].
        trusted: share of the samples that are trustworthy; None where nobody looked.
        untrusted: the times that are not trustworthy, and why.
        unknown: sentences: what the log does not tell, and what to drive or measure to learn it.
        errors: against the truth in the log, if it has any: mass_kg, mass_pct, sideslip_deg,
            vx_m_s.
    """

    duration: float
    quantities: tuple[Quantity, ...] = ()
    sideslip: Sideslip | None = None
    speed: float
    trusted: float | None = None
    untrusted: tuple[Span, ...] = ()
    unknown: tuple[str, ...] = ()
    errors: dict[str, float] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """In types that JSON has."""
        return asdict(self)

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> Self:
        """What `to_json` gave.

        Raises:
            TypeError, KeyError: it is something else.
        """
        slip = content["sideslip"]
        lists = {
            "quantities": tuple(Quantity(**one) for one in content["quantities"]),
            "sideslip": None if slip is None else Sideslip(**slip),
            "untrusted": tuple(
                Span(**one | {"channels": tuple(one["channels"])}) for one in content["untrusted"]
            ),
            "unknown": tuple(content["unknown"]),
        }
        return cls(**content | lists)


def answer(found: Found, vehicle: Vehicle) -> Answer:
    """The answer to a log.

    Args:
        found: what an estimator made of it.
        vehicle: of the twin.
    """
    estimate, drive = found.estimate, found.drive
    trusted = estimate.trustworthy
    return Answer(
        duration=float(drive.time[-1] - drive.time[0]),
        quantities=tuple(_quantity(name, found, vehicle) for name in found.parameters),
        sideslip=_sideslip(found),
        speed=float(estimate["vx"][-1]),
        trusted=None if trusted is None else float(trusted.mean()),
        untrusted=trust_spans(estimate, drive),
        unknown=_unknown(found, vehicle),
        errors=_errors(found),
    )


def shown(name: str) -> Shown:
    """How a parameter of `twin.PARAMETERS` is shown."""
    if name in SCALES:
        return Shown("%", 100.0)
    return Shown("mm", 1000.0) if name.startswith("cm") else Shown(PARAMETER[name].unit, 1.0)


def nominal(name: str, found: Found, vehicle: Vehicle) -> float:
    """What the car's file says of a parameter [SI]; of the mass that of the whole car."""
    if name == "mass":
        return vehicle.figures.mass
    if name in SCALES:
        return 1.0
    return float(found.estimate.nominal[found.estimate.parameter_names.index(name)])


def sideslip(found: Found) -> Array:
    """(N,) of the twin's IMU, or of the point where a calibration measured it [rad]."""
    estimate = found.estimate
    if "sideslip" in estimate.output_names:
        return estimate["sideslip"]
    return np.arctan2(estimate["vy"], np.maximum(estimate["vx"], SLOWEST))


def _quantity(name: str, found: Found, vehicle: Vehicle) -> Quantity:
    estimate, (unit, per_si) = found.estimate, shown(name)
    change = per_si * float(estimate[name][-1])
    sd = found.sd.get(name)
    half = None if sd is None else NORMAL_95 * per_si * sd
    return Quantity(
        name=name,
        words=_WORDS.get(name, PARAMETER[name].words.removeprefix("the ")),
        unit=unit,
        value=per_si * nominal(name, found, vehicle) + change,
        change=change,
        sd=None if sd is None else per_si * sd,
        low=None if half is None else change - half,
        high=None if half is None else change + half,
        valid=bool(estimate.valid_of(name)[-1]),
        reason=estimate.reason_of(name),
    )


def _sideslip(found: Found) -> Sideslip | None:
    estimate = found.estimate
    if lacking("sideslip", measured([found.drive])):
        return None
    slip = np.degrees(sideslip(found))
    moves = estimate["vx"] > SLOWEST
    band = None
    if estimate.sideslip_sd is not None and moves.any():
        band = NORMAL_95 * float(np.degrees(_rms(estimate.sideslip_sd[moves])))
    largest = float(np.abs(slip[moves]).max()) if moves.any() else 0.0
    return Sideslip(end=float(slip[-1]), largest=largest, band=band)


def _unknown(found: Found, vehicle: Vehicle) -> tuple[str, ...]:
    """What the drive itself left open; of channels that are missing the notes tell."""
    estimate = found.estimate
    if estimate.valid is None and "mass" in found.sd:
        prior = _PRIOR_SHARE * vehicle.figures.mass
        if found.sd["mass"] > _LEARNT * prior:
            return (
                "This drive does not identify the mass "
                f"({100.0 * found.sd['mass'] / prior:.0f} % of the uncertainty is left): "
                f"{PARAMETER['mass'].advice}.",
            )
    return tuple(
        f"This drive does not identify {PARAMETER[name].words}: {PARAMETER[name].advice}."
        for name in found.parameters
        if not estimate.valid_of(name)[-1]
    )


def _errors(found: Found) -> dict[str, float]:
    drive, estimate = found.drive, found.estimate
    errors: dict[str, float] = {}
    if "mass" in found.parameters and "mass" in drive.truth:
        index = estimate.parameter_names.index("mass")
        delta = float(drive.truth["mass"][-1] - estimate.nominal[index])
        if np.isfinite(delta):
            errors["mass_kg"] = float(estimate["mass"][-1]) - delta
            if abs(delta) > 1e-9:
                step = float(np.median(np.diff(drive.time)))
                errors["mass_pct"] = rms_pct(estimate["mass"], delta, step)
    moves = estimate["vx"] > SLOWEST
    for name, estimated, scale, key in (
        ("sideslip", sideslip(found), 180.0 / np.pi, "sideslip_deg"),
        ("vx", estimate["vx"], 1.0, "vx_m_s"),
    ):
        if name in drive.truth:
            off = (estimated - drive.truth[name])[moves & np.isfinite(drive.truth[name])]
            if off.size:
                errors[key] = scale * _rms(off)
    return errors


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
