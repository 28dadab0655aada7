"""Robot descriptions as PyBullet and ROS want them."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from custom_ros_tools.errors import ConfigError
from robot_model.geometry import Pose
from robot_model.model import RobotModel
from robot_model.urdf.document import UrdfDocument
from robot_model.urdf.elements import text_of
from robot_model.urdf.files import write_description
from robot_model.urdf.for_pybullet import files_of, for_pybullet
from robot_model.urdf.for_ros import description_for_ros, joined_for_ros


def urdf(folder: Path, inner: str) -> str:
    path = folder / "robots" / "robot.urdf"
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"<robot name='r'><link name='a'>{inner}</link></robot>")
    return str(path)


def mesh(name: str) -> str:
    return f"<visual><geometry><mesh filename='{name}'/></geometry></visual>"


def meshes(text: str) -> list[str | None]:
    return [element.get("filename") for element in ElementTree.fromstring(text).iter("mesh")]


def resolved(path: str) -> str:
    document = UrdfDocument(path)
    return text_of(for_pybullet(document, files_of(document)))


def test_folder_near_the_urdf_replaces_a_package_as_in_pybullet(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/a.obj").write_text("")
    path = urdf(tmp_path, mesh("package://meshes/a.obj"))
    assert meshes(resolved(path)) == [str(tmp_path / "meshes/a.obj")]
    assert meshes(description_for_ros(path)) == [f"file://{tmp_path}/meshes/a.obj"]


def test_hidden_package_is_replaced_by_meshes_near_the_urdf(tmp_path):
    path = tmp_path / "rpbi_examples/robots/own.urdf"
    path.parent.mkdir(parents=True)
    (path.parent / "own.obj").write_text("")
    path.write_text(f"<robot name='own'>{mesh('package://rpbi_examples/robots/own.obj')}</robot>")
    assert meshes(resolved(str(path))) == [str(path.parent / "own.obj")]
    assert meshes(description_for_ros(str(path))) == [f"file://{path.parent}/own.obj"]


def test_a_mesh_of_an_unknown_package_is_named(tmp_path):
    with pytest.raises(ConfigError, match="package://nope/a.obj: unknown ROS package 'nope'"):
        resolved(urdf(tmp_path, mesh("package://nope/a.obj")))


def test_comments_and_plugins_are_not_meshes(tmp_path):
    inner = "<!-- <mesh filename='package://nope/old.stl'/> --><plugin filename='libgazebo_ros_control.so'/>"
    assert meshes(resolved(urdf(tmp_path, inner + "<!-- package:// -->"))) == []
    text = description_for_ros(urdf(tmp_path, inner))
    assert "libgazebo_ros_control.so" in text and "file://" not in text


def test_description_for_ros_resolves_relative_meshes_and_keeps_package_paths(tmp_path):
    inner = mesh("../a.obj") + mesh("package://rpbi_examples/robots/b.obj") + mesh("file:///c.obj")
    assert meshes(description_for_ros(urdf(tmp_path, inner))) == [
        f"file://{tmp_path}/a.obj",
        "package://rpbi_examples/robots/b.obj",
        "file:///c.obj",
    ]


def test_characters_that_are_no_xml_are_left_out(tmp_path):
    path = urdf(tmp_path, "\0" + mesh("a.obj"))
    assert len(meshes(description_for_ros(path))) == 1
    assert UrdfDocument(path).joint_types == {}


def test_two_robots_of_one_file_get_distinct_names_when_joined(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(
        "<robot name='arm'><link name='foot'/><link name='hand'/><link name='finger'/>"
        "<joint name='lift' type='prismatic'><parent link='foot'/><child link='hand'/><axis xyz='0 0 1'/>"
        "<limit lower='0' upper='1' velocity='1' effort='1'/></joint>"
        "<joint name='grip' type='prismatic'><parent link='hand'/><child link='finger'/>"
        "<mimic joint='lift'/></joint></robot>"
    )
    half_turn = Pose((1.0, 2.0, 3.0), (0.0, 1.0, 0.0, 0.0))
    text = joined_for_ros({"left": (str(path), Pose((0.0, 0.5, 0.0))), "right": (str(path), half_turn)})
    robot = RobotModel(write_description(text))
    assert robot.joint_names == ("left_lift", "right_lift")
    assert robot.pose((0.2, 0.3), "left_hand").position == pytest.approx((0.0, 0.5, 0.2))
    assert robot.pose((0.2, 0.3), "right_hand").position == pytest.approx((1.0, 2.0, 2.7))
    assert robot.pose((0.2, 0.3), "right_finger").position == pytest.approx((0.7, 2.0, 2.7)), "it mimics its own arm's"
