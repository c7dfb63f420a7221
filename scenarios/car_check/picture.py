"""A car drawn to scale with its dimensions, and what it does when it is driven."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from scenarios.car_check.check import Checked
from scenarios.report.pictures import canvas
from twin import WHEELS, Twin

_BODY, _LINES, _INK = "#c9d6e4", "#8a97a6", "#22303f"
_GRAVITY = 9.81
_TYRE_WIDTH = 0.2  # [m], drawn
_AHEAD, _UP = (0, 2), (0, 1)  # axes of the side and of the top view


def draw(checked: Checked, path: Path) -> None:
    """Writes the picture as PNG.

    Raises:
        TwinError: matplotlib is not installed, or the file cannot be written.
    """
    title = f"{checked.vehicle.source.name}: {checked.vehicle.figures.mass:.0f} kg"
    with canvas(path, title=title, size=(11.0, 10.0)) as sheet:
        axes = sheet.subplot_mosaic(
            [["side", "top"], ["ramp", "roll"], ["step", "pedals"]], height_ratios=(1.25, 1.0, 1.0)
        )
        twin = Twin(checked.vehicle)
        twin.reset(0.0)
        _side(axes["side"], twin)
        _top(axes["top"], twin)
        _ramp(axes["ramp"], axes["roll"], checked)
        _step(axes["step"], checked)
        _pedals(axes["pedals"], checked)


def _side(axes: Any, twin: Twin) -> None:
    """From its left: the front points to the right, as x does."""
    car = twin.vehicle.figures
    _body(axes, twin, _AHEAD)
    hubs = _hubs(twin)
    for x, _, z in hubs[[0, 2]]:
        axes.add_patch(_circle((x, z), z))
    axes.axhline(0.0, color=_INK, lw=1.0)
    cm, imu = _cm(twin), twin.data.body("chassis").xpos
    axes.plot(cm[0], cm[2], "o", color="#c0392b", label="centre of mass")
    axes.plot(imu[0], imu[2], "x", color=_INK, label="IMU")
    front, rear = hubs[0, 0], hubs[2, 0]
    _across(axes, rear, front, -0.18, f"wheelbase {car.wheelbase:.3f} m")
    _across(axes, cm[0], front, -0.42, f"{front - cm[0]:.3f} m")
    _upright(axes, cm[0] - 0.08, 0.0, cm[2], f"CM {cm[2]:.2f} m")
    for axle, x in enumerate((front, rear)):
        text = (
            f"{car.axle_load[axle] / _GRAVITY:.0f} kg\nR {1000.0 * car.wheel_radius[axle]:.0f} mm"
        )
        axes.text(x, -0.66, text, ha="center", va="top", fontsize=8)
    axes.set_ylim(-1.05, None)
    _finish(axes, "x [m]", "z [m]")


def _top(axes: Any, twin: Twin) -> None:
    """From above: left is up."""
    car = twin.vehicle.figures
    _body(axes, twin, _UP)
    hubs = _hubs(twin)
    for (x, y, _), radius in zip(hubs, np.repeat(car.wheel_radius, 2), strict=True):
        axes.add_patch(_box(x - radius, y - 0.5 * _TYRE_WIDTH, 2.0 * radius, _TYRE_WIDTH))
    cm, imu = _cm(twin), twin.data.body("chassis").xpos
    axes.plot(cm[0], cm[1], "o", color="#c0392b", label="centre of mass")
    axes.plot(imu[0], imu[1], "x", color=_INK, label="IMU")
    for axle, wheel in enumerate((0, 2)):
        x = hubs[wheel, 0] + (-1.0 if axle else 1.0) * (car.wheel_radius[axle] + 0.12)
        _upright(axes, x, hubs[wheel + 1, 1], hubs[wheel, 1], f"{car.track[axle]:.3f} m")
    loads = twin.tyre_forces()[:, 2] / _GRAVITY
    for (x, y, _), load in zip(hubs, loads, strict=True):
        out = np.sign(y) * (0.5 * _TYRE_WIDTH + 0.12)
        axes.text(x, y + out, f"{load:.0f} kg", ha="center", va="center", fontsize=8)
    axes.legend(fontsize=7, loc="upper center", ncols=2, bbox_to_anchor=(0.5, 1.18))
    axes.margins(y=0.15)
    _finish(axes, "x [m]", "y [m]")


def _ramp(axes: Any, rolls: Any, checked: Checked) -> None:
    """Hand wheel and roll over lateral acceleration."""
    found = checked.cornering
    felt = found.lateral / _GRAVITY
    axes.plot(felt, np.degrees(found.hand_wheel), color="C0")
    gradient = np.degrees(found.understeer) * _GRAVITY
    title = f"80 km/h: understeer gradient {gradient:.2f} deg/g"
    _label(axes, title, "a_y [g]", "hand wheel [deg]")
    rolls.plot(felt, np.degrees(found.roll), color="C1")
    gradient = np.degrees(found.roll_gradient) * _GRAVITY
    inside = f"{100.0 * found.inside:.0f} % of the load inside at the end"
    _label(rolls, f"roll gradient {gradient:.2f} deg/g; {inside}", "a_y [g]", "roll [deg]")


def _step(axes: Any, checked: Checked) -> None:
    found = checked.step
    axes.plot(found.time, np.degrees(found.yaw_rate), color="C0", label="yaw rate [deg/s]")
    axes.plot(found.time, found.lateral, color="C3", label="a_y of the IMU [m/s2]")
    axes.axvline(0.0, color=_LINES, lw=0.8)
    axes.legend(fontsize=7)
    text = f"step steer: 90 % after {found.rise:.2f} s, overshoot {100 * found.overshoot:.0f} %"
    _label(axes, text, "time [s]", "")


def _pedals(axes: Any, checked: Checked) -> None:
    found = checked.pedals
    axes.plot(found.time, 3.6 * found.speed, color="C2")
    there = np.isfinite(found.hundred)
    reached = f"after {found.hundred:.1f} s" if there else "not reached"
    _label(axes, f"full power: 100 km/h {reached}", "time [s]", "speed [km/h]")


def _label(axes: Any, title: str, x: str, y: str) -> None:
    axes.set_title(title, fontsize=9)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(alpha=0.3)


def _finish(axes: Any, x: str, y: str) -> None:
    axes.set_aspect("equal")
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.tick_params(labelsize=7)


def _hubs(twin: Twin) -> np.ndarray:
    """(4, 3) centres of the wheels in the world [m]."""
    return np.array([twin.data.body(f"wheel_{wheel}").xpos for wheel in WHEELS])


def _cm(twin: Twin) -> np.ndarray:
    """(3,) centre of mass of the whole car in the world [m]."""
    mujoco.mj_comPos(twin.model, twin.data)
    return twin.data.subtree_com[0]


def _body(axes: Any, twin: Twin, view: tuple[int, int]) -> None:
    """The drawn shapes of the chassis as boxes."""
    model, data = twin.model, twin.data
    body = model.body("chassis").id
    for geom in np.flatnonzero(model.geom_bodyid == body):
        centre = (
            data.geom_xpos[geom] + data.geom_xmat[geom].reshape(3, 3) @ model.geom_aabb[geom, :3]
        )
        half = np.abs(data.geom_xmat[geom].reshape(3, 3)) @ model.geom_aabb[geom, 3:]
        low = centre - half
        axes.add_patch(
            _box(low[view[0]], low[view[1]], *(2.0 * half[list(view)]), face=_BODY, edge=_LINES)
        )


def _box(x: float, y: float, width: float, height: float, face: str = _INK, edge: str = _INK):
    from matplotlib.patches import Rectangle  # an extra, and slow to import

    return Rectangle((x, y), width, height, facecolor=face, edgecolor=edge, alpha=0.8)


def _circle(centre: tuple[float, float], radius: float):
    from matplotlib.patches import Circle  # an extra, and slow to import

    return Circle(centre, radius, facecolor="#4a5560", edgecolor=_INK, alpha=0.8)


def _across(axes: Any, left: float, right: float, height: float, text: str) -> None:
    """A dimension along x."""
    _arrow(axes, (left, height), (right, height))
    axes.text(0.5 * (left + right), height - 0.02, text, ha="center", va="top", fontsize=8)


def _upright(axes: Any, x: float, low: float, high: float, text: str) -> None:
    """A dimension along the vertical axis of the view."""
    _arrow(axes, (x, low), (x, high))
    middle = 0.5 * (low + high)
    axes.text(x - 0.03, middle, text, ha="right", va="center", fontsize=8, rotation=90)


def _arrow(axes: Any, start: tuple[float, float], end: tuple[float, float]) -> None:
    style = {"arrowstyle": "<->", "color": _INK, "lw": 0.9, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=start, xytext=end, arrowprops=style)
    axes.update_datalim([start, end])
    axes.autoscale_view()
