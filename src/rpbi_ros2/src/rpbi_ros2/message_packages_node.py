"""`write_ros2_messages`: writes the workspace's messages as packages that ROS 2 builds."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

import genpy

from rpbi_data.bags.message_layout import SCALAR, VARIABLE

from .layouts import OWN_PACKAGES, RefusedTypeError, Ros2Field, Ros2Type, ros2_type
from .type_hash import message_of

USAGE = """\
usage: rosrun rpbi_ros2 write_ros2_messages FOLDER [PACKAGE ...]

Writes packages of messages for ROS 2 below FOLDER, which is the `src` of a workspace there: all packages of this
workspace, or those given. Then, with ROS 2: colcon build."""
OF_ACTIONS = ("Action", "ActionGoal", "ActionResult", "ActionFeedback")
"""Ends of the names of messages that belong to actions."""
PACKAGE_XML = """\
<?xml version="1.0"?>
<package format="3">
  <name>{package}</name>
  <version>1.0.0</version>
  <description>Messages of the ROS-PyBullet interface.</description>
  <maintainer email="maintainers@users.noreply.h-seed-eaf057c3.example">ROS-PyBullet Interface developers</maintainer>
  <license>LGPL-3.0-or-later</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
{depends}
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
</package>
"""
CMAKE = """\
cmake_minimum_required(VERSION 3.16)
project({package})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}
rosidl_generate_interfaces(${{PROJECT_NAME}}
{files}
  DEPENDENCIES {depends}
)
ament_package()
"""


def write_package(package: str, folder: Path) -> list[str]:
    """Writes one package below a folder. Returns the names of its messages; without any, nothing is written."""
    texts: dict[str, str] = {}
    depends: set[str] = set()
    for message_class in _classes(package):
        try:
            message_type = ros2_type(message_class._type, message_class._full_text, OWN_PACKAGES)
        except RefusedTypeError:
            continue
        texts[message_type.name.rpartition("/")[2]] = message_text(message_type, message_class._full_text)
        inner = filter(None, map(message_of, message_type.members))
        depends |= {each.name.partition("/")[0] for each in inner} - {package}
    if not texts:
        return []
    target, names = folder / package, sorted(texts)
    (target / "msg").mkdir(parents=True, exist_ok=True)
    for name in names:
        (target / f"msg/{name}.msg").write_text(texts[name])
    known = sorted(depends | {"std_msgs"})
    tags = "\n".join(f"  <depend>{each}</depend>" for each in known)
    (target / "package.xml").write_text(PACKAGE_XML.format(package=package, depends=tags))
    finds = "\n".join(f"find_package({each} REQUIRED)" for each in known)
    files = "\n".join(f"  msg/{name}.msg" for name in names)
    (target / "CMakeLists.txt").write_text(
        CMAKE.format(package=package, finds=finds, files=files, depends=" ".join(known))
    )
    return names


def message_text(message_type: Ros2Type, definition: str) -> str:
    """Returns the definition of a message for ROS 2: its constants that are numbers, in capitals, and its fields."""
    own = definition.partition("=" * 80)[0]
    lines = (line.partition("#")[0].strip() for line in own.splitlines())
    constants = [_constant(line) for line in lines if "=" in line and not line.startswith("string")]
    return "\n".join([*constants, *map(_line, message_type.members)]) + "\n"


def _constant(line: str) -> str:
    name, _, value = line.partition("=")
    type_name, name = name.split()
    return f"{type_name} {name.upper()}={value.strip()}"


def _line(field: Ros2Field) -> str:
    inner = message_of(field)
    array = "" if field.length == SCALAR else "[]" if field.length == VARIABLE else f"[{field.length}]"
    return f"{field.type if inner is None else inner.name}{array} {field.name}"


def _classes(package: str) -> Iterable[type[genpy.Message]]:
    try:
        module = import_module(f"{package}.msg")
    except ImportError:
        return
    for name, each in vars(module).items():
        if isinstance(each, type) and issubclass(each, genpy.Message) and not name.endswith(OF_ACTIONS):
            yield each


def main() -> None:
    """Runs the program."""
    words = sys.argv[1:]
    if not words or words[0].startswith("-"):
        print(USAGE)
        sys.exit(0 if words[:1] in (["-h"], ["--help"]) else 2)
    for package in words[1:] or sorted(OWN_PACKAGES - {"control_msgs"}):
        names = write_package(package, Path(words[0]))
        print(f"{package}: {len(names)} messages" if names else f"{package}: no messages that ROS 2 can have")
