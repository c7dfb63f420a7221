"""The answer to a log as text for a terminal."""

from scenarios.logs.answer import Answer, Quantity
from scenarios.logs.trust_spans import Span

_LISTED = 6  # spans of a log that a terminal shows


def lines_of(answer: Answer) -> list[str]:
    """Estimates, what they rest on and what is not known, a line each."""
    lines = _masses(answer)
    lines += _table([one for one in answer.quantities if one.name != "mass"])
    lines += _motion(answer)
    lines += [f"not known: {sentence}" for sentence in answer.unknown]
    lines += _trust(answer)
    lines += _errors(answer)
    return lines


def headlines(answer: Answer) -> list[str]:
    """Mass, sideslip, speed and errors against the truth in the log, a line each."""
    return [*_masses(answer), *_motion(answer), *_errors(answer)]


def _masses(answer: Answer) -> list[str]:
    return [_mass(one) for one in answer.quantities if one.name == "mass"]


def _motion(answer: Answer) -> list[str]:
    lines = []
    if answer.sideslip is not None:
        slip = answer.sideslip
        band = ", no band" if slip.band is None else f" (95 % band, rms: +-{slip.band:.2g} deg)"
        lines.append(
            f"sideslip {slip.end:+.2f} deg at the end, at most {slip.largest:.2f} deg{band}"
        )
    return [*lines, f"speed {answer.speed:.1f} m/s at the end"]


def number(value: float) -> str:
    """Three significant digits, more for large numbers."""
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def signed(value: float) -> str:
    """A number with its sign."""
    return ("+" if value >= 0.0 else "-") + number(abs(value))


def interval(one: Quantity) -> str:
    """The 95 % interval of a change; empty if the estimator has none."""
    if one.low is None or one.high is None:
        return ""
    return f"{number(one.low)} to {number(one.high)}"


def _mass(one: Quantity) -> str:
    told = f" (95 %: {interval(one)})" if interval(one) else ""
    doubt = "" if one.valid else f"; not to be relied on: {one.reason}"
    return f"{one.words} {number(one.value)} {one.unit}, load {signed(one.change)} kg{told}{doubt}"


def _table(quantities: list[Quantity]) -> list[str]:
    if not quantities:
        return []
    cells = [("", "value", "change", "95 % of the change", "")]
    for one in quantities:
        doubt = "" if one.valid else f"not to be relied on: {one.reason}"
        cells.append(
            (
                one.words,
                f"{number(one.value)} {one.unit}",
                f"{signed(one.change)}",
                interval(one),
                doubt,
            )
        )
    widths = [max(len(row[i]) for row in cells) for i in range(4)]
    return [
        "  ".join(
            [
                row[0].ljust(widths[0]),
                *(cell.rjust(width) for cell, width in zip(row[1:4], widths[1:], strict=True)),
                row[4],
            ]
        ).rstrip()
        for row in cells
    ]


def _trust(answer: Answer) -> list[str]:
    if answer.trusted is None:
        return []
    lines = [f"trustworthy for {100.0 * answer.trusted:.0f} % of {answer.duration:.1f} s"]
    spans = answer.untrusted
    if answer.trusted == 0.0 and len(spans) == 1:
        return lines
    lines += [f"  not from {_span(one)}" for one in spans[:_LISTED]]
    if len(spans) > _LISTED:
        lines.append(f"  and {len(spans) - _LISTED} more times, see the JSON file")
    return lines


def _span(span: Span) -> str:
    return f"{span.start:.1f} to {span.end:.1f} s: {span.reason}"


def _errors(answer: Answer) -> list[str]:
    """Against the truth in the log."""
    errors, told = answer.errors, []
    if "mass_kg" in errors:
        share = f" (rms {errors['mass_pct']:.2g} % of the load)" if "mass_pct" in errors else ""
        told.append(f"mass {signed(errors['mass_kg'])} kg{share}")
    if "sideslip_deg" in errors:
        told.append(f"sideslip {errors['sideslip_deg']:.2g} deg rms")
    if "vx_m_s" in errors:
        told.append(f"speed {errors['vx_m_s']:.2g} m/s rms")
    return [f"against the truth in the log: {', '.join(told)}"] if told else []
