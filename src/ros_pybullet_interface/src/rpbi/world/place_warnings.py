"""Warnings about poses of bodies and about TF frames, for instance of bodies that overlap or are far away."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import pybullet

from custom_ros_tools.errors import Problem, closest, hint
from robot_model.geometry import dot, minus, scaled
from rpbi.bodies import Body
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.bodies.shape_object import ShapeObject
from rpbi.config.world import WORLD_FRAME
from rpbi.engine.client import MAXIMAL_COORDINATES
from rpbi.engine.inputs import PoseInput
from rpbi.sensors.link_pose import LinkPoseSensor

from .world import World

MAX_NAMES = 3
"""Maximum number of bodies or links that a warning names; further ones are only counted."""
FAR_M = 100.0
"""Largest plausible coordinate of a position [m]; a larger one was probably given in millimetres."""
TOUCHING_M = 1e-3
"""Depth [m] up to which overlapping bodies count as touching, since PyBullet adds margins to meshes."""
HANGING_M = 0.02
"""Smallest gap [m] below a body of mass 0 for a warning that the body hangs in the air."""
MAX_FALL_M = 100.0
"""Largest height [m] above a plane from which a body is expected to fall onto the plane."""
LEVEL = 0.9999
"""Cosine of the largest slope at which a surface counts as level."""
PLANE_ADVICE = (
    "planes lose contact points of what slides on them, and forces chatter; use a box, such as {shapeType: GEOM_BOX, "
    "halfExtents: [50, 50, 0.5], collisionFramePosition: [0, 0, -0.5]}"
)
ROLLING_ADVICE = "changeDynamics: {rollingFriction: 0.001} stops it, rollingFriction: 0 states that it may roll"
_FLAT = ({pybullet.GEOM_PLANE}, {pybullet.GEOM_BOX})
_ROUND = {pybullet.GEOM_SPHERE, pybullet.GEOM_CAPSULE}


def place_warnings(world: World) -> Iterator[Problem]:
    """Yields a warning for each body or TF frame whose pose is probably not intended."""
    yield from _Frames(world).warnings()
    yield from _far(world)
    yield from _overlaps(world)
    yield from _planes(world)
    yield from _rolling(world)
    yield from _hanging(world)


def _far(world: World) -> Iterator[Problem]:
    for index, each in enumerate(world.config.poses):
        if _is_far(each.position):
            yield Problem(world.loaded.file, f"poses[{index}].position", _far_message(each.position))
    for item in world.loaded.objects:
        body, load = world.bodies[item.config.name], getattr(item.config, "loadURDF", None)
        given = getattr(item.config if load is None else load, "basePosition", None)
        if given is not None and not body.is_soft and _is_far(given):
            yield Problem(item.file, f"{'loadURDF.' if load is not None else ''}basePosition", _far_message(given))


def _is_far(position: Sequence[float]) -> bool:
    return max(map(abs, position)) > FAR_M


def _far_message(position: Sequence[float]) -> str:
    return f"is {math.hypot(*position):.4g} m from the origin: positions are in metres"


def _rolling(world: World) -> Iterator[Problem]:
    """Yields a warning for each ball or capsule that rolls endlessly on a level floor for lack of rolling friction."""
    placed = [body for body in world.bodies.values() if _has_place(world, body)]
    floors = [body for body in placed if is_still(body, -1) and _shape_kinds(body) in _FLAT]
    for body in placed:
        dynamics = getattr(getattr(body, "config", None), "changeDynamics", None)
        is_meant = dynamics is not None and "rollingFriction" in dynamics.model_fields_set
        kinds = _shape_kinds(body) if isinstance(body, ShapeObject) and not is_meant else set()
        if not kinds or not kinds <= _ROUND or is_still(body, -1) or body.dynamics_info(-1)[6]:
            continue
        for floor in floors:
            if not floor.dynamics_info(-1)[6] and _is_below(world, floor, body, LEVEL):
                message = f"'{body.name}' rolls on '{floor.name}' without end: {ROLLING_ADVICE}"
                yield Problem(file_of(world, body.name), "changeDynamics.rollingFriction", message)
                break


def _hanging(world: World) -> Iterator[Problem]:
    """Yields a warning for each URDF object that hangs in the air because its mass is 0."""
    for item in world.loaded.objects:
        body, load = world.bodies[item.config.name], getattr(item.config, "loadURDF", None)
        if load is None or load.useFixedBase or not _has_place(world, body) or body.joint_indices:
            continue
        if body.dynamics_info(-1)[0] == 0.0 and world.pb.gravity[2] < 0.0:
            lower, upper = body.pb.getAABB(body.body_id, -1)
            foot = 0.5 * (lower[0] + upper[0]), 0.5 * (lower[1] + upper[1]), lower[2] - TOUCHING_M
            ((below, _, fraction, *_),) = world.pb.rayTest(foot, minus(foot, (0.0, 0.0, MAX_FALL_M)))
            if below >= 0 and (gap_m := fraction * MAX_FALL_M) > HANGING_M:
                message = f"'{body.name}' has mass 0, so it stays {gap_m:.2g} m above what is below it"
                yield Problem(item.file, "loadURDF.fileName", f"{message}; useFixedBase: true states that it is fixed")


def _overlaps(world: World) -> Iterator[Problem]:
    """Yields a warning for each pair of overlapping bodies that PyBullet will push apart."""
    for one, other in _neighbours([body for body in world.bodies.values() if _has_place(world, body)]):
        points = world.pb.getClosestPoints(one.body_id, other.body_id, 0.0)
        depths = {(point[3], point[4]): -point[8] for point in sorted(points, key=lambda point: -point[8])}
        depths = {links: depth for links, depth in depths.items() if not _are_still(one, other, *links)}
        if depths and (deepest := max(depths.items(), key=lambda item: item[1]))[1] > TOUCHING_M:
            (link, other_link), depth = deepest
            parts = f"{_named(one, link)} and {_named(other, other_link)} overlap by {depth:.2g} m"
            yield Problem(file_of(world, one.name), "", f"at the start, {parts}, and will be pushed apart")


def _neighbours(bodies: Sequence[Body]) -> Iterator[tuple[Body, Body]]:
    """Yields the pairs of bodies whose bounding boxes overlap."""
    links = [[body.pb.getAABB(body.body_id, index) for index in (-1, *body.joint_indices)] for body in bodies]
    lower = np.array([np.min([box[0] for box in boxes], axis=0) for boxes in links]).reshape(-1, 3)
    upper = np.array([np.max([box[1] for box in boxes], axis=0) for boxes in links]).reshape(-1, 3)
    meet = np.all(lower[:, None] <= upper[None], axis=2)
    for one, other in np.argwhere(np.triu(meet & meet.T, 1)):
        yield bodies[one], bodies[other]


def _planes(world: World) -> Iterator[Problem]:
    """Yields a warning for each plane on which bodies rest or will rest, since PyBullet loses contacts with planes."""
    placed = [body for body in world.bodies.values() if _has_place(world, body)]
    for plane in placed:
        if _shape_kinds(plane) != {pybullet.GEOM_PLANE}:
            continue
        names = [f"'{body.name}'" for body in placed if _needs_points(body) and _is_below(world, plane, body)]
        if names:
            rest = f"{some(names)} rest{'s' if len(names) == 1 else ''} on this plane"
            key = "createCollisionShape.shapeType" if isinstance(plane, ShapeObject) else "loadURDF.fileName"
            yield Problem(file_of(world, plane.name), key, f"{rest}: {PLANE_ADVICE}")


def _shape_kinds(body: Body) -> set[int]:
    """Returns PyBullet's types of all collision shapes of a body; an empty set for a body in maximal coordinates."""
    if body.dynamics_info(-1)[10] == MAXIMAL_COORDINATES:
        return set()
    links = (-1, *body.link_indices)
    return {shape[2] for link in links for shape in body.pb.getCollisionShapeData(body.body_id, link)}


def _needs_points(body: Body) -> bool:
    """Returns whether a body can fall and is not a ball, so that it needs several contact points to rest."""
    return not is_still(body, -1) and _shape_kinds(body) != {pybullet.GEOM_SPHERE}


def _is_below(world: World, plane: Body, body: Body, level: float = 0.0) -> bool:
    """Returns True if a body rests on `plane`, or if it will fall onto `plane`.

    Args:
        world: The world.
        plane: The plane, or another body that can be a floor.
        body: The body that may rest on `plane`.
        level: Minimum cosine of the slope angle at the nearest point of `plane`; 0 accepts every slope.
    """
    points = world.pb.getClosestPoints(body.body_id, plane.body_id, MAX_FALL_M)
    if not points:
        return False
    nearest = min(points, key=lambda point: point[8])
    lowest, below, normal, gap = nearest[5:9]
    if dot(normal, world.pb.gravity) >= -level * math.hypot(*world.pb.gravity):
        return False
    if gap <= TOUCHING_M:
        return True
    ((hit, *_),) = world.pb.rayTest(lowest, minus(below, scaled(TOUCHING_M, normal)))
    return bool(hit == plane.body_id)


def _has_place(world: World, body: Body) -> bool:
    """Returns whether a body is rigid, takes part in the physics, and does not follow a TF frame of another node."""
    is_placed = body.object_tf is None or world.config.pose_of(body.object_tf.tf_id) is not None
    return body.has_physics and not body.is_soft and is_placed


def _named(body: Body, link: int) -> str:
    return f"'{body.name}'" if not body.joint_indices else f"'{body.name}/{body.link_name(link)}'"


def _are_still(one: Body, other: Body, link: int, other_link: int) -> bool:
    return is_still(one, link) and is_still(other, other_link)


class _Frames:
    """The TF frames that a world publishes, and the TF frames that its bodies and cameras follow."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._published = world.frames()
        self._followed = {slot: each for slot, each in world.inputs.items() if isinstance(each, PoseInput)}

    def warnings(self) -> Iterator[Problem]:
        """Yields a warning for each unpublished frame that is needed, and for each frame that is published twice.

        A frame is needed if a body or camera follows the frame, or if a configured pose has the frame as its parent.
        """
        main = self._world.loaded.file
        for index, each in enumerate(self._world.config.poses):
            key = f"poses[{index}]"
            owner = self._owner(each.tf_id)
            if owner is not None and each.tf_id in self._links_on_tf(owner):
                yield Problem(main, f"{key}.tf_id", f"'{owner.name}' publishes '{each.tf_id}' too")
            if (missing := self._missing(each.parent)) is not None:
                yield Problem(main, f"{key}.parent", missing)
        for slot, followed in self._followed.items():
            name = slot.split("/")[0]
            if (missing := self._missing(followed.tf_id)) is not None:
                key = "tracked_tf.tf_id" if followed.is_tracked else "object_tf.tf_id"
                yield Problem(file_of(self._world, name), key, f"'{name}' follows it: {missing}")

    def _owner(self, frame: str) -> Body | None:
        """Returns the body that a frame name `rpbi/BODY/...` refers to; None if this body cannot publish frames."""
        parts = frame.split("/")
        body = self._world.bodies.get(parts[1]) if len(parts) > 1 and parts[0] == "rpbi" else None
        can_publish = isinstance(body, JointedBody) or hasattr(getattr(body, "config", None), "broadcast_hz")
        return body if can_publish else None

    def _links_on_tf(self, body: Body) -> set[str]:
        """Returns a body's frames on TF, including frames that robot_state_publisher computes from joint states."""
        frames: set[str] = set()
        for sensor in self._world.sensors_of(body.name):
            if isinstance(sensor, LinkPoseSensor):
                frames.update(sensor.tf_frames)
                if sensor.tf_frames == (f"rpbi/{body.name}/{body.root_link}",):
                    frames.update(f"rpbi/{body.name}/{body.link_name(index)}" for index in body.link_indices)
        return frames

    def _missing(self, tf_id: str) -> str | None:
        """Returns a message if this world does not publish the frame `tf_id`; otherwise None."""
        frame = self._world.config.without_prefix(tf_id)
        missing = f"nothing here publishes the TF frame '{tf_id}'"
        if frame in self._published:
            return None
        body = self._owner(frame)
        if body is None:
            match = closest(frame, self._published - {WORLD_FRAME})
            question = f"; did you mean '{match}'?" if match else ""
            return f"{missing}{question}; say where it is under `poses`, or have another node publish it"
        frames = self._links_on_tf(body)
        if frame in frames:
            return None
        key = "broadcast_link_states: true" if isinstance(body, JointedBody) else "broadcast_hz"
        return missing + (hint(frame, frames) if frames else f"; '{body.name}' does with {key}")


def file_of(world: World, name: str) -> str:
    """Returns the name of the configuration file of a body or camera."""
    files = {item.config.name: item.file for item in world.loaded.objects}
    return {**files, **{camera.config.name: camera.file for camera in world.loaded.cameras}}[name]


def some(names: Sequence[str]) -> str:
    """Returns the first `MAX_NAMES` names as text, followed by the number of further names."""
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return ", ".join(names[:MAX_NAMES]) + more


def is_still(body: Body, link: int) -> bool:
    """Returns whether a link never moves.

    Links of a body without physics never move. In a body with physics, a link never moves if the base is fixed or has
    mass 0, and all joints between the base and the link are fixed.
    """
    if body.is_soft:
        return False
    if not body.has_physics:
        return True
    while link >= 0:
        info = body.pb.getJointInfo(body.body_id, link)
        if info[2] != pybullet.JOINT_FIXED:
            return False
        link = info[16]
    load = getattr(getattr(body, "config", None), "loadURDF", None)
    return bool(load is not None and load.useFixedBase) or body.dynamics_info(-1)[0] == 0.0
