"""Warnings about probable mistakes in a valid world, such as implausible values in YAML files and URDFs."""

import math
from collections.abc import Iterator, Sequence

import pybullet

from custom_ros_tools.errors import Problem
from robot_model.urdf.document import Edge, UrdfDocument
from robot_model.urdf.for_pybullet import weighed_by_pybullet
from robot_model.urdf.structure import numbers_in
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.bodies.robots.robot_config import RobotConfig
from rpbi.meshes.triangles import volumes
from rpbi.urdf.joints import Joint

from .objects import ObjectConfig
from .place_warnings import file_of, is_still, place_warnings, some
from .world import World

CONCAVE_SHARE = 0.05
"""Largest increase of a mesh's volume by its convex hull without a warning, relative to the mesh's volume."""
HALF_TURN, FULL_TURN = 3.2, 6.4
"""Angles [rad] slightly above a half turn and a full turn, to allow for rounded values."""
ROUND = 0.01
"""Largest distance of an angle from a multiple of 15 degrees [15 degrees] at which the angle counts as round."""
FRACTIONS = 3
"""Smallest number of non-integer angles at which a robot's angles, if all up to a half turn, are taken for radians."""
LARGEST_LIMIT, LARGEST_DEG = 12.6, 360.0
"""Largest plausible limit [rad] of a revolute joint, and largest limit that may be degrees; larger means no limit."""
ARM_JOINTS = 4
"""Smallest number of joints in a chain at which a robot with a single joint on its base counts as an arm."""


def world_warnings(world: World) -> list[Problem]:
    """Returns all warnings about a world that has not been stepped yet."""
    return [*place_warnings(world), *value_warnings(world)]


def value_warnings(world: World) -> Iterator[Problem]:
    """Yields a warning for each value in YAML files and URDFs that is probably a mistake."""
    yield from _gravity(world)
    yield from _masses(world)
    yield from _hulls(world)
    yield from _limits(world)
    yield from _topics(world)
    yield from _views(world)
    for item in world.loaded.objects:
        load = getattr(item.config, "loadURDF", None)
        if load is not None and not world.bodies[item.config.name].is_soft:
            yield from _urdf_angles(world, item, UrdfDocument(load.fileName))
        if isinstance(item.config, RobotConfig):
            yield from _start_angles(world, item, item.config)
        if isinstance(item.config, RobotConfig) and not item.config.is_visual_robot:
            yield from _efforts(world, item, item.config)
            yield from _loose_arm(world, item, item.config)


def _gravity(world: World) -> Iterator[Problem]:
    if world.pb.gravity[2] > 0.0:
        message = f"{world.pb.gravity[2]:g} m/s^2 points upwards, so that bodies rise; on Earth it is -9.81"
        yield Problem(world.loaded.file, "setGravity.gravZ", message)
    if any(world.pb.gravity) or "setGravity" in world.config.model_fields_set:
        return
    free = [name for name, body in world.bodies.items() if not is_still(body, -1)]
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
            message = f"without <inertial>, PyBullet gives 1 kg to each of these links: {some(links)}"
            yield Problem(item.file, "loadURDF.fileName", message)
        if joints := _moving_no_mass(UrdfDocument(load.fileName)):
            message = f"all links that these joints move have mass 0: {some(joints)}"
            yield Problem(item.file, "loadURDF.fileName", message)


def _moving_no_mass(document: UrdfDocument) -> list[str]:
    """Returns the names of all joints that are not fixed and below which all links have mass 0."""
    below = _joints_below(document)

    def is_massless(link: str) -> bool:
        return link in document.massless and all(is_massless(edge.child) for edge in below.get(link, ()))

    moving = [edge for edge in document.edges if document.joint_types[edge.joint] != "fixed"]
    return [f"'{edge.joint}'" for edge in moving if is_massless(edge.child)]


def _joints_below(document: UrdfDocument) -> dict[str, list[Edge]]:
    """Returns the child joints of each link, indexed by the link's name. Links without child joints are left out."""
    below: dict[str, list[Edge]] = {}
    for edge in document.edges:
        below.setdefault(edge.parent, []).append(edge)
    return below


def _hulls(world: World) -> Iterator[Problem]:
    for item in world.loaded.objects:
        shape = getattr(item.config, "createCollisionShape", None)
        if shape is None or shape.shapeType != pybullet.GEOM_MESH or shape.fileName is None:
            continue
        is_exact = bool((shape.flags or 0) & pybullet.GEOM_FORCE_CONCAVE_TRIMESH)
        if is_exact or getattr(item.config, "convexDecomposition", None) or not (volumes_m3 := volumes(shape.fileName)):
            continue
        mesh_m3, hull_m3 = (abs(math.prod(shape.meshScale or (1.0,))) * volume for volume in volumes_m3)
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
                yield Problem(file_of(world, name), key, message)


def _topics(world: World) -> Iterator[Problem]:
    for item in world.loaded.objects:
        topic = item.config.initial_joint_state_topic if isinstance(item.config, RobotConfig) else None
        if topic:
            message = f"the world only starts if joint states come on {topic}"
            yield Problem(item.file, "initial_joint_state_topic", message)


def _efforts(world: World, item: ObjectConfig, config: RobotConfig) -> Iterator[Problem]:
    """Yields a warning for motors with effort 0 in the URDF: 0 means no limit, which few authors intend."""
    document = UrdfDocument(config.loadURDF.fileName)
    joints = Joint.all_of(world.pb, world.bodies[config.name].body_id)
    free = {joint.name for joint in joints if joint.is_driven and joint.max_effort == math.inf}
    free -= document.mimics.keys() | config.coupled_joints.keys()
    zero = [
        f"'{joint.get('name')}'"
        for joint in document.joint_elements
        if joint.get("name") in free and (limit := joint.find("limit")) is not None and "effort" in limit.attrib
    ]
    if zero and config.enforce_effort_limits:
        message = f"effort 0 in the URDF, for {some(zero)}, means no limit: these motors have any force"
        meant = "enforce_effort_limits: false states that this is intended"
        yield Problem(item.file, "loadURDF.fileName", f"{message}; {meant}")


def _loose_arm(world: World, item: ObjectConfig, config: RobotConfig) -> Iterator[Problem]:
    """Yields a warning for an arm (see `_is_arm`) that is not fixed to the world or to another body."""
    held = {each.child.partition("/")[0] for each in world.config.attachments}
    is_loose = not is_still(world.bodies[config.name], -1) and config.planar_base is None and config.name not in held
    if is_loose and any(world.pb.gravity) and _is_arm(UrdfDocument(config.loadURDF.fileName)):
        message = "missing, so this arm is not fixed and will fall over; write true, or false if that is intended"
        if "useFixedBase" not in config.loadURDF.model_fields_set:
            yield Problem(item.file, "loadURDF.useFixedBase", message)


def _is_arm(document: UrdfDocument) -> bool:
    """Returns whether a robot is an arm.

    An arm has a single moving joint on its base. This joint is not prismatic, and is the first in a chain of at least
    ARM_JOINTS moving joints.
    """
    below = _joints_below(document)
    base, first = [document.root_link()], []
    for link in base:
        for edge in below.get(link, ()):
            if document.joint_types[edge.joint] == "fixed":
                base.append(edge.child)
            else:
                first.append(edge)
    if len(first) != 1 or document.joint_types[first[0].joint] == "prismatic":
        return False
    longest = 1
    chain = [(first[0].child, 1)]
    for link, count in chain:
        longest = max(longest, count)
        chain += [(edge.child, count + (document.joint_types[edge.joint] != "fixed")) for edge in below.get(link, ())]
    return longest >= ARM_JOINTS


def _start_angles(world: World, item: ObjectConfig, config: RobotConfig) -> Iterator[Problem]:
    joints = Joint.all_of(world.pb, world.bodies[config.name].body_id)
    given = [config.initial_joint_position.get(joint.name, 0.0) for joint in joints if joint.is_revolute]
    key = "initial_joint_position"
    if config.initial_revolute_joint_positions_are_deg:
        if _are_radians(given):
            message = "these degrees look like radians, for which initial_revolute_joint_positions_are_deg is false"
            yield Problem(item.file, key, message)
    elif any(abs(angle) > FULL_TURN for angle in given):
        message = "these radians look like degrees, for which initial_revolute_joint_positions_are_deg is true"
        yield Problem(item.file, key, message)


def _are_radians(angles: Sequence[float]) -> bool:
    """Returns whether angles that should be degrees look like radians.

    Two conditions must be met if the angles are taken as radians. All angles are within a half turn. In addition, an
    angle of at least 30 degrees is a multiple of 15 degrees, or FRACTIONS or more angles are not integers.
    """
    if max(map(abs, angles), default=0.0) > HALF_TURN:
        return False
    steps = [abs(angle) / math.radians(15.0) for angle in angles]
    is_round = any(step > 1.5 and abs(step - round(step)) < ROUND for step in steps)
    return is_round or sum(angle != round(angle) for angle in angles) >= FRACTIONS


def _urdf_angles(world: World, item: ObjectConfig, document: UrdfDocument) -> Iterator[Problem]:
    """Yields warnings for the first `rpy` angles and the first joint limits in a URDF that look like degrees."""
    key, expected = "loadURDF.fileName", "looks like degrees: expected [rad]"
    for owner, tag, name, text, _ in document.attributes():
        if (tag, name) == ("origin", "rpy") and any(FULL_TURN < abs(n) <= LARGEST_DEG for n in numbers_in(text)):
            yield Problem(item.file, key, f"{owner}: origin.rpy: '{text}' {expected}")
            break
    for joint in Joint.all_of(world.pb, world.bodies[item.config.name].body_id):
        if joint.is_revolute and LARGEST_LIMIT < max(-joint.lower, joint.upper) <= LARGEST_DEG:
            limits = f"{joint.lower:g} to {joint.upper:g}"
            yield Problem(item.file, key, f"joint '{joint.name}': its limit of {limits} {expected}")
            break


def _views(world: World) -> Iterator[Problem]:
    """Yields a warning for each `rpy` under `poses` that looks like degrees, and each `fov` that looks like radians."""
    main = world.loaded.file
    for index, pose in enumerate(world.config.poses):
        if pose.rpy is not None and max(map(abs, pose.rpy)) > FULL_TURN:
            yield Problem(main, f"poses[{index}].rpy", f"{list(pose.rpy)} looks like degrees: expected [rad]")
    for camera in world.loaded.cameras:
        if camera.config.intrinsics.fov < HALF_TURN:
            message = f"{camera.config.intrinsics.fov:g} looks like radians: expected [deg]"
            yield Problem(
                camera.file, "rgbd_sensor.intrinsics.fov" if camera.file == main else "intrinsics.fov", message
            )
