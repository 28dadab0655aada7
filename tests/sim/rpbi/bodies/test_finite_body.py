"""A body with numbers that are not finite does not get into a world, where they would spread."""

from __future__ import annotations

import math

import pytest
from worlds import ball, write_world

from custom_ros_tools.errors import ConfigError, PhysicsError
from rpbi.bodies.dynamic import DynamicObject
from rpbi.bodies.urdf_object import UrdfObject
from rpbi.world import World

ARM = """
<robot name="arm">
  <link name="base"><inertial><origin xyz="{centre}"/><mass value="{mass}"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="{radius}"/></geometry></collision></link>
  <link name="tip"><inertial><mass value="{tip_mass}"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="elbow" type="revolute"><parent link="base"/><child link="tip"/><origin xyz="{place}"/>
    <axis xyz="{axis}"/><limit lower="{lower}" upper="1" effort="1" velocity="1"/>
    <dynamics damping="{damping}"/></joint>
</robot>
"""
FINE = {
    "centre": "0 0 0",
    "mass": "1",
    "radius": "0.1",
    "tip_mass": "1",
    "place": "1 0 0",
    "axis": "0 0 1",
    "lower": "-1",
    "damping": "0",
}
FAULTS = {
    "mass": ("nan", "link 'base': mass.value: expected finite numbers, got 'nan'"),
    "tip_mass": ("inf", r"link 'tip': mass.value: must be within \+-1e\+09, got 'inf'"),
    "centre": ("nan 0 0", "link 'base': origin.xyz"),
    "radius": ("1e300", "link 'base': sphere.radius"),
    "place": ("1e300 0 0", "joint 'elbow': origin.xyz"),
    "axis": ("0 0 0", "link 'tip': its place or size is not finite"),
    "lower": ("nan", "joint 'elbow': limit.lower"),
    "damping": ("nan", "joint 'elbow': dynamics.damping"),
}


@pytest.fixture
def world(tmp_path):
    world = World.from_file(write_world(tmp_path, dynamic=(ball(),)))
    yield world
    world.close()


def _arm(tmp_path, **numbers):
    file = tmp_path / f"{'_'.join(numbers) or 'fine'}.urdf"
    file.write_text(ARM.format(**{**FINE, **numbers}))
    return UrdfObject.Config.parse({"name": "arm", "loadURDF": {"fileName": str(file)}}, "arm.yaml")


@pytest.mark.parametrize("key", FAULTS)
def test_urdf_with_non_finite_numbers_is_refused_naming_the_link(world, tmp_path, key):
    value, told = FAULTS[key]
    with pytest.raises((ConfigError, PhysicsError), match=f"arm: .*{told}"):
        world.add("urdf", _arm(tmp_path, **{key: value}))
    assert list(world.bodies) == ["ball"] and world.pb.getNumBodies() == 1
    for _ in range(10):
        world.step()
    assert all(map(math.isfinite, world.bodies["ball"].base_pose().position))


def test_an_infinite_limit_is_none(world, tmp_path):
    world.add("urdf", _arm(tmp_path, lower="-inf"))
    for _ in range(10):
        world.step()


def test_a_ball_that_is_too_large_is_refused():
    with pytest.raises(ConfigError, match=r"createCollisionShape.radius: must be within \+-1e\+06 \[m\], got 1e\+300"):
        DynamicObject.Config.parse(ball("huge", radius_m=1e300), "huge.yaml")


def test_non_finite_body_is_reported_at_start_with_its_file(tmp_path):
    with pytest.raises(ConfigError, match=r"huge\.yaml: createVisualShape.radius: must be within"):
        World.from_file(write_world(tmp_path, dynamic=(ball("huge", radius_m=1e300),)))
