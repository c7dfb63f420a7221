"""The car of a timeline in 3D: its shapes, poses, tyre forces and path, logged to Rerun."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

import twin
from estimators.base import Estimate

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

Array = NDArray[np.float64]

WORLD = "world"
BACKGROUND = (24, 27, 32)
NEWTONS_PER_METRE = 5000.0  # scale of the force arrows
_CHASSIS_OPACITY = 0.45  # shows loads and forces inside
_FORCE_COLOUR = (240, 190, 40)
_PATH_COLOUR = (130, 150, 170)
_SHAPES = {
    "boxes": (mujoco.mjtGeom.mjGEOM_BOX,),
    "cylinders": (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE),
    "ellipsoids": (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_ELLIPSOID),
}


class Motion(NamedTuple):
    """How a car moves over n frames.

    Attributes:
        time: (n,) [s].
        states: (n, 28) `twin.STATES`.
        steering: (n,) steering wheel angle [rad].
        road: (n, 4) height under each wheel [m].
        forces: (n, 4, 3) of the tyres in their contact frames [N]; None where nobody knows them.
    """

    time: Array
    states: Array
    steering: Array
    road: Array
    forces: Array | None


class Poses(NamedTuple):
    """Where the bodies of a car are over n frames, in the world.

    Attributes:
        positions: (n, nbody, 3) [m].
        quaternions: (n, nbody, 4) w x y z.
        wheels: (4,) ids of the wheels' bodies.
        axes: (n, 4, 3) the wheels' spin axes, to the left.
    """

    positions: Array
    quaternions: Array
    wheels: NDArray[np.int64]
    axes: Array


class _Look(NamedTuple):
    """How shapes look: (ngeom, 4) colours, or outlines of one colour instead."""

    colours: NDArray[np.float32]
    outlines: tuple[int, int, int] | None


def motion(drive: twin.Drive, estimate: Estimate, frames: NDArray[np.int64]) -> Motion:
    """The real vehicle's motion at some samples; what its truth lacks is taken from the twin."""
    unknown = np.full(len(drive), np.nan)

    def truth(names: tuple[str, ...]) -> Array:
        return np.stack([drive.truth.get(name, unknown)[frames] for name in names], axis=1)

    states = truth(twin.STATES)
    names = tuple(f"{force}_{wheel}" for wheel in twin.WHEELS for force in ("fx", "fy", "fz"))
    forces = truth(names).reshape(-1, 4, 3)
    return Motion(
        time=drive.time[frames],
        states=np.where(np.isfinite(states), states, estimate.states[frames]),
        steering=drive.channel("steering_wheel_angle")[frames],
        road=np.stack([drive.channel(f"road_height_{w}")[frames] for w in twin.WHEELS], axis=1),
        forces=forces if np.isfinite(forces).all() else None,
    )


def poses(model: mujoco.MjModel, moved: Motion) -> Poses:
    """Places the car's bodies at every frame. Leaves the model steered as in the last frame."""
    data = mujoco.MjData(model)
    wheels = np.array([model.body(f"wheel_{wheel}").id for wheel in twin.WHEELS])
    qpos = _qpos(model, moved.states)
    angles = _road_wheel_angles(model, wheels, moved.steering)
    positions = np.empty((len(qpos), model.nbody, 3))
    quaternions = np.empty((len(qpos), model.nbody, 4))
    axes = np.empty((len(qpos), 4, 3))
    for i in range(len(qpos)):
        data.qpos[:] = qpos[i]
        model.body_quat[wheels[:2], 0] = np.cos(0.5 * angles[i])
        model.body_quat[wheels[:2], 3] = np.sin(0.5 * angles[i])
        mujoco.mj_kinematics(model, data)
        positions[i], quaternions[i] = data.xpos, data.xquat
        axes[i] = data.xmat[wheels][:, 1::3]
    return Poses(positions, quaternions, wheels, axes)


def _qpos(model: mujoco.MjModel, states: Array) -> Array:
    """(n, nq) coordinates of MuJoCo from (n, 28) states."""

    def state(name: str) -> Array:
        return states[:, twin.STATES.index(name)]

    qpos = np.zeros((len(states), model.nq))
    qpos[:, :3] = states[:, twin.POSITION]
    for row, angles in zip(qpos, states[:, twin.ROTATION], strict=True):
        mujoco.mju_euler2Quat(row[3:7], np.ascontiguousarray(angles[::-1]), "zyx")
    for wheel in twin.WHEELS:
        qpos[:, model.joint(f"travel_{wheel}").qposadr[0]] = state(f"suspension_travel_{wheel}")
        qpos[:, model.joint(f"spin_{wheel}").qposadr[0]] = state(f"wheel_angle_{wheel}")
    return qpos


def _road_wheel_angles(model: mujoco.MjModel, wheels: NDArray[np.int64], steering: Array) -> Array:
    """(n, 2) angles of the front wheels [rad], steered as the twin steers them."""
    hubs = model.body_pos[model.body_parentid[wheels]]
    track, wheelbase = hubs[0, 1] - hubs[1, 1], hubs[:2, 0].mean() - hubs[2:, 0].mean()
    tangent = np.tan(steering / model.numeric("steering_ratio").data[0])[:, None]
    inner = 0.5 * model.numeric("ackermann").data[0] * track / wheelbase * tangent
    return np.arctan(tangent / (1.0 - np.array([1.0, -1.0]) * inner))


def contacts(placed: Poses, road: Array) -> tuple[Array, Array]:
    """Where the tyres meet the road, and how their contact frames stand.

    Args:
        placed: poses of n frames.
        road: (n, 4) height under each wheel [m].

    Returns:
        (n, 4, 3) contact points in the world [m] and (n, 4, 3, 3) frames, axes x, y, z as rows.
    """
    centres = placed.positions[:, placed.wheels]
    ground = np.concatenate([centres[..., :2], road[..., None]], axis=2)
    normal = np.cross(ground[:, 1] - ground[:, 2], ground[:, 0] - ground[:, 3])[:, None]
    normal = np.broadcast_to(_unit(normal), centres.shape)
    ahead = _unit(np.cross(placed.axes, normal))
    upright = np.cross(ahead, placed.axes)
    height = (centres[..., 2] - road) * normal[..., 2] / np.sum(upright * normal, axis=2)
    points = centres - height[..., None] * upright
    return points, np.stack([ahead, np.cross(normal, ahead), normal], axis=2)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def scene(subject: str, moved: Motion) -> rrb.Spatial3DView:
    """The view of the car on a ground grid, the eye behind its right shoulder and following it."""
    start, yaw = moved.states[0, twin.POSITION], moved.states[0, twin.X.yaw]
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    forces = f", tyre forces (1 m = {NEWTONS_PER_METRE / 1000:g} kN)"
    name = subject if moved.forces is None else subject + forces
    return view_of(name, start + turn @ (-5.2, -3.9, 2.4), start)


def view_of(name: str, eye: Array, target: Array) -> rrb.Spatial3DView:
    """A view of the world on a ground grid; the eye (3,) looks at a target (3,) and follows it."""
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin=WORLD,
        name=name,
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(spacing=5.0, color=(255, 255, 255, 40)),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=eye,
            look_target=target,
            tracking_entity=f"{WORLD}/chassis/boxes",  # an eye can only follow what is drawn
        ),
    )


def log_car(
    recording: rr.RecordingStream,
    model: mujoco.MjModel,
    moved: Motion,
    *,
    opacity: float = _CHASSIS_OPACITY,
) -> None:
    """Logs the car's shapes, poses, path and, where they are known, tyre forces.

    Args:
        recording: to log to.
        model: of the car.
        moved: what it does.
        opacity: of the chassis, 0..1.
    """
    import rerun as rr

    placed = poses(model, moved)
    points, axes = contacts(placed, moved.road)
    index = [rr.TimeColumn("time", duration=moved.time)]
    log_bodies(recording, model, index, placed.positions, placed.quaternions, opacity=opacity)
    path = rr.LineStrips3D([points.mean(axis=1)], colors=_PATH_COLOUR, radii=0.04)
    recording.log(f"{WORLD}/path", path, static=True)
    _log_road(recording, points)
    if moved.forces is not None:
        vectors = np.einsum("nwi,nwij->nwj", moved.forces, axes) / NEWTONS_PER_METRE
        _log_forces(recording, index, points, vectors)


def _log_road(recording: rr.RecordingStream, points: Array) -> None:
    """Logs the road as a ribbon under the front wheels, to scale; the lighter, the higher.

    Args:
        recording: to log to.
        points: (n, 4, 3) where the wheels touch the road [m].
    """
    import rerun as rr

    left, right = points[:, 0], points[:, 1]
    shoulder = 0.5 * (left - right)
    edges = np.stack([left + shoulder, right - shoulder], axis=1)
    vertices = edges.reshape(-1, 3)
    height = vertices[:, 2] - vertices[:, 2].min()
    shade = 50.0 + 130.0 * height / max(height.max(), 1e-3)
    corner = 2 * np.arange(len(points) - 1)[:, None, None]
    triangles = (corner + np.array([[0, 1, 2], [2, 1, 3]])).reshape(-1, 3)
    ribbon = rr.Mesh3D(
        vertex_positions=vertices,
        triangle_indices=triangles,
        vertex_normals=np.tile([0.0, 0.0, 1.0], (len(vertices), 1)),
        vertex_colors=np.repeat(shade[:, None], 3, axis=1).astype(np.uint8),
    )
    recording.log(f"{WORLD}/road", ribbon, static=True)


def log_bodies(
    recording: rr.RecordingStream,
    model: mujoco.MjModel,
    index: list[rr.TimeColumn],
    positions: Array,
    quaternions: Array,
    *,
    root: str = WORLD,
    opacity: float = _CHASSIS_OPACITY,
    outlines: tuple[int, int, int] | None = None,
) -> None:
    """Logs the shapes of all bodies, and their poses over n frames as in `Poses`.

    Args:
        recording: to log to.
        model: whose shapes.
        index: of the frames.
        positions: (n, nbody, 3) [m].
        quaternions: (n, nbody, 4).
        root: entity above the bodies.
        opacity: of the chassis, 0..1.
        outlines: colour of the outlines that stand for the shapes; by default shapes are solid.
    """
    import rerun as rr

    recording.log(WORLD, rr.ViewCoordinates.FLU, static=True)
    for body in np.unique(model.geom_bodyid[model.geom_bodyid > 0]):
        name = f"{root}/{model.body(body).name}"
        look = _Look(_colours(model, opacity), outlines)
        _log_shapes(recording, name, model, body, look)
        columns = rr.Transform3D.columns(
            translation=positions[:, body],
            quaternion=quaternions[:, body][:, [1, 2, 3, 0]],
        )
        recording.send_columns(name, index, columns)


def _log_forces(
    recording: rr.RecordingStream, index: list[rr.TimeColumn], points: Array, vectors: Array
) -> None:
    import rerun as rr

    entity = f"{WORLD}/tyre_forces"
    recording.log(entity, rr.Arrows3D.from_fields(colors=_FORCE_COLOUR, radii=0.035), static=True)
    columns = rr.Arrows3D.columns(vectors=vectors.reshape(-1, 3), origins=points.reshape(-1, 3))
    recording.send_columns(entity, index, columns.partition(np.full(len(points), 4)))


def _log_shapes(
    recording: rr.RecordingStream,
    entity: str,
    model: mujoco.MjModel,
    body: int,
    look: _Look,
) -> None:
    """Logs a body's boxes, cylinders and ellipsoids in its frame; other shapes are left out."""
    import rerun as rr

    for shape, types in _SHAPES.items():
        geoms = np.flatnonzero((model.geom_bodyid == body) & np.isin(model.geom_type, types))
        if not geoms.size:
            continue
        size = model.geom_size[geoms]
        common = {
            "centers": model.geom_pos[geoms],
            "quaternions": model.geom_quat[geoms][:, [1, 2, 3, 0]],
            "colors": look.colours[geoms] if look.outlines is None else look.outlines,
            "fill_mode": "solid" if look.outlines is None else "majorwireframe",
        }
        if shape == "boxes":
            drawn = rr.Boxes3D(half_sizes=size, **common)
        elif shape == "cylinders":
            drawn = rr.Cylinders3D(lengths=2.0 * size[:, 1], radii=size[:, 0], **common)
        else:
            half = np.where(size > 0.0, size, size[:, :1])  # a sphere has but one radius
            drawn = rr.Ellipsoids3D(half_sizes=half, **common)
        recording.log(f"{entity}/{shape}", drawn, static=True)


def _colours(model: mujoco.MjModel, opacity: float) -> NDArray[np.float32]:
    """(ngeom, 4) red, green, blue, opacity in 0..1: those of the material where there is one."""
    material = model.geom_matid
    colours = model.geom_rgba.copy()
    colours[material >= 0] = model.mat_rgba[material[material >= 0]]
    colours[model.geom_bodyid == model.body("chassis").id, 3] *= opacity
    return colours
