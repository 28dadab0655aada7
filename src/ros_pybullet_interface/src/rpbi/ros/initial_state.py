"""Sets the initial joint positions of robots from received joint states, for instance from the real robots."""

import math
from dataclasses import replace

import rospy
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import ConfigError, Problem
from robot_model.urdf.document import UrdfDocument
from rpbi.bodies import BodyConfig
from rpbi.bodies.robots.robot_config import RobotConfig
from rpbi.world.loading import LoadedWorld


def start_where_robots_are(loaded: LoadedWorld) -> LoadedWorld:
    """Waits for a message on each robot's `initial_joint_state_topic`, and returns a world with the received positions.

    Robots whose configuration has no such key keep their configured positions.

    Raises:
        ConfigError: If a joint state does not arrive in time or does not fit its robot; the error lists all problems.
    """
    problems: list[Problem] = []
    objects = []
    for item in loaded.objects:
        try:
            objects.append(replace(item, config=with_initial_state(item.config, item.file)))
        except ConfigError as error:
            problems += error.problems
    if problems:
        raise ConfigError(problems)
    return replace(loaded, objects=tuple(objects))


def with_initial_state(config: BodyConfig, file: str) -> BodyConfig:
    """Waits for a message on a robot's `initial_joint_state_topic`; returns the configuration with received positions.

    Joints that the message does not name start as configured. Joints that the robot lacks are ignored. A configuration
    without `initial_joint_state_topic` is returned unchanged. Errors name the YAML file `file`.

    Raises:
        ConfigError: If no message arrives in time, or the received positions are invalid or all for unknown joints.
    """
    if not isinstance(config, RobotConfig) or config.initial_joint_state_topic is None:
        return config
    topic, timeout_s = rospy.resolve_name(config.initial_joint_state_topic), config.initial_joint_state_timeout_s
    try:
        message = rospy.wait_for_message(topic, JointState, timeout_s)
    except rospy.ROSException:
        raise _problem(file, f"no joint states came on {topic} within {timeout_s:g} s") from None
    if len(message.name) != len(message.position):
        counts = f"{len(message.name)} names, {len(message.position)} positions"
        raise _problem(file, f"expected a position for each name on {topic}, got {counts}")
    types = UrdfDocument(config.loadURDF.fileName).joint_types
    measured = {name: value for name, value in zip(message.name, message.position) if name in types}
    if not measured:
        raise _problem(file, f"expected joints {', '.join(types)} on {topic}, got {', '.join(message.name) or 'none'}")
    if not all(map(math.isfinite, measured.values())):
        raise _problem(file, f"expected finite positions on {topic}, got {measured}")
    if config.initial_revolute_joint_positions_are_deg:
        turning = ("revolute", "continuous")
        measured = {name: math.degrees(q) if types[name] in turning else q for name, q in measured.items()}
    start = {**config.initial_joint_position, **measured}
    return config.model_copy(update={"initial_joint_position": start})


def _problem(file: str, message: str) -> ConfigError:
    return ConfigError([Problem(file, "initial_joint_state_topic", message)])
