"""A small world as an environment: an arm of one joint sweeps over a floor and knocks a box."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from worlds import BOX_FLOOR, box, write_world

from rpbi.gym.actions import ActionPart, JointAction
from rpbi.gym.env import WorldEnv
from rpbi.gym.parts import ObservationPart, pose_part
from rpbi.gym.task import WorldTask, WorldTaskConfig

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="bar">
    <inertial><origin xyz="0.25 0 0"/><mass value="1"/>
      <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual><origin xyz="0.25 0 0"/><geometry><box size="0.5 0.05 0.05"/></geometry></visual>
    <collision><origin xyz="0.25 0 0"/><geometry><box size="0.5 0.05 0.05"/></geometry></collision>
  </link>
  <joint name="swing" type="revolute"><parent link="base"/><child link="bar"/><axis xyz="0 0 1"/>
    <origin xyz="0 0 0.06"/><limit lower="-1.5" upper="1.5" effort="50" velocity="4"/></joint>
</robot>"""
CAMERA = {
    "name": "eye",
    "hz": 1,
    "intrinsics": {"width": 24, "height": 16, "fov": 60.0, "range": [0.1, 5.0]},
    "object_tf": {"tf_id": "rpbi/eye"},
}


def write(folder: Path, connect: dict[str, Any] | None = None, **robot: Any) -> str:
    """Writes the world, with further keys of the robot, if it is not there yet; returns its main file."""
    if (folder / "world.yaml").exists():
        return str(folder / "world.yaml")
    (folder / "arm.urdf").write_text(ARM)
    arm = {
        "name": "arm",
        "loadURDF": {"fileName": str(folder / "arm.urdf"), "useFixedBase": True},
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "target_interpolation": "hold",
        "joint_state_publisher_hz": 0,
        **robot,
    }
    place = {"tf_id": "rpbi/eye", "position": [0.4, 0.0, 1.5], "rpy": [3.14159, 0.0, 0.0]}
    thing = box(half_extents_m=(0.05, 0.05, 0.05), basePosition=[0.35, 0.15, 0.05])
    main = {"rgbd_sensor": CAMERA, "poses": [place], "connect": connect or {"connection_mode": "DIRECT"}}
    return write_world(folder, collision=(BOX_FLOOR,), dynamic=(thing,), robots=(arm,), **main)


class SwingConfig(WorldTaskConfig):
    """Options of the task."""

    fault: str = ""
    """What it does wrong."""


class Swing(WorldTask):
    """Knocks the box away."""

    Config = SwingConfig

    def actions(self) -> Sequence[ActionPart]:
        """Returns the joint."""
        return [JointAction(self.world, "arm", (), 1.0, self.period_s)]

    def parts(self) -> Iterator[ObservationPart]:
        """Adds the box."""
        yield from super().parts()
        yield pose_part(self.world, "box", (-2.0,) * 3, (2.0,) * 3)

    def observation(self) -> Any:
        """Returns the parts, unless it is to do something wrong."""
        found = super().observation()
        if self.config.fault == "nan":
            found["arm/joints"] = np.full(2, np.nan, np.float32)
        if self.config.fault == "shape":
            found["box/pose"] = np.zeros(3, np.float32)
        if self.config.fault == "key":
            del found["box/pose"]
        return found

    def reward(self) -> float:
        """Returns the way of the box."""
        if self.config.fault == "raise":
            raise ZeroDivisionError("division by zero")
        return float("nan") if self.config.fault == "reward" else self.world.bodies["box"].base_pose().position[1]

    def has_succeeded(self) -> Any:
        """Returns whether the box is away."""
        return "yes" if self.config.fault == "success" else self.world.bodies["box"].base_pose().position[1] > 0.3


def made(folder: Path, fault: str = "", robot: dict[str, Any] | None = None, **options: Any) -> WorldEnv:
    """Makes an environment in a folder."""
    task = {"type": "gym_world:Swing", "fault": fault, "action_ticks": 10, "max_actions": 6}
    return WorldEnv(write(folder, **robot or {}), task, **options)
