"""A gripper of two fingers, with and without a coupling of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

FINGERS = ("left", "right")
_LINK = """
<link name="{name}"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/>
</inertial><collision><origin xyz="0 {y} 0"/><geometry><box size="0.02 0.02 0.06"/></geometry></collision></link>"""
_JOINT = """
<joint name="{name}" type="prismatic"><parent link="palm"/><child link="{name}_finger"/><axis xyz="0 {side} 0"/>
<limit lower="0" upper="0.06" effort="20" velocity="0.2"/>{mimic}</joint>"""


def gripper(folder: Path, mimic: str = '<mimic joint="left"/>', **more: Any) -> dict[str, Any]:
    """Writes a gripper that looks down along x, its fingers apart along y, and returns its configuration.

    Args:
        mimic: What the URDF says of the right finger.
    """
    links = _LINK.format(name="palm", y=0.5) + "".join(
        _LINK.format(name=f"{name}_finger", y=0.01 * side) for name, side in zip(FINGERS, (1, -1))
    )
    joints = _JOINT.format(name="left", side=1, mimic="") + _JOINT.format(name="right", side=-1, mimic=mimic)
    (folder / "gripper.urdf").write_text(f'<robot name="gripper">{links}{joints}</robot>')
    return {
        "name": "gripper",
        "loadURDF": {
            "fileName": str(folder / "gripper.urdf"),
            "useFixedBase": True,
            "basePosition": [0.0, 0.0, 1.0],
            "flags": "URDF_USE_INERTIA_FROM_FILE",
        },
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "initial_joint_position": {"left": 0.03},
        **more,
    }
