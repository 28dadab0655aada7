"""Chains read from URDFs move as PyBullet's robots do."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pybullet_data
import pytest

from custom_ros_tools.errors import ConfigError, UnknownNameError
from ik_ros.chain.kdl import KdlChain
from ik_ros.conformance import distances
from robot_model.chain import Chain
from robot_model.geometry import Pose
from rpbi.kinematics import Kinematics

DATA = Path(pybullet_data.getDataPath())
LWR = Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf"
RIG = """<robot name="rig">
  <link name="wall"/>
  <joint name="bracket" type="fixed"><parent link="wall"/><child link="rail"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.5"/></joint>
  <link name="rail"/>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="carriage"/><axis xyz="1 0 0"/>
    <origin xyz="0 0 0.2"/><limit lower="-0.5" upper="0.5" effort="10" velocity="1.5"/></joint>
  <link name="carriage"/>
  <joint name="spin" type="continuous"><parent link="carriage"/><child link="disc"/><axis xyz="0 0 1"/>
    <limit effort="10" velocity="3"/></joint>
  <link name="disc"/>
  <joint name="mount" type="fixed"><parent link="disc"/><child link="arm"/><origin xyz="0.3 0 0" rpy="1 0 0"/></joint>
  <link name="arm"/>
  <joint name="bend" type="revolute"><parent link="arm"/><child link="hand"/><axis xyz="0 0.6 0.8"/>
    <origin xyz="0.2 0 0"/><limit lower="-1" upper="2" effort="10" velocity="0"/></joint>
  <link name="hand"/>
  <joint name="grip" type="fixed"><parent link="hand"/><child link="tool"/><origin xyz="0 0.1 0.4" rpy="0 2 0"/></joint>
  <link name="tool"/>
  <joint name="lid" type="planar"><parent link="rail"/><child link="cover"/></joint>
  <link name="cover"/>
  <joint name="flap" type="revolute"><parent link="cover"/><child link="flag"/><axis xyz="0 1 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <link name="flag"/>
</robot>"""
CHAINS = {
    "lwr": (LWR, "lwr_arm_0_link", "end_effector_ball"),
    "lwr from the middle": (LWR, "lwr_arm_2_link", "lwr_arm_6_link"),
    "iiwa": (DATA / "kuka_iiwa/model.urdf", "lbr_iiwa_link_0", "lbr_iiwa_link_7"),
    "panda": (DATA / "franka_panda/panda.urdf", "panda_link0", "panda_hand"),
    "xarm6": (DATA / "xarm/xarm6_robot.urdf", "link_base", "link6"),
    "rig": ("rig.urdf", "wall", "tool"),
    "rig without its bracket": ("rig.urdf", "rail", "hand"),
}
"""File, base and tip."""


@pytest.fixture
def rig(tmp_path):
    path = tmp_path / "rig.urdf"
    path.write_text(RIG)
    return str(path)


@pytest.mark.parametrize("name", CHAINS)
def test_tip_pose_and_jacobian_equal_those_of_pybullet(name, rig):
    path, base, tip = CHAINS[name]
    path = rig if path == "rig.urdf" else str(path)
    description = Chain(path, base, tip)
    chain = KdlChain(description)
    limits = description.limits
    robot = Kinematics(path)
    generator = random.Random(1)
    for _ in range(20):
        q = limits.random(generator, limits.middle)
        at = dict(zip(description.joint_names, q))
        everywhere = [at.get(joint, 0.0) for joint in robot.joint_names]
        tip_pose = robot.forward(everywhere, tip)
        is_root = base != "rail" and "lwr" not in name
        base_pose = Pose() if is_root else robot.forward(everywhere, base)
        assert distances(base_pose.inverse() @ tip_pose, chain.pose(q)) == pytest.approx((0.0, 0.0), abs=1e-4)
        _check_jacobian(chain, q)
    robot.close()


def _check_jacobian(chain, q):
    jacobian, h = chain.jacobian(q), 1e-5
    for joint in range(len(q)):
        ends = []
        for step in (-h, h):
            moved = list(q)
            moved[joint] += step
            frame = chain.frame(moved)
            ends.append((np.array(list(frame.p)), np.array([[frame.M[i, k] for k in range(3)] for i in range(3)])))
        (p0, r0), (p1, r1) = ends
        spin = (r1 - r0) @ ((r0 + r1) / 2).T / (2 * h)
        twist = [*(p1 - p0) / (2 * h), spin[2, 1], spin[0, 2], spin[1, 0]]
        np.testing.assert_allclose(jacobian[:, joint], twist, atol=1e-5)


def test_joints_limits_and_velocities_are_those_of_the_urdf(rig):
    inf = float("inf")
    description = Chain(rig, "wall", "tool")
    assert description.joint_names == ("slide", "spin", "bend")
    assert (description.limits.lower, description.limits.upper) == ((-0.5, -inf, -1.0), (0.5, inf, 2.0))
    assert description.velocity_limits == (1.5, 3.0, inf)
    assert description.limits.is_revolute == (False, True, True)
    assert "lid" in description.robot_joints


def test_nothing_is_farther_than_the_reach(rig):
    for path, base, tip in CHAINS.values():
        description = Chain(rig if path == "rig.urdf" else str(path), base, tip)
        chain, limits = KdlChain(description), description.limits
        generator = random.Random(2)
        poses = [chain.pose(limits.random(generator, limits.middle)) for _ in range(300)]
        assert all(description.reach.covers(pose.position) for pose in poses)
        assert not description.reach.covers((5.0, 0.0, 0.0))
        assert description.reach.covers((5.0, 0.0, 0.0), 5.0)


@pytest.mark.parametrize(
    ("base", "tip", "error", "message"),
    [
        ("wall", "tol", UnknownNameError, "unknown link 'tol': known are wall, rail, .*did you mean 'tool'"),
        ("tool", "wall", ValueError, "'wall' is not below 'tool'; above it are no links"),
        ("disc", "cover", ValueError, "'cover' is below 'lid', a planar joint; only revolute, continuous, prismatic"),
        ("cover", "tool", ValueError, "'tool' is not below 'cover'; above it are hand, arm, disc, carriage"),
        ("wall", "rail", ValueError, "no joint moves 'rail' in 'wall'"),
    ],
)
def test_unknown_link_of_a_chain_is_reported_with_known_ones(rig, base, tip, error, message):
    with pytest.raises(error, match=message):
        Chain(rig, base, tip)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<axis xyz="1 0 0"/>', '<axis xyz="0 0 0"/>', "joint 'slide': axis: must not be zero"),
        ('<axis xyz="1 0 0"/>', '<axis xyz="2 0"/>', "joint 'slide': axis.xyz: expected three numbers, got '2 0'"),
        ('lower="-0.5"', 'lower="nan"', "joint 'slide': limit.lower: expected finite numbers, got 'nan'"),
        ('rpy="1 0 0"', 'rpy="1 0 x"', "joint 'mount': origin.rpy: expected numbers, got '1 0 x'"),
    ],
)
def test_numbers_that_make_no_sense_are_named_by_joint(tmp_path, old, new, message):
    path = tmp_path / "rig.urdf"
    path.write_text(RIG.replace(old, new))
    with pytest.raises((ValueError, ConfigError), match=message):
        Chain(str(path), "wall", "tool")


def test_the_length_of_an_axis_does_not_matter(tmp_path):
    """PyBullet would let a joint slide twice as far."""
    path = tmp_path / "rig.urdf"
    path.write_text(RIG.replace('<axis xyz="1 0 0"/>', '<axis xyz="2 0 0"/>'))
    chain = KdlChain(Chain(str(path), "rail", "carriage"))
    assert chain.pose([0.4]).position == pytest.approx((0.4, 0.0, 0.2))
