"""Warnings of probable mistakes in a world that can be built."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import pybullet

from custom_ros_tools.errors import Problem, closest, hint
from robot_model.geometry import dot, minus, scaled
from robot_model.urdf.document import UrdfDocument
from rpbi.bodies import Body
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.bodies.robots.robot_config import RobotConfig
from rpbi.bodies.shape_object import ShapeObject
from rpbi.config.world import WORLD_FRAME
from rpbi.engine.client import MAXIMAL_COORDINATES
from rpbi.engine.inputs import PoseInput
from rpbi.meshes.triangles import volumes
from rpbi.sensors.link_pose import LinkPoseSensor
from rpbi.urdf.copies import weighed_by_pybullet
from rpbi.urdf.joints import Joint
from rpbi.world import World

CONCAVE_SHARE = 0.05
"""Share of a mesh's volume that its convex hull may add without a warning."""
TOUCHING_M = 1e-3
"""Bodies that overlap by less only touch: PyBullet has margins around meshes."""

MAX_FALL_M = 100.0
"""Height above a plane from which a body is expected to fall onto it."""
MAX_NAMES = 3
"""Bodies or links that a warning names; it counts the others."""
PLANE_ADVICE = (
    "planes lose contact points of what slides on them, and forces chatter; use a box, such as {shapeType: GEOM_BOX, "
    "halfExtents: [50, 50, 0.5], collisionFramePosition: [0, 0, -0.5]}"
)


def world_warnings(world: World) -> list[Problem]:
    """Returns probable mistakes in a world that has made no step yet, by file."""
    return [
        *_Frames(world).warnings(),
        *_gravity(world),
        *_masses(world),
        *_hulls(world),
        *_limits(world),
        *_topics(world),
        *_overlaps(world),
        *_planes(world),
    ]


def _file_of(world: World, name: str) -> str:
    """Returns the file of a body or camera."""
    files = {item.config.name: item.file for item in world.loaded.objects}
    return {**files, **{camera.config.name: camera.file for camera in world.loaded.cameras}}[name]


def _gravity(world: World) -> Iterator[Problem]:
    if any(world.pb.gravity) or "setGravity" in world.config.model_fields_set:
        return
    free = [name for name, body in world.bodies.items() if not _is_still(body, -1)]
    if free:
        message = f"missing, so there is no gravity, and {', '.join(free)} will not fall; write {{gravZ: -9.81}}, or 0"
        yield Problem(world.loaded.file, "setGravity", message)


def _masses(world: World) -> Iterator[Problem]:
    for item in world.loaded.objects:
        load, body = getattr(item.config, "loadURDF", None), world.bodies[item.config.name]
        if load is None or body.is_soft or not body.has_physics:
            continue
        is_fixed = bool(load.useFixedBase) or getattr(item.config, "planar_base", None) is not None
        if links := weighed_by_pybullet(UrdfDocument(load.fileName), is_fixed):
            message = f"without <inertial>, PyBullet gives 1 kg to each of these links: {_some(links)}"
            yield Problem(item.file, "loadURDF.fileName", message)


def _hulls(world: World) -> Iterator[Problem]:
    for item in world.loaded.objects:
        shape = getattr(item.config, "createCollisionShape", None)
        if shape is None or shape.shapeType != pybullet.GEOM_MESH or shape.fileName is None:
            continue
        is_exact = bool((shape.flags or 0) & pybullet.GEOM_FORCE_CONCAVE_TRIMESH)
        if is_exact or getattr(item.config, "convexDecomposition", None) or not (found := volumes(shape.fileName)):
            continue
        mesh_m3, hull_m3 = (abs(math.prod(shape.meshScale or (1.0,))) * volume for volume in found)
        if hull_m3 - mesh_m3 > CONCAVE_SHARE * mesh_m3:
            added = f"which adds {hull_m3 - mesh_m3:.2g} m^3 to its {mesh_m3:.2g} m^3"
            message = f"the concave mesh collides as its convex hull, {added}; see convexDecomposition"
            yield Problem(item.file, "createCollisionShape.fileName", message)


def _limits(world: World) -> Iterator[Problem]:
    for name, body in world.bodies.items():
        if body.is_soft:
            continue
        joints = [joint for joint in Joint.all_of(body.pb, body.body_id) if joint.is_driven]
        states = body.pb.getJointStates(body.body_id, [joint.index for joint in joints]) if joints else ()
        for joint, (position, *_) in zip(joints, states):
            if not joint.allows(position):
                key = f"initial_joint_position.{joint.name}" if isinstance(body, JointedBody) else "loadURDF.fileName"
                message = f"at the start, {joint.limit_violation(position)}"
                yield Problem(_file_of(world, name), key, message)


def _topics(world: World) -> Iterator[Problem]:
    for item in world.loaded.objects:
        topic = item.config.initial_joint_state_topic if isinstance(item.config, RobotConfig) else None
        if topic:
            message = f"the world only starts if joint states come on {topic}"
            yield Problem(item.file, "initial_joint_state_topic", message)


def _overlaps(world: World) -> Iterator[Problem]:
    """Yields a warning for each pair of bodies that are in each other, unless nothing can push them apart."""
    for one, other in _neighbours([body for body in world.bodies.values() if _has_place(world, body)]):
        found = world.pb.getClosestPoints(one.body_id, other.body_id, 0.0)
        depths = {(point[3], point[4]): -point[8] for point in sorted(found, key=lambda point: -point[8])}
        depths = {links: depth for links, depth in depths.items() if not _are_still(one, other, *links)}
        if depths and (deepest := max(depths.items(), key=lambda item: item[1]))[1] > TOUCHING_M:
            (link, other_link), depth = deepest
            parts = f"{_named(one, link)} and {_named(other, other_link)} overlap by {depth:.2g} m"
            yield Problem(_file_of(world, one.name), "", f"at the start, {parts}, and will be pushed apart")


def _neighbours(bodies: Sequence[Body]) -> Iterator[tuple[Body, Body]]:
    """Yields the pairs of bodies whose bounding boxes meet."""
    links = [[body.pb.getAABB(body.body_id, index) for index in (-1, *body.joint_indices)] for body in bodies]
    lower = np.array([np.min([box[0] for box in boxes], axis=0) for boxes in links]).reshape(-1, 3)
    upper = np.array([np.max([box[1] for box in boxes], axis=0) for boxes in links]).reshape(-1, 3)
    meet = np.all(lower[:, None] <= upper[None], axis=2)
    for one, other in np.argwhere(np.triu(meet & meet.T, 1)):
        yield bodies[one], bodies[other]


def _planes(world: World) -> Iterator[Problem]:
    """Yields a warning for each plane on which bodies rest at the start, or onto which they fall."""
    placed = [body for body in world.bodies.values() if _has_place(world, body)]
    for plane in placed:
        if _shape_kinds(plane) != {pybullet.GEOM_PLANE}:
            continue
        names = [f"'{body.name}'" for body in placed if _needs_points(body) and _is_below(world, plane, body)]
        if names:
            rest = f"{_some(names)} rest{'s' if len(names) == 1 else ''} on this plane"
            key = "createCollisionShape.shapeType" if isinstance(plane, ShapeObject) else "loadURDF.fileName"
            yield Problem(_file_of(world, plane.name), key, f"{rest}: {PLANE_ADVICE}")


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return ", ".join(names[:MAX_NAMES]) + more


def _shape_kinds(body: Body) -> set[int]:
    """Returns PyBullet's kinds of all collision shapes of a body; in maximal coordinates PyBullet reports none."""
    if body.dynamics_info(-1)[10] == MAXIMAL_COORDINATES:
        return set()
    links = (-1, *body.link_indices)
    return {shape[2] for link in links for shape in body.pb.getCollisionShapeData(body.body_id, link)}


def _needs_points(body: Body) -> bool:
    """Returns whether a body can fall and slide and stands on more than one contact point, as all but a ball do."""
    return not _is_still(body, -1) and _shape_kinds(body) != {pybullet.GEOM_SPHERE}


def _is_below(world: World, plane: Body, body: Body) -> bool:
    """Returns whether a plane carries a body against gravity, now or once it has fallen."""
    found = world.pb.getClosestPoints(body.body_id, plane.body_id, MAX_FALL_M)
    if not found:
        return False
    nearest = min(found, key=lambda point: point[8])
    lowest, below, normal, gap = nearest[5:9]
    if dot(normal, world.pb.gravity) >= 0.0:
        return False
    if gap <= TOUCHING_M:
        return True
    ((hit, *_),) = world.pb.rayTest(lowest, minus(below, scaled(TOUCHING_M, normal)))
    return bool(hit == plane.body_id)


def _has_place(world: World, body: Body) -> bool:
    """Returns whether a body has collisions and is at its place, which another node's frame will not change."""
    is_placed = body.object_tf is None or world.config.pose_of(body.object_tf.tf_id) is not None
    return body.has_physics and not body.is_soft and is_placed


def _named(body: Body, link: int) -> str:
    return f"'{body.name}'" if not body.joint_indices else f"'{body.name}/{body.link_name(link)}'"


def _are_still(one: Body, other: Body, link: int, other_link: int) -> bool:
    return _is_still(one, link) and _is_still(other, other_link)


def _is_still(body: Body, link: int) -> bool:
    """Returns whether a link is static: a fixed base, and all links fixed to it."""
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


class _Frames:
    """The TF frames that a world publishes, and those that it follows."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._published = world.frames()
        self._followed = {slot: each for slot, each in world.inputs.items() if isinstance(each, PoseInput)}

    def warnings(self) -> Iterator[Problem]:
        """Yields a warning for each frame that somebody needs and nobody publishes, or two do."""
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
                yield Problem(_file_of(self._world, name), key, f"'{name}' follows it: {missing}")

    def _owner(self, frame: str) -> Body | None:
        """Returns the body whose frame it is by its name, if that can publish any."""
        parts = frame.split("/")
        body = self._world.bodies.get(parts[1]) if len(parts) > 1 and parts[0] == "rpbi" else None
        can_publish = isinstance(body, JointedBody) or hasattr(getattr(body, "config", None), "broadcast_hz")
        return body if can_publish else None

    def _links_on_tf(self, body: Body) -> set[str]:
        """Returns the frames of a body, also those that robot_state_publisher makes of its joint states."""
        frames: set[str] = set()
        for sensor in self._world.sensors_of(body.name):
            if isinstance(sensor, LinkPoseSensor):
                frames.update(sensor.tf_frames)
                if sensor.tf_frames == (f"rpbi/{body.name}/{body.root_link}",):
                    frames.update(f"rpbi/{body.name}/{body.link_name(index)}" for index in body.link_indices)
        return frames

    def _missing(self, tf_id: str) -> str | None:
        """Returns what is wrong with a frame that is needed, None if it is published."""
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
