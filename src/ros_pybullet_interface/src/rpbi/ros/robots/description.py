"""The parameter that tells ROS what a robot looks like, and the command that makes it for launch files."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable

import pybullet_data
import rospy

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.ros.lifecycle.kept_parameters import kept_parameters
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.config.asset_files import find_file
from rpbi.ros.services.body_context import BodyContext
from rpbi.urdf.files import description_for_ros


def publish_description(context: BodyContext) -> Callable[[], None] | None:
    """Sets `rpbi/NAME/robot_description`, for robot_state_publisher and RViz; returns what deletes it."""
    body = context.body
    if not isinstance(body, JointedBody):
        return None
    name = rospy.resolve_name(f"rpbi/{body.name}/robot_description")
    kept_parameters.set(name, description_for_ros(body.config.loadURDF.fileName))
    return lambda: kept_parameters.delete(name)


def main() -> None:
    """Prints a robot description; launch files need it before the simulator is up: robot_state_publisher does."""
    parser = argparse.ArgumentParser(description="Prints a URDF with mesh paths that RViz finds.")
    parser.add_argument("urdf", help="file; {package}/path is resolved, and PyBullet's data is looked in")
    name = parser.parse_args().urdf
    try:
        print(description_for_ros(find_file(name, ".", (pybullet_data.getDataPath(),))))
    except (ConfigError, OSError, ValueError) as error:
        print(f"{name}: {error}", file=sys.stderr)
        sys.exit(1)
