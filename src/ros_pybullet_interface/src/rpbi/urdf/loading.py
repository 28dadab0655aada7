"""Loading a URDF into PyBullet, and what is wrong with one that cannot be loaded."""

import logging
import math
from collections.abc import Callable, Collection, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import pybullet

from custom_ros_tools.errors import ConfigError, Problem, shortened
from rpbi.config.asset_files import ROBOT_DESCRIPTION
from rpbi.engine.client import MAXIMAL_COORDINATES, Client
from rpbi.meshes.checks import mesh_file_problem
from rpbi.meshes.trial import Mesh, Use, faults_in

from .copies import for_window
from .document import UrdfDocument
from .files import PACKAGE, beside_or_above, mesh_file, resolve_meshes, write_description
from .structure import structure_problems, texts_for_numbers

log = logging.getLogger(__name__)

MOST_JOINTS = 127
"""Joints of a robot that PyBullet can tell of, fixed ones too."""
MESH_FORMATS = (".obj", ".stl", ".dae", ".cdf")
MOST_PROBLEMS = 20
"""So many faults of one file are told."""
OTHER_FORMATS = {"sdf": "SDF", "world": "SDF", "gazebo": "SDF", "mujoco": "MJCF"}
"""Formats of robots that are not read, by the element at the top of their files."""
PLACEHOLDER_FACTOR = 10.0
"""Moments of inertia this many times what a link's size allows are taken for placeholders."""


def urdf_problems(path: str) -> list[str]:
    """Returns a sentence for each reason not to have PyBullet load a URDF file: it would refuse it, or not survive it.

    Its meshes are tried elsewhere, if this machine has not loaded them before.
    """
    if path == ROBOT_DESCRIPTION:
        return [f"there is no parameter '{ROBOT_DESCRIPTION}'"]
    try:
        document = UrdfDocument(path)
    except ConfigError as error:
        return [str(error).replace(": is not XML", " is not XML")]
    if document.tag in OTHER_FORMATS:
        return [f"{path} is {OTHER_FORMATS[document.tag]}, not URDF; docs/robots.md says how to make a URDF of it"]
    if document.tag != "robot":
        return [f"{path}: expected <robot> at the top, got <{shortened(document.tag)}>"]
    if not document.links and not document.is_soft:
        return [f"{path}: the robot has no <link>"]
    problems = list(islice(structure_problems(document), MOST_PROBLEMS)) or _mesh_problems(document)
    return [f"{path}: {problem}" for problem in problems]


def _mesh_problems(document: UrdfDocument) -> list[str]:
    """Returns a sentence for each mesh that PyBullet would not find, would leave out or would not survive."""
    problems: dict[str, None] = {}
    meshes: dict[Mesh, str] = {}
    for part, use in (("visual", Use.URDF_VISUAL), ("collision", Use.URDF_COLLISION)):
        for name in document.meshes_of(part):
            if Path(name).suffix.lower() not in MESH_FORMATS:
                problems[f"mesh '{shortened(name)}' is none of {', '.join(MESH_FORMATS)}"] = None
                continue
            try:
                file = str(_mesh_path(name, document.path))
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


def _mesh_path(name: str, path: str) -> Path:
    """Returns the file of a mesh, where PyBullet finds it once names of packages are resolved.

    Raises:
        ConfigError: If it is of an unknown package.
        OSError: If there is none.
    """
    source = Path(path)
    if name.startswith(PACKAGE):
        return mesh_file(name, source)
    found = beside_or_above(name.removeprefix("model://"), source)
    if found is None:
        looked = "looked for beside it and in all folders above"
        raise FileNotFoundError(f"no such mesh: {shortened(name)} ({looked})")
    return found


def load_urdf(
    pb: Client,
    name: str,
    arguments: Mapping[str, Any],
    prepare: Callable[[str], str] = resolve_meshes,
    inertia_from_urdf: bool = False,
) -> int:
    """Loads a URDF file in which `urdf_problems` finds nothing, and returns PyBullet's id of the body.

    Args:
        name: Name of the body, for messages.
        arguments: Those of `loadURDF`.
        prepare: Returns a file that PyBullet can load in place of `fileName`.
        inertia_from_urdf: Whether moments of inertia are the URDF's, else PyBullet guesses them unless `flags` say.

    Raises:
        ConfigError: If it cannot be loaded; it names what is wrong with the file.
    """
    file: str = arguments["fileName"]
    try:
        prepared = prepare(file)
        document = UrdfDocument(prepared)
        if texts := texts_for_numbers(document):
            log.warning("%s: expected numbers, PyBullet takes these for 0: %s", name, ", ".join(texts[:3]))
        if pb.has_window and (text := for_window(document)) is not None:
            prepared = write_description(text)
        flags = arguments.get("flags") or 0
        flags = flags_for(document, flags)
        _warn_of_merging(name, document, flags & ~(arguments.get("flags") or 0))
        if inertia_from_urdf:
            flags |= pybullet.URDF_USE_INERTIA_FROM_FILE
        body_id = int(pb.loadURDF(**{**arguments, "fileName": prepared, "flags": flags}))
        if not inertia_from_urdf:
            return body_id
        _complete_inertias(pb, name, body_id, document.links_without_inertial, arguments.get("globalScaling") or 1.0)
        return body_id
    except ConfigError as error:
        messages = [f"{problem.key or file}: {problem.message}" for problem in error.problems]
    except (pybullet.error, OSError, UnicodeDecodeError) as error:
        messages = [f"PyBullet could not load it: {error}"]
    raise ConfigError([Problem(name, "loadURDF.fileName", message) for message in messages])


def flags_for(document: UrdfDocument, flags: int) -> int:
    """Returns the flags by which PyBullet takes a URDF: of one with too many joints it merges the fixed ones.

    PyBullet loads more than 127, but then tells neither of joints nor of links where they are.
    """
    return flags | (pybullet.URDF_MERGE_FIXED_LINKS if len(document.joint_types) > MOST_JOINTS else 0)


def _warn_of_merging(name: str, document: UrdfDocument, added_flags: int) -> None:
    if added_flags & pybullet.URDF_MERGE_FIXED_LINKS:
        message = "%s: %d joints are more than the %d that PyBullet takes: fixed ones are left out, with their links"
        log.warning(message, name, len(document.joint_types), MOST_JOINTS)


def _complete_inertias(pb: Client, name: str, body_id: int, without: Collection[str], scaling: float) -> None:
    """Gives links without moments of inertia in the URDF some, and those of a scaled body its own."""
    links = {index: pb.getJointInfo(body_id, index)[12] for index in range(pb.getNumJoints(body_id))}
    unusable, too_large = [], []
    for index, link in {-1: pb.getBodyInfo(body_id)[0], **links}.items():
        link = link.decode()
        mass, _, moments = pb.getDynamicsInfo(body_id, index)[:3]
        if not mass:
            continue
        if link in without or 0.0 in moments:  # PyBullet makes 0 of what no body can have
            pb.changeDynamics(body_id, index, mass=mass)  # with its guess, from the collision shape
            unusable += [] if link in without else [link]
            continue
        if scaling != 1.0:
            moments = [moment * scaling**2 for moment in moments]
            pb.changeDynamics(body_id, index, localInertiaDiagonal=moments)
        if max(moments) > PLACEHOLDER_FACTOR * mass * _largest_radius(pb, body_id, index) ** 2:
            too_large.append(link)
    if unusable:
        log.warning("%s: no body has the moments of inertia of %s: guessed from the shape", name, ", ".join(unusable))
    if too_large:
        message = "%s: moments of inertia of %s are far too large for their size; inertia_from_urdf: false guesses them"
        log.warning(message, name, ", ".join(too_large))


def _largest_radius(pb: Client, body_id: int, link: int) -> float:
    """Returns an upper bound of how far the collision shape reaches from the centre of mass [m].

    It is inf without a shape, and in maximal coordinates, where PyBullet reports no shapes.
    """
    if pb.getDynamicsInfo(body_id, link)[10] == MAXIMAL_COORDINATES or not pb.getCollisionShapeData(body_id, link):
        return math.inf
    lower, upper = pb.getAABB(body_id, link)
    centre = pb.getBasePositionAndOrientation(body_id)[0] if link < 0 else pb.getLinkState(body_id, link)[0]
    return math.hypot(*(max(high - at, at - low) for low, high, at in zip(lower, upper, centre)))
