"""`haptic_node.py`: moves a TF frame with a haptic device, and renders the forces on a tool that follows the frame."""

import re
import sys
import time

import rospy
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.services import Toggle, ToggleService

from .config import HapticNodeConfig
from .coupling import stiffest_n_per_m
from .devices import HAPTIC_DEVICES
from .haptic_topics import HandlePublisher, HapticStatePublisher, ToolFeed
from .link import LoopReport, Setup
from .loop import HZ
from .loop_client import LoopClient


class HapticNode:
    """Connects a haptic device to a tool. The 1 kHz loop between device and tool runs in a separate process.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        self._config = config = private_parameters(HapticNodeConfig)
        setup = _setup(config)
        stiffness_bound = stiffest_n_per_m(setup.options.damping, config.damping, 1.0 / HZ)
        if config.mode == "coupling" and config.stiffness > stiffness_bound:
            rospy.logwarn(
                "%s: a stiffness of %g N/m is above %g N/m, up to which a wall is passive by itself (Colgate): "
                "the passivity controller will have to brake",
                config.device,
                config.stiffness,
                stiffness_bound,
            )
        self._warn = ThrottledWarning()
        self._handle = HandlePublisher(config, setup.options.workspace_m)
        self._state = HapticStatePublisher(config, stiffness_bound)
        self._tool: ToolFeed | None = None
        self._last = LoopReport()
        self.loop = LoopClient(setup, self._on_report, _arguments())
        rospy.on_shutdown(self.loop.close)
        self._tool = ToolFeed(config, self.loop)
        feedback = Toggle("the haptic device", self.loop.start, self.loop.stop)
        if config.start_on_init:
            feedback.on()
        ToggleService("haptics/toggle", feedback.on, feedback.off)
        rospy.Service("haptics/reset", Trigger, self._reset)
        WallTimer(config.state_hz, lambda: self._state.publish(self.loop.report))

    def run(self) -> None:
        """Waits until the device has ended, for example because the user closed it, or until ROS shuts down.

        Raises:
            InterfaceError: If the loop's process ends repeatedly.
        """
        while not rospy.is_shutdown():
            if self.loop.ended.wait(0.1):
                self._state.publish(self.loop.report)  # with the final state
                time.sleep(0.1)
                if self.loop.failure:
                    raise InterfaceError(f"{self._config.device}: {self.loop.failure}")
                rospy.signal_shutdown(self.loop.report.trouble)

    def _on_report(self, report: LoopReport) -> None:
        """Logs and publishes a report of the loop. Called in the thread that receives reports."""
        last, self._last, name = self._last, report, self._config.device
        if report.trouble != last.trouble:
            if report.is_connected:
                but = "" if self.loop.is_real_time else ", but its loop has no real-time priority (ulimit -r is 0)"
                rospy.loginfo("%s: connected%s", name, but)
            else:
                rospy.logwarn("%s: %s; the force is zero", name, report.trouble.removeprefix(f"{name}: "))
        if report.fault:
            self._warn(name, f"reading refused: {report.fault}")
        self._state.note(report)
        if not rospy.is_shutdown():  # otherwise the topics are closed
            self._handle.publish(report, self._tool.start if self._tool else None)

    def _reset(self, _: TriggerRequest) -> TriggerResponse:
        self.loop.reset()
        return TriggerResponse(True, "the target returns to its start")


def _setup(config: HapticNodeConfig) -> Setup:
    """Returns the first message to the loop's process: class and options of the device, and the configuration.

    Raises:
        ConfigError: If the device is unknown or its options are wrong.
    """
    device = HAPTIC_DEVICES.configured(config.device, rospy.get_name(), "device")
    return Setup(device, device.Config.parse(config.device_options, f"{rospy.get_name()}/device_options"), config)


def _arguments() -> list[str]:
    """Returns remappings, namespace and node name for the loop's process, which some devices turn into a ROS node."""
    *_, name = rospy.get_name().split("/")
    given = [each for each in sys.argv[1:] if ":=" in each and not re.match("_[^_]|__(name|ns|log):=", each)]
    return [*given, f"__ns:={rospy.get_namespace()}", f"__name:={name}_device"]


def main() -> None:
    """Runs the node."""
    run_node("haptic_node", HapticNode, HapticNode.run)
