"""Writes robot descriptions for ROS: texts of URDFs with mesh addresses that ROS can resolve."""

import copy
import shutil
from collections.abc import Mapping
from pathlib import Path

from custom_ros_tools.config import read_file
from custom_ros_tools.transforms import rpy_of
from robot_model.geometry import Pose
from robot_model.mesh_cache import cached, content_hash, files_named_in

from .document import UrdfDocument
from .elements import Element, UrdfJoint, joint_element, new_element, text_of
from .files import found_by_ros

ROOT_LINK = "world"
"""Name of the common root link if one description contains several robots."""


def description_for_ros(path: str) -> str:
    """Returns the text of a URDF in a form that ROS nodes can use without knowing the folder of the file.

    Relative paths of meshes become `file://` addresses. `package://` addresses that ROS can resolve do not change.
    Meshes with missing textures are replaced by copies without these textures.

    Args:
        path: Path of the URDF.

    Raises:
        ConfigError: If the file is not a URDF, or a mesh belongs to an unknown package.
    """
    return text_of(_for_ros(UrdfDocument(path)))


def joined_for_ros(robots: Mapping[str, tuple[str, Pose]]) -> str:
    """Joins several robots into one URDF with the root link `world`, and returns the text.

    Args:
        robots: Path of the URDF, and pose of the root link in the world, indexed by robot name NAME. Names of the
            robot's links and joints get the prefix `NAME_`.

    Raises:
        ConfigError: If a file is not a URDF, or a mesh belongs to an unknown package.
    """
    whole = new_element("robot", new_element("link", name=ROOT_LINK), name="_".join(robots))
    for name, (path, pose) in robots.items():
        document = UrdfDocument(path)
        robot = _for_ros(document)
        named = [(part, "name") for tag in ("link", "joint") for part in robot.findall(tag)]
        named += [(part, "link") for end in ("parent", "child") for part in robot.iterfind(f"joint/{end}")]
        named += [(part, "joint") for part in robot.iterfind("joint/mimic")]
        for part, key in named:
            part.set(key, f"{name}_{part.get(key)}")
        x, y, z = rpy_of(pose.quat_xyzw).tolist()
        mount = UrdfJoint(
            f"{name}_base", "fixed", ROOT_LINK, f"{name}_{document.root_link()}", pose.position, (x, y, z)
        )
        whole.append(joint_element(mount))
        whole.extend(part for part in robot if part.tag in ("link", "joint", "material"))
    return text_of(whole)


def _for_ros(document: UrdfDocument) -> Element:
    robot = copy.deepcopy(document.root)
    for tag in ("mesh", "texture"):
        for element in robot.iterfind(f".//{tag}[@filename]"):
            found = found_by_ros(element.get("filename", ""), document.source)
            element.set("filename", found if isinstance(found, str) else f"file://{_with_existing_textures(found)}")
    return robot


def _with_existing_textures(mesh: Path) -> Path:
    """Returns the path of a mesh that does not name missing textures, which RViz would report as errors.

    If an OBJ file names missing textures, the path is that of a copy in the cache, from whose materials the lines with
    missing textures are removed. Otherwise, returns the path of the mesh itself.
    """
    try:
        data = read_file(mesh) if mesh.suffix.lower() == ".obj" else b""
        names = {name for _, name in files_named_in(data) if Path(name).name == name and (mesh.parent / name).is_file()}
        materials = {name: read_file(mesh.parent / name) for name in names}
        textures = [(name, line, texture) for name, text in materials.items() for line, texture in files_named_in(text)]
        missing = [(name, line) for name, line, texture in textures if not _texture_file(mesh, texture)]
        if not missing:
            return mesh
        for name, line in missing:
            materials[name] = materials[name].replace(line, b"\n")

        def make(folder: Path) -> None:
            for name, text in {mesh.name: data, **materials}.items():
                (folder / name).write_bytes(text)
            for texture in {file for *_, texture in textures if (file := _texture_file(mesh, texture))}:
                if Path(texture).name == texture:
                    shutil.copyfile(mesh.parent / texture, folder / texture)

        return cached(f"for-ros-{content_hash(str(mesh))}", make) / mesh.name
    except OSError:
        return mesh


def _texture_file(mesh: Path, texture: str) -> str:
    """Returns the file name in a texture entry, which may start with options; "" if the file does not exist."""
    return next((name for name in (texture, *texture.split()[-1:]) if (mesh.parent / name).is_file()), "")
