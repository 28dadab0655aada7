"""A small mobile robot for tests: a box on the ground whose centre of mass is far from its frame, with an arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

HALF_LENGTH_M = 0.3
BASE_KG = 40.0
ARM_KG = 8.0
CENTRE_OF_BASE_M = (0.1, 0.05, 0.1)
"""Centre of mass of the base in its frame [m]."""

_URDF = f"""<robot name="mobile_base">
  <link name="base_link">
    <inertial>
      <origin xyz="{" ".join(map(str, CENTRE_OF_BASE_M))}" rpy="0 0 0.4"/>
      <mass value="{BASE_KG}"/>
      <inertia ixx="1.0" ixy="0" ixz="0" iyy="1.5" iyz="0" izz="2.0"/>
    </inertial>
    <collision>
      <origin xyz="0 0 0.15"/>
      <geometry><box size="{2 * HALF_LENGTH_M} 0.4 0.28"/></geometry>
    </collision>
  </link>
  <link name="arm">
    <inertial>
      <origin xyz="0.4 0 0"/>
      <mass value="{ARM_KG}"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.4" iyz="0" izz="0.4"/>
    </inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base_link"/>
    <child link="arm"/>
    <origin xyz="0 0 0.5"/>
    <axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="100" velocity="5"/>
  </joint>
</robot>
"""


def mobile_base(folder: Path, name: str = "mobile", **more: Any) -> dict[str, Any]:
    """Writes the robot's description into a folder and returns its configuration, with a planar base."""
    path = folder / "mobile_base.urdf"
    path.write_text(_URDF)
    load_urdf = {"fileName": str(path), **more.pop("loadURDF", {})}
    return {
        "name": name,
        "loadURDF": load_urdf,
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "planar_base": {},
        **more,
    }
