"""`~config` of `ik_setup_node.py pybullet`, which asks a simulated robot itself."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Count, FrameId, ListOf, Name, NonNegative, Text


class RobotIKConfig(ConfigModel):
    """What the robot's own inverse kinematics is asked; the keys are those of its message."""

    robot_name: Name = Field(description="The robot; its YAML has `start_ik_callback: true`.")
    link_name: Text = Field(description="The link that goes to the target.")
    parent_frame_id: FrameId = Field(description="TF frame of the world.")
    child_frame_id: FrameId = Field(description="TF frame that is the target.")
    lowerLimits: ListOf[float] = Field((), description="Of each joint that a motor can move, as the next three.")
    upperLimits: ListOf[float] = Field((), description="These four go together [rad or m].")
    jointRanges: ListOf[float] = Field((), description="How far each may be from its rest posture, in proportion.")
    resetPoses: ListOf[float] = Field((), description="Rest posture.")
    jointDamping: ListOf[NonNegative] = Field((), description="How unwilling each joint is to move.")
    solver: Literal[0, 1] = Field(0, description="0 damped least squares, 1 selectively damped least squares.")
    maxNumIterations: Count = Field(0, description="Most iterations from one start; 0 is up to the robot.")
    residualThreshold: NonNegative = Field(0.0, description="Distance at which the search stops [m].")
