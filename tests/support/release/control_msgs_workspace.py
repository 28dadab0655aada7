"""A package `control_msgs` for tests, since Debian has none: the public names and fields that a follower needs."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

FILES = {
    "package.xml": """<?xml version="1.0"?>
<package format="2">
  <name>control_msgs</name>
  <version>1.0.0</version>
  <description>Messages of trajectory followers, for tests.</description>
  <maintainer email="maintainers@users.noreply.h-seed-eaf057c3.example">ROS-PyBullet Interface developers</maintainer>
  <license>LGPL-3.0-or-later</license>
  <buildtool_depend>catkin</buildtool_depend>
  <depend>actionlib_msgs</depend>
  <depend>trajectory_msgs</depend>
  <build_depend>message_generation</build_depend>
</package>
""",
    "CMakeLists.txt": """cmake_minimum_required(VERSION 3.16)
project(control_msgs)
find_package(catkin REQUIRED COMPONENTS actionlib_msgs message_generation trajectory_msgs)
add_message_files(DIRECTORY msg)
add_service_files(DIRECTORY srv)
add_action_files(DIRECTORY action)
generate_messages(DEPENDENCIES actionlib_msgs trajectory_msgs LANGS genpy)
catkin_package()
""",
    "msg/JointTolerance.msg": "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n",
    "msg/JointTrajectoryControllerState.msg": """Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
trajectory_msgs/JointTrajectoryPoint error
""",
    "srv/QueryTrajectoryState.srv": """time time
---
string[] name
float64[] position
float64[] velocity
float64[] acceleration
""",
    "action/FollowJointTrajectory.action": """trajectory_msgs/JointTrajectory trajectory
JointTolerance[] path_tolerance
JointTolerance[] goal_tolerance
duration goal_time_tolerance
---
int32 error_code
int32 SUCCESSFUL = 0
int32 INVALID_GOAL = -1
int32 INVALID_JOINTS = -2
int32 OLD_HEADER_TIMESTAMP = -3
int32 PATH_TOLERANCE_VIOLATED = -4
int32 GOAL_TOLERANCE_VIOLATED = -5
string error_string
---
Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
trajectory_msgs/JointTrajectoryPoint error
""",
}


def build_control_msgs(folder: Path) -> Path:
    """Builds the package in a workspace of its own, over the one that is sourced; returns where its Python modules are.

    Raises:
        AssertionError: If it does not build.
    """
    package = folder / "src" / "control_msgs"
    for name, text in FILES.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text(text)
    # The message generator needs the interpreter that Debian's ROS is for, which is the one that the tests' is made of.
    command = ["catkin_make", "--no-color", "--directory", str(folder), "-DPYTHON_EXECUTABLE=/usr/bin/python3"]
    done = subprocess.run(
        command, capture_output=True, text=True, stdin=subprocess.DEVNULL, env={**os.environ, "PWD": str(folder)}
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "devel" / "lib" / "python3" / "dist-packages"
