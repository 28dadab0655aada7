"""Loads URDF files into PyBullet, and checks whether files can be loaded."""

import logging
import math
import tempfile
from collections.abc import Callable, Collection, Mapping
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import pybullet

from custom_ros_tools.errors import ConfigError, Problem, shortened
from robot_model.asset_files import ROBOT_DESCRIPTION
from robot_model.urdf.document import UrdfDocument
from robot_model.urdf.elements import Element, text_of
from robot_model.urdf.files import found_mesh
from robot_model.urdf.for_pybullet import (
    Files,
    files_of,
    for_pybullet,
    frame_masses,
    put_first_visuals_last,
    put_root_first,
    weigh_frames,
)
from robot_model.urdf.structure import MAX_PROBLEMS, check_structure, missing_parts, structure_problems
from rpbi.engine.client import MAXIMAL_COORDINATES, Client
from rpbi.meshes.checks import mesh_file_problem
from rpbi.meshes.trial import Mesh, Use, faults_in

log = logging.getLogger(__name__)

MAX_JOINTS = 127
"""Maximum number of joints, including fixed joints, that PyBullet reports for a robot.

Fixed joints of a robot with more joints are merged.
"""
MESH_FORMATS = (".obj", ".stl", ".dae", ".cdf")
OTHER_FORMATS = {"sdf": "SDF", "world": "SDF", "gazebo": "SDF", "mujoco": "MJCF"}
"""Names of robot formats that cannot be read, indexed by the tag of the file's root element."""
PLACEHOLDER_FACTOR = 10.0
"""Multiple of the maximum for a link's size above which moments of inertia count as placeholders."""


def urdf_problems(path: str) -> list[str]:
    """Checks a URDF file for faults that would make PyBullet refuse the file or crash.

    Checks the structure, then the number of joints, then the files that the URDF names. Stops after the first check
    that finds faults. Meshes that were never loaded on this machine are loaded in another process as a trial.

    Returns:
        A sentence for each fault; empty if no fault was found.
    """
    if path == ROBOT_DESCRIPTION:
        return [f"there is no parameter '{ROBOT_DESCRIPTION}'"]
    try:
        document = UrdfDocument(path)
    except ConfigError as error:
        return [str(error).replace(": is not XML", " is not XML")]
    if document.tag in OTHER_FORMATS:
        return [f"{path} is {OTHER_FORMATS[document.tag]}, not URDF; see docs/robots.md for a conversion to URDF"]
    if document.tag != "robot":
        return [f"{path}: expected <robot> at the top, got <{shortened(document.tag)}>"]
    if not document.links and not document.is_soft:
        return [f"{path}: the robot has no <link>"]
    if problems := structure_problems(document):
        return [f"{path}: {problem}" for problem in problems]
    try:
        check_joints(path, document.root)
    except ConfigError as error:
        return [str(error)]
    faults = list(islice(missing_parts(document), MAX_PROBLEMS)) or _mesh_problems(document)
    return [f"{path}: {fault}" for fault in faults]


def check_joints(file: str, robot: Element) -> None:
    """Checks that PyBullet can load all joints of a robot, if necessary after merging fixed joints.

    Raises:
        ConfigError: If more than `MAX_JOINTS` joints are not fixed.
    """
    moving = sum(joint.get("type") != "fixed" for joint in robot.findall("joint"))
    if moving > MAX_JOINTS:
        message = f"expected at most {MAX_JOINTS} joints that are not fixed, got {moving}"
        raise ConfigError([Problem(file, "", message)])


def _mesh_problems(document: UrdfDocument) -> list[str]:
    """Returns a sentence for each mesh that PyBullet would not find or not load, or that would crash PyBullet."""
    problems: dict[str, None] = {}
    meshes: dict[Mesh, str] = {}
    for part, use in (("visual", Use.URDF_VISUAL), ("collision", Use.URDF_COLLISION)):
        for name in document.meshes_of(part):
            if Path(name).suffix.lower() not in MESH_FORMATS:
                problems[f"mesh '{shortened(name)}' is none of {', '.join(MESH_FORMATS)}"] = None
                continue
            try:
                file = str(found_mesh(name, document.source))
                if fault := mesh_file_problem(file):
                    problems[f"mesh '{shortened(name)}': {fault}"] = None
                elif not file.lower().endswith(".cdf"):
                    meshes[Mesh(use, file)] = name
            except ConfigError as error:
                problems |= {f"mesh '{shortened(name)}': {each.message}": None for each in error.problems}
            except OSError as error:
                problems[str(error.strerror or error)] = None
    for mesh, fault in faults_in(meshes).items():
        problems[f"mesh '{shortened(meshes[mesh])}': {fault}"] = None
    return list(problems)


class PreparedUrdf(NamedTuple):
    """Text that PyBullet loads instead of a URDF file.

    Attributes:
        text: URDF with only the parts that PyBullet reads. Text that PyBullet's parser would misread is avoided: the
            parser stops at null characters, cuts long lines and ignores errors.
        joints: Number of joints in the text, including fixed joints.
        without_inertial: Names of the links that do not have an `<inertial>` element.
    """

    text: str
    joints: int
    without_inertial: frozenset[str]


Prepare = Callable[[UrdfDocument, Files], Element]
"""A function that converts the XML elements of a URDF to a form that PyBullet can load, depending on nothing else."""


def prepared_urdf(
    arguments: Mapping[str, Any], prepare: Prepare = for_pybullet, has_window: bool = False
) -> PreparedUrdf:
    """Returns the text that PyBullet loads instead of a URDF file.

    The result is cached, so another thread can prepare a large file before the thread of the simulation loads it.

    Args:
        arguments: Arguments of PyBullet's `loadURDF`.
        prepare: Function that converts the XML elements of the URDF to a form that PyBullet can load.
        has_window: Whether PyBullet has a window, in which the robot will be drawn.

    Raises:
        ConfigError: If the file cannot be read, its structure is wrong, or it has too many joints.
    """
    document = UrdfDocument(arguments["fileName"])
    check_structure(document)
    return _prepared(document, files_of(document), prepare, bool(arguments.get("useFixedBase")), has_window)


@lru_cache(maxsize=32)
def _prepared(document: UrdfDocument, files: Files, prepare: Prepare, is_fixed: bool, has_window: bool) -> PreparedUrdf:
    robot = prepare(document, files)
    weigh_frames(robot, frame_masses(document, is_fixed))
    check_joints(document.path, robot)
    put_root_first(robot)
    if has_window:
        put_first_visuals_last(robot)
    without = {link.get("name", "") for link in robot.findall("link") if link.find("inertial") is None}
    return PreparedUrdf(text_of(robot), len(robot.findall("joint")), frozenset(without))


def load_urdf(
    pb: Client,
    name: str,
    arguments: Mapping[str, Any],
    prepare: Prepare = for_pybullet,
    inertia_from_urdf: bool = False,
) -> int:
    """Loads a URDF file into PyBullet, and returns PyBullet's id of the body.

    The file must have been checked with `urdf_problems`.

    Args:
        pb: Client into which the file is loaded.
        name: Name of the body, for messages.
        arguments: Arguments of PyBullet's `loadURDF`.
        prepare: Function that converts the XML elements of the URDF to a form that PyBullet can load.
        inertia_from_urdf: True: uses the URDF's moments of inertia. False: PyBullet guesses the moments from the
            shapes, unless `flags` in `arguments` contains URDF_USE_INERTIA_FROM_FILE.

    Raises:
        ConfigError: If the file cannot be loaded; the message names the problem.
    """
    file: str = arguments["fileName"]
    try:
        robot = prepared_urdf(arguments, prepare, pb.has_window)
        asked = arguments.get("flags") or 0
        flags = flags_for(robot.joints, asked)
        if flags != asked:
            message = "%d joints are more than the %d of PyBullet: fixed ones are left out, with their links"
            log.warning(f"%s: {message}", name, robot.joints, MAX_JOINTS)
        if inertia_from_urdf:
            flags |= pybullet.URDF_USE_INERTIA_FROM_FILE
        with tempfile.NamedTemporaryFile("w", suffix=".urdf", encoding="utf-8") as written:
            written.write(robot.text)
            written.flush()
            body_id = int(pb.loadURDF(**{**arguments, "fileName": written.name, "flags": flags}))
        if not inertia_from_urdf:
            return body_id
        _complete_inertias(pb, name, body_id, robot.without_inertial, arguments.get("globalScaling") or 1.0)
        return body_id
    except ConfigError as error:
        messages = [f"{problem.key or file}: {problem.message}" for problem in error.problems]
    except (pybullet.error, OSError) as error:
        messages = [f"PyBullet could not load it: {error}"]
    raise ConfigError([Problem(name, "loadURDF.fileName", message) for message in messages])


def flags_for(joints: int, flags: int) -> int:
    """Returns flags for `loadURDF`; adds `URDF_MERGE_FIXED_LINKS` if a robot has more than MAX_JOINTS joints.

    PyBullet can load more joints, but does not report the poses of the further joints' links.

    Args:
        joints: Number of joints in the URDF.
        flags: Other flags for `loadURDF`.
    """
    return flags | (pybullet.URDF_MERGE_FIXED_LINKS if joints > MAX_JOINTS else 0)


def _complete_inertias(pb: Client, name: str, body_id: int, without: Collection[str], scaling: float) -> None:
    """Completes the moments of inertia of a body that was loaded with the URDF's moments of inertia.

    Lets PyBullet guess missing or impossible moments. If the body is scaled, scales the remaining moments. Logs a
    warning for moments that are impossible or far too large.

    Args:
        pb: Client of the body.
        name: Name of the body, for messages.
        body_id: PyBullet's id of the body.
        without: Names of the links that do not have an `<inertial>` element.
        scaling: Scale of the body, `globalScaling` of PyBullet's `loadURDF`.
    """
    links = {index: pb.getJointInfo(body_id, index)[12] for index in range(pb.getNumJoints(body_id))}
    unusable, too_large = [], []
    for index, link in {-1: pb.getBodyInfo(body_id)[0], **links}.items():
        link = link.decode()
        mass, _, moments = pb.getDynamicsInfo(body_id, index)[:3]
        if not mass:
            continue
        if link in without or 0.0 in moments:  # PyBullet sets impossible moments to 0
            pb.changeDynamics(body_id, index, mass=mass)  # lets PyBullet guess them from the collision shape
            unusable += [] if link in without else [link]
            continue
        if scaling != 1.0:
            moments = [moment * scaling**2 for moment in moments]
            pb.changeDynamics(body_id, index, localInertiaDiagonal=moments)
        if max(moments) > PLACEHOLDER_FACTOR * mass * _largest_radius(pb, body_id, index) ** 2:
            too_large.append(link)
    if unusable:
        log.warning("%s: moments of inertia of %s are impossible: guessed from the shape", name, ", ".join(unusable))
    if too_large:
        message = "%s: moments of inertia of %s are far too large for their size; inertia_from_urdf: false guesses them"
        log.warning(message, name, ", ".join(too_large))


def _largest_radius(pb: Client, body_id: int, link: int) -> float:
    """Returns an upper bound [m] of the distance from a link's centre of mass to points of its collision shape.

    The bound is inf for a link without a collision shape, and for a body in maximal coordinates, whose shapes PyBullet
    does not report.
    """
    if pb.getDynamicsInfo(body_id, link)[10] == MAXIMAL_COORDINATES or not pb.getCollisionShapeData(body_id, link):
        return math.inf
    lower, upper = pb.getAABB(body_id, link)
    centre = pb.getBasePositionAndOrientation(body_id)[0] if link < 0 else pb.getLinkState(body_id, link)[0]
    return math.hypot(*(max(high - at, at - low) for low, high, at in zip(lower, upper, centre)))
