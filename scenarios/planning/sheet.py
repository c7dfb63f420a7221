"""A plan for a driver or a robot: instructions in words, and a table over time."""

import csv
from pathlib import Path

import numpy as np

from estimators.joint.expected import REAL_CAR, expected_sd
from scenarios.experiment.result import replacing
from scenarios.planning.design import hand_wheel_of
from scenarios.planning.plan import Plan
from scenarios.planning.wanted import shown
from twin import PARAMETER, Drive

_EVERY = 0.02  # [s] between lines of the table
_SLIGHT = 0.05  # share of the largest sine below which a sine is left out of the words


def instructions(plan: Plan) -> str:
    """What a driver does, in plain words, and what becomes known of it."""
    return "\n".join([*_how(plan), "", *_steering(plan), "", *_what_for(plan)]) + "\n"


def _how(plan: Plan) -> list[str]:
    design, limits = plan.design, plan.task.limits
    up, fast, down, slow = design.times()
    seconds = plan.planned.seconds
    if np.isfinite(limits.length):
        pass_time = plan.planned.driven.drive.duration
        passes = f"{int(np.ceil(seconds / pass_time))}" if np.isfinite(seconds) else "as many"
        lines = [
            f"In an area of {limits.length:g} m x {limits.width:g} m, {passes} passes of "
            f"{pass_time:.1f} s, each from a standstill to a standstill.",
            f"Set off with up to {design.accelerating:.1f} m/s2 to {design.slow:.1f} m/s, then:",
        ]
    else:
        whole = plan.planned.driven.drive.duration
        road = f"a {limits.road} road" if limits.road == "straight" else "the circuit"
        lines = [
            f"On {road} of {limits.width:g} m width, {whole:.0f} s, beginning at "
            f"{design.slow:.1f} m/s. Again and again:"
        ]
    if up > 0.05:
        lines.append(
            f"  {up:.1f} s: speed up smoothly from {design.slow:.1f} to {design.fast:.1f} m/s, "
            f"at most {design.accelerating:.1f} m/s2;"
        )
    lines.append(f"  {fast:.1f} s: hold {design.fast:.1f} m/s;")
    if down > 0.05:
        lines.append(
            f"  {down:.1f} s: brake smoothly to {design.slow:.1f} m/s, at most "
            f"{design.braking:.1f} m/s2;"
        )
        lines.append(f"  {slow:.1f} s: hold {design.slow:.1f} m/s.")
    if np.isfinite(limits.length):
        lines.append(f"Brake with {design.braking:.1f} m/s2 so that the car stands at the end.")
    return lines


def _steering(plan: Plan) -> list[str]:
    design = plan.design
    gains = np.degrees(hand_wheel_of(plan.task.car, np.array([design.slow, design.fast])))
    largest = max(design.accelerations)
    if plan.scale * largest < 1e-3:
        return ["The hand wheel stays straight."]
    lines = ["All the time, turn the hand wheel to and fro, around straight ahead, in one movement"]
    lines[0] += " of these sines:"
    for frequency, amplitude in zip(design.frequencies, design.accelerations, strict=True):
        if amplitude > _SLIGHT * largest:
            slow, fast = plan.scale * amplitude * gains
            at = f"{fast:.0f} deg"
            if design.fast - design.slow > 1.0:
                at = f"{slow:.0f} deg at {design.slow:.1f} m/s, {fast:.0f} deg at "
                at += f"{design.fast:.1f} m/s"
            lines.append(f"  {frequency:.2f} Hz, {at};")
    if design.fast - design.slow > 0.5:
        lines.append(f"while braking {100.0 * design.while_braking:.0f} % of that.")
    lines.append("Keep the car in the middle by small, slow corrections besides.")
    return lines


def _what_for(plan: Plan) -> list[str]:
    """What becomes known, when, and what a wrong model would leave of it."""
    planned = plan.planned
    horizon = min(planned.seconds, plan.task.limits.seconds)
    sds = expected_sd(planned.information, [horizon], plan.task.error)[0]
    wrong = expected_sd(planned.information, [horizon], REAL_CAR)[0]
    lines = [f"Known after {horizon:.1f} s (standard deviations):"]
    for name, wanted in plan.task.wanted.items():
        k = planned.information.estimated.index(name)
        left = shown(name, float(wrong[k]))
        if wrong[k] > 0.95 * planned.information.prior[k]:
            left = "no better than before"
        lines.append(
            f"  {PARAMETER[name].words}: {shown(name, float(sds[k]))} (wanted "
            f"{shown(name, wanted)}); if the car differs from its files as cars of a type do, by "
            f"the budget of model error: {left};"
        )
    if plan.cars:
        low, high = min(plan.cars), max(plan.cars)
        lines.append(
            f"of {len(plan.cars)} cars drawn from what is believed before the drive: reached after "
            f"{low:.1f} to {high:.1f} s."
        )
    return lines


def write_table(plan: Plan, path: Path) -> None:
    """A CSV over time: what a robot follows, and where the twin's own car goes.

    Columns: time [s], speed wanted [m/s], hand wheel of the plan alone and with the lane keeper's
    corrections [rad], x, y [m].
    """
    drive, motion = plan.planned.driven.drive, plan.motion
    step = round(_EVERY / drive.dt)
    columns = {
        "time": drive.time,
        "speed": motion.speed,
        "steering_wheel_angle": motion.steering,
        "steering_wheel_angle_in_lane": drive.channel("steering_wheel_angle"),
        "x": drive.truth["x"],
        "y": drive.truth["y"],
    }
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        for row in np.column_stack(list(columns.values()))[::step]:
            writer.writerow([f"{value:.5g}" for value in row])


def where(drive: Drive) -> tuple[np.ndarray, np.ndarray]:
    """Position x, y [m] along the drive, the start at the origin."""
    return drive.truth["x"] - drive.truth["x"][0], drive.truth["y"] - drive.truth["y"][0]
