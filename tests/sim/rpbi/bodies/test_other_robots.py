"""Robots of others: what PyBullet ships, what only it understands, and what nobody can load."""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pybullet
import pybullet_data
import pytest
from worlds import iiwa, write_world

from custom_ros_tools.errors import ConfigError
from robot_model.urdf.for_ros import description_for_ros
from rpbi.bodies import BODY_TYPES
from rpbi.kinematics import Kinematics
from rpbi.urdf import loading
from rpbi.world import World
from rpbi.world.loading import load_object

DATA = Path(pybullet_data.getDataPath())
ROOT = Path(__file__).resolve().parents[4]
SHIPPED = (
    *("a1/a1", "aliengo/aliengo", "biped/biped2d_pybullet", "franka_panda/panda", "humanoid/humanoid", "husky/husky"),
    *("kuka_iiwa/model", "laikago/laikago", "mini_cheetah/mini_cheetah", "quadruped/microtaur/microtaur"),
    *("quadruped/minitaur", "quadruped/spirit40", "quadruped/vision60", "r2d2", "racecar/racecar", "xarm/xarm6_robot"),
)
"""The robots of PyBullet's data, one of each kind."""
BOX = "<visual><geometry><box size='0.1 0.1 0.1'/></geometry></visual>"


def link(name, shape=""):
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    return f'<link name="{name}"><inertial><mass value="1"/>{inertia}</inertial>{shape}</link>\n'


def joint(number, kind):
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    ends = f'<parent link="l{number}"/><child link="l{number + 1}"/>'
    return f'<joint name="j{number}" type="{kind}">{ends}<axis xyz="0 0 1"/>{limit}</joint>\n'


def chain(fixed, moving):
    """Returns a URDF of joints one after the other, the fixed ones first."""
    kinds = ["fixed"] * fixed + ["revolute"] * moving
    links = "".join(link(f"l{number}") for number in range(len(kinds) + 1))
    return f"<robot name='chain'>{links}{''.join(joint(number, kind) for number, kind in enumerate(kinds))}</robot>"


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(file, **more) -> World:
        robot = iiwa("robot", loadURDF={"fileName": str(file), "useFixedBase": True}, **more)
        worlds.append(World.from_file(write_world(tmp_path, robots=(robot,))))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


@pytest.mark.parametrize("name", SHIPPED)
def test_every_robot_of_pybullets_data_loads_and_holds_still(build, name):
    world = build(f"{name}.urdf")
    for _ in range(20):
        world.step()
    assert len(world.bodies["robot"].joints) > 5
    assert description_for_ros(str(DATA / f"{name}.urdf")).count("package://") == 0


def test_root_that_is_not_the_first_link_keeps_link_order(tmp_path):
    joint = "<joint name='j' type='fixed'><parent link='b'/><child link='a'/></joint>"
    (tmp_path / "x.urdf").write_text(f"<robot name='x'>{link('a')}{link('b')}{joint}</robot>")
    load = {"fileName": "x.urdf", "flags": "URDF_MAINTAIN_LINK_ORDER"}  # without it, PyBullet ends with signal 11
    with contextlib.closing(World.from_file(write_world(tmp_path, urdfs=({"name": "x", "loadURDF": load},)))) as world:
        assert [world.bodies["x"].link_name(index) for index in (-1, 0)] == ["b", "a"]
    assert Kinematics(str(tmp_path / "x.urdf"), flags=pybullet.URDF_MAINTAIN_LINK_ORDER).joint_names == ()


def test_package_with_three_slashes_is_package_with_two(build, tmp_path, monkeypatch):
    package = tmp_path / "their_robot"
    package.mkdir()
    (package / "package.xml").write_text("<package><name>their_robot</name></package>")
    shutil.copy(DATA / "cube.obj", package / "cube.obj")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    for place in ("package:///their_robot/cube.obj", "package://their_robot/cube.obj", f"package://{package}/cube.obj"):
        mesh = f"<visual><geometry><mesh filename='{place}'/></geometry></visual>"
        (tmp_path / "x.urdf").write_text(f"<robot name='x'>{link('l0', mesh)}</robot>")
        world = build(tmp_path / "x.urdf")
        [shape] = world.pb.getVisualShapeData(world.bodies["robot"].body_id)
        assert shape[4].decode() == str(package / "cube.obj")
        [told] = re.findall('filename="(.*?)"', description_for_ros(str(tmp_path / "x.urdf")))
        assert told in ("package://their_robot/cube.obj", f"file://{package}/cube.obj"), "RViz finds it"
    (tmp_path / "x.urdf").write_text("<robot name='x'>" + link("l0", mesh.replace("cube", "none")) + "</robot>")
    with pytest.raises(ConfigError, match="unknown ROS package"):
        build(tmp_path / "x.urdf")


@pytest.mark.parametrize(
    ("kind", "entry"),
    [
        ("urdf", {"name": "it", "loadURDF": {"fileName": "kuka_iiwa/model.urdf"}}),
        ("robot", iiwa("it")),
        ("visual_robot", iiwa("it", is_visual_robot=True)),
        ("mobile_robot", iiwa("it", planar_base={})),
    ],
)
def test_a_prepared_urdf_is_neither_copied_nor_written_again(build, tmp_path, kind, entry):
    (tmp_path / "x.urdf").write_text("<robot name='x'>" + link("l0") + "</robot>")
    world = build(tmp_path / "x.urdf")
    made_ready = loading._prepared.cache_info
    loading._prepared.cache_clear()
    config = load_object(kind, entry, "it.yaml")
    BODY_TYPES.find(kind).prepare(config, has_window=False)
    assert made_ready().misses == 1
    world.add(kind, config)
    assert made_ready().misses == 1 and world.bodies["it"].link_indices


def test_long_output_of_pybullet_is_logged_in_part_and_counted(build, tmp_path, caplog):
    bare = "".join(f"<link name='l{number}'>{BOX}</link>" for number in range(41))
    (tmp_path / "x.urdf").write_text(f"<robot name='x'>{bare}{''.join(joint(n, 'fixed') for n in range(40))}</robot>")
    caplog.set_level("INFO", "pybullet")
    build(tmp_path / "x.urdf")
    lines = [record.message for record in caplog.records if record.name == "pybullet"]
    assert len(lines) == 21 and lines[-1] == "and 63 more lines", lines


def test_fixed_joints_are_left_out_beyond_pybullets_maximum(build, tmp_path, caplog):
    (tmp_path / "most.urdf").write_text(chain(7, 120))
    assert len(build(tmp_path / "most.urdf").bodies["robot"].joints) == 127
    assert not [record for record in caplog.records if "left out" in record.message]
    (tmp_path / "more.urdf").write_text(chain(8, 120))
    world = build(tmp_path / "more.urdf", broadcast_link_states=True, gravity_compensation=True)
    robot = world.bodies["robot"]
    assert [each.name for each in robot.joints] == [f"j{number}" for number in range(8, 128)]
    assert "robot: 128 joints are more than the 127 of PyBullet: fixed ones are left out" in caplog.text
    world.step()
    assert robot.kinematics.joint_names == tuple(each.name for each in robot.model.driven)
    assert len(robot.robot_model.gravity(robot.base_pose(), [0.0] * 120)) == 120


def test_sdf_is_refused_and_the_documented_conversion_works(build, tmp_path):
    sdf = DATA / "gripper" / "wsg50_one_motor_gripper_new.sdf"
    with pytest.raises(ConfigError, match=r"gripper_new.sdf is SDF, not URDF; see docs/robots.md for a conv"):
        build(sdf)
    [snippet] = re.findall(r"```python\n(import pybullet.*?)```", (ROOT / "docs/robots.md").read_text(), re.DOTALL)
    program = snippet.replace("model.sdf", str(sdf))
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert len(build(tmp_path / "model_0.urdf").bodies["robot"].joints) == 8
