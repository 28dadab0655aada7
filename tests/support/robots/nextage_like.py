"""A robot with the joints of a Nextage: chest, neck and two arms, of boxes."""

from __future__ import annotations

from pathlib import Path

JOINT = """<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{name}_Link"/>
    <origin xyz="{xyz}"/><axis xyz="{axis}"/><limit lower="{lower}" upper="{upper}" effort="100" velocity="3"/></joint>
  <link name="{name}_Link"><collision><origin xyz="{at}"/><geometry><box size="{size}"/></geometry></collision></link>
"""
X, Y, Z = "1 0 0", "0 1 0", "0 0 1"
ARM = (
    ("0 {side} 0.37", Z, "0 0 0", "0.1 0.1 0.1"),
    ("0 0 0", Y, "0 0 -0.12", "0.08 0.08 0.2"),
    ("0 0 -0.25", Y, "0 0 -0.1", "0.07 0.07 0.16"),
    ("0 0 -0.2", Z, "0 0 0", "0.06 0.06 0.06"),
    ("0 0 -0.05", Y, "0 0 0", "0.05 0.05 0.05"),
    ("0 0 -0.05", X, "0 0 -0.04", "0.05 0.05 0.06"),
)
"""For each joint where it is in the link before, its axis, and where the box of its link is and how large [m]."""


def nextage_like(folder: Path) -> tuple[str, list[str]]:
    """Writes a description; returns its file and the 15 joints. The arms hang down at 0."""
    described, names = [], []

    def joint(name: str, parent: str, xyz: str, axis: str, at: str, size: str) -> None:
        described.append(JOINT.format(**locals(), lower=-2.2, upper=2.2))
        names.append(name)

    joint("CHEST_JOINT0", "WAIST", "0 0 0", Z, "0 0 0.2", "0.15 0.2 0.4")
    joint("HEAD_JOINT0", "CHEST_JOINT0_Link", "0 0 0.5", Z, "0 0 0", "0.05 0.05 0.05")
    joint("HEAD_JOINT1", "HEAD_JOINT0_Link", "0 0 0.05", Y, "0 0 0.08", "0.12 0.12 0.12")
    for arm, side in (("L", 0.25), ("R", -0.25)):
        parent = "CHEST_JOINT0_Link"
        for i, (xyz, axis, at, size) in enumerate(ARM):
            joint(f"{arm}ARM_JOINT{i}", parent, xyz.format(side=side), axis, at, size)
            parent = f"{arm}ARM_JOINT{i}_Link"
    path = folder / "nextage.urdf"
    path.write_text(f'<robot name="nextage"><link name="WAIST"/>\n  {"  ".join(described)}</robot>')
    return str(path), names
