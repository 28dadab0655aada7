"""A guard's node, and what it is sent and says."""

from __future__ import annotations

import time
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from guarded_arm import SLIDER
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger, TriggerResponse

from safe_robot.msg import Status, Violation

NODE = "robot_safety_node"
NAMES = ["slide", "turn"]


class GuardStation:
    """The node of a robot without shapes in a namespace of its own, and its topics.

    A slow machine is no dead source here: the age of targets counts only where a test says so.

    Args:
        ros: Starts it.
        namespace: Where.
        parameters: Its parameters, beside `silence_s`.
    """

    def __init__(self, ros: RosSystem, namespace: str, **parameters: Any) -> None:
        self._ros, self._namespace = ros, namespace
        rospy.set_param(f"{namespace}/robot_description", SLIDER)
        for name, value in {"silence_s": 60.0, **parameters}.items():
            rospy.set_param(f"{namespace}/{NODE}/{name}", value)
        self.process = ros.start(["rosrun", "safe_robot", "safe_robot_node.py", f"__ns:={namespace}"])
        self._publisher = rospy.Publisher(f"{namespace}/joint_states/target", JointState, queue_size=1000)
        kind = JointState if parameters.get("publish_as_joint_state", True) else Float64MultiArray
        self.commands = ros.listen(f"{namespace}/joint_states/command", kind)
        shown = DiagnosticStatus if parameters.get("status_as_diagnostic", False) else Status
        self.statuses = ros.listen(f"{namespace}/robot_safety/status", shown)
        self.violations = ros.listen(f"{namespace}/robot_safety/violation", Violation)

    def wait(self) -> None:
        """Waits until it is there, and starts it if it is halted; so each test can begin with it."""
        rospy.wait_for_service(f"{self._namespace}/robot_safety/start_subscriber", timeout=60.0)
        listeners = (self.commands, self.statuses, self.violations)
        wait_until(lambda: all(each.is_connected for each in listeners), "the guard sends to the test")
        wait_until(self._publisher.get_num_connections, "the guard listens to the test")
        self.call("stop")
        self.call("start")
        for listener in listeners:
            listener.messages.clear()
            listener.arrival_s.clear()

    def send(self, *position: float, age_s: float = 0.0, **fields: Any) -> JointState:
        """Publishes a target of the present time, or before; returns it."""
        message = JointState(**{"name": NAMES, "position": position, **fields})
        message.header.stamp = rospy.Time.from_sec(time.time() - age_s)
        self.publish(message)
        return message

    def publish(self, message: JointState) -> None:
        """Publishes a target as it is."""
        self._publisher.publish(message)

    def send_unstamped(self, *position: float) -> None:
        """Publishes a target that does not say of when it is."""
        self._publisher.publish(JointState(name=NAMES, position=position))

    def call(self, verb: str) -> TriggerResponse:
        """Calls `start` or `stop`."""
        return self._ros.call(f"{self._namespace}/robot_safety/{verb}_subscriber", Trigger)

    def close(self) -> None:
        """Ends the publisher of targets."""
        self._publisher.unregister()
