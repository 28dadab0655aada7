"""Nodes of input devices, which publish `joy` and the topics that are specific to each device."""

import math
import pkgutil
import threading

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import WrenchStamped
from pydantic import Field
from sensor_msgs.msg import Joy
from std_msgs.msg import Header

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from custom_ros_tools.schema import ConfigModel, Positive, Text
from operator_node.device import Device, Reading
from operator_node.input_topics import stamp

from . import DEVICES
from .device_feed import DeviceFeed, FeedConfig, held_text
from .device_topics import DeviceTopics

QUEUE_SIZE = 10
DIAGNOSTICS_HZ = 1.0
LAST_READING_S = 2.0
"""Longest time that a node waits at shutdown until its last reading is published [s]."""
SENDING_S = 0.1
"""Time that the node waits afterwards, so that ROS can send the last reading [s]."""


class DeviceParameters(ConfigModel):
    """Selection of the input device that the node reads."""

    device: Text = Field(description="Device: a name of the table of devices, or `package.module:Class`.")


class CueConfig(ConfigModel):
    """Scale of the forces that an input device renders, for example by rumbling."""

    cue_full_scale: Positive = Field(20.0, description="Force that the device renders with full strength [N].")


class DeviceNode:
    """Publishes the readings of a device on `joy`, and the device's events on separate topics.

    Args:
        name: Name of the device, which is also the `frame_id` of the messages on `joy`.

    Raises:
        UnknownNameError: If there is no device with this name.
        MissingDependency: If the device needs a library that is not installed.
        ConfigError: If a parameter is invalid.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        options = private_parameters(DEVICES.configured(name).Config)
        self._device = device = DEVICES.make(name, options.model_dump(exclude_unset=True), rospy.get_name())
        self._feed = DeviceFeed(name, device, private_parameters(FeedConfig), self._publish)
        self._joy: rospy.Publisher | None = None
        self._topics: DeviceTopics | None = None
        if device.ros_topics:
            self._topics = pkgutil.resolve_name(device.ros_topics)(device, self._feed.post)
        if type(device).cue is not Device.cue:
            self._full_scale_n = private_parameters(CueConfig).cue_full_scale
            rospy.Subscriber("force_cue", WrenchStamped, self._on_force, queue_size=1, tcp_nodelay=True)
        self._diagnostics = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=QUEUE_SIZE)
        WallTimer(DIAGNOSTICS_HZ, self._diagnose)
        self._is_ending, self._has_ended = threading.Event(), threading.Event()
        rospy.on_shutdown(self._end)

    def run(self) -> None:
        """Reads the device until ROS shuts down or the user closes the device, and then shuts down the node."""
        try:
            self._feed.run(self._is_ending.is_set)
        finally:
            self._has_ended.set()
        rospy.signal_shutdown("its device was closed")

    def _end(self) -> None:
        """Ends the loop that reads the device. Waits until the last reading is sent, before ROS closes the topics."""
        self._is_ending.set()
        if self._has_ended.wait(LAST_READING_S):
            threading.Event().wait(SENDING_S)

    def _publish(self, reading: Reading) -> None:
        now = stamp()
        if reading.axes or reading.buttons:
            if self._joy is None:  # a keyboard may have keys only
                self._joy = rospy.Publisher("joy", Joy, queue_size=QUEUE_SIZE, tcp_nodelay=True)
            header = Header(stamp=now, frame_id=self._name)
            self._joy.publish(Joy(header=header, axes=reading.axes, buttons=reading.buttons))
        if self._topics is not None:
            self._topics.publish(reading, now)

    def _on_force(self, message: WrenchStamped) -> None:
        force = (message.wrench.force.x, message.wrench.force.y, message.wrench.force.z)
        if all(map(math.isfinite, force)):
            share = [max(-1.0, min(1.0, each / self._full_scale_n)) for each in force]
            self._feed.post(lambda: self._device.cue(share))

    def _diagnose(self) -> None:
        feed = self._feed
        problem, refused, held = feed.problem, dict(feed.refused), feed.held
        level = DiagnosticStatus.ERROR if problem else DiagnosticStatus.WARN if refused or held else DiagnosticStatus.OK
        remarks = ["some readings are refused"] * bool(refused) + [held_text(held)] * bool(held)
        message = problem or "; ".join(remarks) or "connected"
        status = DiagnosticStatus(
            name=f"{rospy.get_name()}: {self._name}", hardware_id=self._name, level=level, message=message
        )
        values = {"published": feed.published, **{f"refused: {reason}": count for reason, count in refused.items()}}
        status.values = [KeyValue(key, str(value)) for key, value in values.items()]
        self._diagnostics.publish(DiagnosticArray(header=Header(stamp=stamp()), status=[status]))


def main() -> None:
    """Runs the node of the device that is named in the parameter `~device`."""
    run_node("device", lambda: DeviceNode(private_parameters(DeviceParameters).device), DeviceNode.run)


def joystick() -> None:
    """Runs the joystick's node, `joy_node.py`."""
    run_node("joy_node", lambda: DeviceNode("joystick"), DeviceNode.run)


def keyboard() -> None:
    """Runs the keyboard's node, `keyboard`."""
    run_node("keyboard", lambda: DeviceNode("keyboard"), DeviceNode.run)


def mouse() -> None:
    """Runs the mouse's node, `mouse_node.py`."""
    run_node("mouse", lambda: DeviceNode("mouse"), DeviceNode.run)


def mvn() -> None:
    """Runs the node for Xsens MVN, `mvn_node.py`."""
    run_node("mvn", lambda: DeviceNode("mvn"), DeviceNode.run)


def spacenav() -> None:
    """Runs the 6-D mouse's node, `spacenav_node.py`."""
    run_node("spacenav", lambda: DeviceNode("spacenav"), DeviceNode.run)
