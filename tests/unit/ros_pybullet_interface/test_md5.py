"""Messages and services have the md5 sums that clients written for the authors' release expect."""

import importlib
import re
from pathlib import Path

import pytest

SOURCES = Path(__file__).resolve().parents[3] / "src"

MESSAGES = {
    "ik_ros/IKSolution": "9d9d20f46e8e2af539dbff8d238f2338",
    "ik_ros/TracIKProblem": "7be0c51f9022071f61a2d5e730a6ea2b",
    "ros_pybullet_interface/CalculateInverseKinematicsProblem": "66ba1e46809f0e71459d2d82a47754bf",
    "ros_pybullet_interface/JointInfo": "a9c7515fded04226244ad03a018364a8",
    "ros_pybullet_interface/KeyboardEvent": "70fe1577726387662ed067d7c32e2647",
    "ros_pybullet_interface/MouseEvent": "696c74a6ae77c9e704c542ce3f600209",
    "ros_pybullet_interface/PybulletObject": "022579c11581da84aa0c29f919119faa",
    "ros_pybullet_interface/ResetDebugVisualizerCamera": "efde5121549f4407c5ac25e7a0eb7731",
}
SERVICES = {
    "custom_ros_tools/SetString": "546971982e3fbbd5a41e60fb6432e357",
    "custom_ros_tools/SetTransform": "18a9eea4bf7301361f824b9b6abce083",
    "ik_ros/JointNames": "587f4b1b8847cbdf153605e9cf8ebaed",
    "ik_ros/TracIK": "8a445ecb230fa39cf7d2ac5953bef6a0",
    "ros_pybullet_interface/AddPybulletObject": "21feca091ba47662b9b8306046dd6d18",
    "ros_pybullet_interface/CalculateInverseKinematics": "4ae03ea1c2add4477faaf6439751820f",
    "ros_pybullet_interface/GetDebugVisualizerCamera": "f54fde95a74416d547ed75f41181d84a",
    "ros_pybullet_interface/ResetEffState": "b4b9e8e680c64cc1fb7c1344cfdcfe27",
    "ros_pybullet_interface/ResetJointState": "41a26f0fbc660cf98fb7f043a66ebbaf",
    "ros_pybullet_interface/RobotInfo": "471d7ab0ef52a9053d202aeb048099a0",
}


def md5_of(name: str, kind: str) -> str:
    """The md5 sum of the Python class that the build generated, e.g. of ("std_msgs/Bool", "msg")."""
    package, type_name = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), type_name)._md5sum


@pytest.mark.parametrize("name, md5", MESSAGES.items(), ids=lambda value: value.split("/")[-1])
def test_message_is_compatible_on_the_wire(name: str, md5: str) -> None:
    assert md5_of(name, "msg") == md5


@pytest.mark.parametrize("name, md5", SERVICES.items(), ids=lambda value: value.split("/")[-1])
def test_service_is_compatible_on_the_wire(name: str, md5: str) -> None:
    assert md5_of(name, "srv") == md5


@pytest.mark.parametrize("path", sorted(SOURCES.glob("*/*/*.[ms][sr][gv]")), ids=lambda path: path.name)
def test_every_field_says_what_it_means(path: Path) -> None:
    """The definitions are what `rosmsg show -r` prints: each field has a comment, the file a first line."""
    lines = path.read_text().splitlines()
    fields = [line for line in lines if re.match(r"[A-Za-z]", line)]
    silent = [line for line in fields if "#" not in line and not line.startswith("std_msgs/Header header")]
    assert lines[0].startswith("# ")
    assert not silent
