"""The picture of a plan: path, steering, speed, and what becomes known over time."""

from pathlib import Path

import numpy as np

from estimators.joint.expected import EVERY, expected_sd
from scenarios.planning.plan import Plan
from scenarios.planning.sheet import where
from scenarios.planning.wanted import shown
from scenarios.report.pictures import figure
from twin import PARAMETER

_COLOURS = {"swept steer": "C1", "step steer": "C2", "urban": "C4", "brake in turn": "C5"}


def draw(plan: Plan, path: Path) -> None:
    """Draws a plan.

    Args:
        plan: what is drawn.
        path: of the PNG file.
    """
    wanted = plan.task.wanted
    drive = plan.planned.driven.drive
    reached = plan.planned.seconds
    title = f"{plan.task.car.source.stem}: " + ", ".join(
        f"{name} to {shown(name, sd)}" for name, sd in wanted.items()
    )
    with figure(path, title=title, rows=3 + len(wanted), shared=False) as axes:
        x, y = where(drive)
        axes[0].plot(x, y)
        axes[0].set(xlabel="x [m]", ylabel="y [m]")
        if np.ptp(y) > 0.15 * np.ptp(x):
            axes[0].set_aspect("equal", adjustable="datalim")
        steering = np.degrees(drive.channel("steering_wheel_angle"))
        axes[1].plot(drive.time, steering)
        axes[1].set(ylabel="hand wheel [deg]")
        axes[2].plot(drive.time, drive.truth["vx"], label="driven")
        axes[2].plot(drive.time, plan.motion.speed, "--", color="0.5", label="wanted")
        axes[2].set(ylabel="speed [m/s]", xlabel="time [s]")
        axes[2].legend(loc="lower right")
        time = np.arange(EVERY, plan.task.limits.seconds + EVERY, EVERY)
        for ax, (name, sd) in zip(axes[3:], wanted.items(), strict=True):
            for option in (plan.planned, *plan.standard.values()):
                k = option.information.estimated.index(name)
                values = expected_sd(option.information, time, plan.task.error)[:, k]
                planned = option is plan.planned
                colour = "k" if planned else _COLOURS[option.name]
                ax.semilogy(time, values, color=colour, lw=2.0 if planned else 1.0,
                            label=option.name)  # fmt: skip
            ax.axhline(sd, color="0.4", ls=":", lw=1.0)
            if np.isfinite(reached) and reached <= time[-1]:
                ax.axvline(reached, color="k", ls=":", lw=1.0)
            unit = PARAMETER[name].unit
            ax.set(ylabel=f"sd of {name} [{unit}]", xlabel="time [s]")
            ax.grid(alpha=0.3, which="both")
        axes[3].legend(loc="upper right", ncols=2, fontsize="small")
