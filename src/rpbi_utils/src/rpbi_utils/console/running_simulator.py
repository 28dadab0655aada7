"""Access to a running simulator for console commands: objects, service calls, and common command arguments."""

import math
from collections.abc import Sequence
from typing import Annotated, Any

import rosgraph
import rospy

from custom_ros_tools.console.argument import Argument, number
from custom_ros_tools.errors import InterfaceError, UnknownNameError
from robot_model.limits import LIMIT_ROUNDING
from ros_pybullet_interface.msg import JointInfo
from ros_pybullet_interface.srv import ListObjects, RobotInfo

LIST = "rpbi/list_objects"
"""Service by which a simulator is recognized. Only simulators offer this service."""
OBJECTS = "objects"
"""Name of the shell completion that lists the objects in the running world."""
Namespace = Annotated[str | None, Argument("NAMESPACE")]


class RunningSimulator:
    """Client of the simulator that runs in a namespace.

    Args:
        namespace: Namespace of the simulator, such as `left`. None: the namespace of this process.

    Raises:
        InterfaceError: If no ROS master answers, or no simulator runs in the namespace.
    """

    def __init__(self, namespace: str | None = None) -> None:
        self._namespace = rosgraph.names.get_ros_namespace() if namespace is None else f"/{namespace.strip('/')}/"
        self._namespace = self._namespace.replace("//", "/")
        uri = rosgraph.get_master_uri()
        try:
            _, subscribed, serving = rosgraph.Master("/rpbi_world").getSystemState()
        except (OSError, rosgraph.MasterException, ValueError):
            raise InterfaceError(
                f"no ROS master answers at {uri}: start a simulator, for instance by ./rpbi launch, "
                "or name its master in ROS_MASTER_URI"
            ) from None
        self._services = {name for name, _ in serving}
        self._subscribed = {name for name, _ in subscribed}
        if self.full_name(LIST) not in self._services:
            others = sorted(
                name.removesuffix(f"/{LIST}") or "/" for name in self._services if name.endswith(f"/{LIST}")
            )
            where = (
                f"in the namespace {self._namespace.rstrip('/')}" if self._namespace != "/" else "without a namespace"
            )
            advice = f"; there is one in {', '.join(others)}: use --ns" if others else ""
            raise InterfaceError(f"no simulator runs {where} on the ROS master at {uri}{advice}")

    def full_name(self, name: str) -> str:
        """Returns the full name, with namespace, of a topic or service such as `rpbi/step`."""
        return f"{self._namespace}{name}"

    def call(self, name: str, service_type: type, *arguments: object, **fields: object) -> Any:
        """Calls a service of the simulator and returns the answer.

        Raises:
            InterfaceError: If the service does not answer, or the answer reports a failure.
        """
        full_name = self.full_name(name)
        try:
            answer = rospy.ServiceProxy(full_name, service_type)(*arguments, **fields)
        except (rospy.ServiceException, OSError) as error:
            raise InterfaceError(f"{full_name} does not answer: {error}") from None
        if not getattr(answer, "success", True):
            raise InterfaceError(answer.message)
        return answer

    def objects(self) -> dict[str, str]:
        """Returns the types of all objects and cameras, keyed by name."""
        listed = self.call(LIST, ListObjects)
        return dict(zip(listed.names, listed.types))

    def require(self, body: str, name: str, what: str) -> str:
        """Checks that a body subscribes to a topic or offers a service. Returns the topic's or service's name.

        Args:
            body: Name of the body.
            name: Last part of the topic's or service's name, which is `rpbi/BODY/NAME`.
            what: Kind of body that has the topic or service, such as `a robot`; used in the error message.

        Raises:
            UnknownNameError: If the world has no such body.
            InterfaceError: If the body lacks the topic or service.
        """
        wanted = f"rpbi/{body}/{name}"
        if self.full_name(wanted) not in self._services | self._subscribed:
            objects = self.objects()
            if body not in objects:
                raise UnknownNameError("object", body, list(objects))
            raise InterfaceError(f"'{body}' is of type {objects[body]}, expected {what}")
        return wanted


def joint_values(
    simulator: RunningSimulator, robot: str, words: Sequence[str], are_positions: bool
) -> dict[str, float]:
    """Parses words of the form `JOINT:=VALUE` and returns the values, keyed by joint name.

    Args:
        simulator: Simulator of the robot.
        robot: Name of the robot.
        words: Words to parse. A value with the suffix `deg` is converted from degrees to radians.
        are_positions: Whether the values are positions, which are checked against the joint limits.

    Raises:
        InterfaceError: If a word has another form, a position is beyond a limit, or `words` is empty.
        UnknownNameError: If the robot lacks a joint.
    """
    info = simulator.call(simulator.require(robot, "robot_info", "a robot"), RobotInfo)
    known, joints = info.current_joint_state.name, {joint.jointName: joint for joint in info.joint_info}
    values = {}
    for word in words:
        joint, is_value, value = word.partition(":=")
        if not is_value:
            raise InterfaceError(f"expected JOINT:=VALUE, got {word.strip()}")
        if joint not in known:
            raise UnknownNameError("joint", joint, known)
        values[joint] = number(value)
        if are_positions and joint in joints:
            _check_limit(joints[joint], value)
    if not values:
        raise InterfaceError(f"expected JOINT:=VALUE ...; the joints of '{robot}' are {', '.join(known)}")
    return values


def _check_limit(joint: JointInfo, word: str) -> None:
    """Raises an InterfaceError if the position in `word` is beyond the joint's limits.

    The message suggests the suffix `deg` if the position would be within the limits in degrees.
    """
    lower, upper, position = joint.jointLowerLimit, joint.jointUpperLimit, number(word)
    if not lower < upper or lower - LIMIT_ROUNDING <= position <= upper + LIMIT_ROUNDING:
        return
    is_degrees = joint.is_revolute and not word.endswith("deg") and lower <= math.radians(position) <= upper
    question = f"; {word.strip()}deg?" if is_degrees else ""
    limits = f"{lower:.6g} to {upper:.6g} {'rad' if joint.is_revolute else 'm'}"
    raise InterfaceError(f"joint '{joint.jointName}' must be within {limits}, got {position:.6g}{question}")
