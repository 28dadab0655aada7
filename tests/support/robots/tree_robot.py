"""A small robot with two arms, for tests: joints that turn with and without end, and one that slides."""

from __future__ import annotations


def _link(name: str) -> str:
    return f"""<link name="{name}"><inertial><origin xyz="0.02 0.01 0.1"/><mass value="1.5"/>
        <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>"""


def _joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str, rpy: str = "0 0 0") -> str:
    limit = '<limit lower="-1.5" upper="1.5" effort="10" velocity="2"/>' if kind in ("revolute", "prismatic") else ""
    return f"""<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
        <origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}</joint>"""


TREE = f"""<robot name="tree">
{"".join(map(_link, ["body", "mount", "trunk", "left_arm", "left_hand", "right_arm", "right_hand"]))}
{_joint("fix", "fixed", "body", "mount", "0.1 0.2 0.3", "1 0 0", "0.3 0.2 0.1")}
{_joint("slide", "prismatic", "body", "trunk", "0 0 0.2", "0 0 1")}
{_joint("left_1", "revolute", "trunk", "left_arm", "0 0.2 0.3", "1 0 0", "0.1 0 0")}
{_joint("left_2", "continuous", "left_arm", "left_hand", "0 0 0.3", "0 1 0", "0 0.2 0")}
{_joint("right_1", "revolute", "trunk", "right_arm", "0 -0.2 0.3", "1 0 0", "0 0 0.4")}
{_joint("right_2", "revolute", "right_arm", "right_hand", "0 0 0.3", "0.6 0.8 0")}
</robot>"""
"""A URDF."""
