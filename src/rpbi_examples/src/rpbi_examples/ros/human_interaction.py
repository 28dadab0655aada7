"""Starts arm and haptic device, shows what happens, and reports one press and release."""

import threading
import time
from collections import deque
from pathlib import Path

import rospy
from geometry_msgs.msg import PoseStamped, WrenchStamped
from std_msgs.msg import Float64
from std_srvs.srv import Empty, SetBool

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from custom_ros_tools.ros.services import call_service, get_srv_handler
from custom_ros_tools.tf import TfInterface
from operator_node.msg import HapticState
from rpbi_examples.press_report import Press, Sample

SENSOR = "rpbi/kuka_lwr/force_torque_sensor_mount/ft_sensor"
WORLD, TOOL, TARGET = "rpbi/world", "rpbi/kuka_lwr/end_effector_ball", "rpbi/target"
SAMPLE_HZ = 100.0
PLOT_S = 0.25
KEPT_FORCES = 250
"""Half a second of the sensor."""
SHOWN_S = 20.0
"""So much of the past is in the window [s]."""
LEFT_S = 2.0
"""So long after the scripted hand has gone, its press is over in any case [s]."""
LARGEST_ERROR = 0.05
"""How far the steady force may be from what stiffness and depth predict."""


class Watch:
    """Samples forces and heights, and writes figure and table after each press."""

    def __init__(self) -> None:
        self._folder = Path(rospy.get_param("~working_directory", "."), rospy.get_param("~output", "."))
        self._is_scripted = rospy.get_param("~device", "") == "scripted"
        self._press = self._new_press()
        self._measured: deque[tuple[float, float]] = deque(maxlen=KEPT_FORCES)
        self._felt_n = self._handle_z = 0.0
        self._start_s = time.monotonic()
        self._over = threading.Event()
        self._failure = ""
        self._tf = TfInterface()
        # what it reads while it touches nothing is the weight of the tool
        get_srv_handler(SENSOR, Empty)()
        self._reading = rospy.Publisher("ft_reading", Float64, queue_size=10)
        rospy.Subscriber(SENSOR, WrenchStamped, self._measure, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("haptics/force", WrenchStamped, self._feel, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("haptics/pose", PoseStamped, self._move, queue_size=1, tcp_nodelay=True)
        self._connected_s = float("inf")
        rospy.Subscriber("haptics/state", HapticState, self._note_state, queue_size=1)
        for toggle in ("ik/setup/kdl/toggle", "ik/solver/kdl/toggle", "haptics/toggle"):
            call_service(toggle, SetBool, True)
        rospy.loginfo("the handle moves the arm up and down; press it on the box")
        WallTimer(SAMPLE_HZ, self._sample)

    def run(self) -> None:
        """Shows the figure while it comes, until ROS shuts down or the scripted press is over.

        Raises:
            InterfaceError: If the scripted press felt otherwise than predicted.
        """
        if rospy.get_param("~plot", False):
            self._show()
        while not rospy.is_shutdown() and not self._over.wait(0.1):
            pass
        if self._failure:
            raise InterfaceError(self._failure)
        rospy.signal_shutdown("the press is over")

    def _new_press(self) -> Press:
        return Press(*(rospy.get_param(f"~{key}") for key in ("stiffness", "force_scale", "touch_height")))

    def _measure(self, message: WrenchStamped) -> None:
        measured_n = -message.wrench.force.z  # the sensor's z axis points down
        self._measured.append((message.header.stamp.to_sec(), measured_n))
        self._reading.publish(Float64(measured_n))

    def _feel(self, message: WrenchStamped) -> None:
        self._felt_n = message.wrench.force.z

    def _move(self, message: PoseStamped) -> None:
        self._handle_z = message.pose.position.z

    def _note_state(self, state: HapticState) -> None:
        if state.connected:
            self._connected_s = time.monotonic()

    def _sample(self) -> None:
        target, tool = (self._tf.get_tf_msg(WORLD, frame) for frame in (TARGET, TOOL))
        if target is None or tool is None or not self._measured or self._over.is_set():
            return
        tool_s = tool.header.stamp.to_sec()
        # of the moment of the tool's pose: on a busy machine the newest of either may be of another one
        measured_n = min(self._measured.copy(), key=lambda each: abs(each[0] - tool_s))[1]
        target_z, tool_z = target.transform.translation.z, tool.transform.translation.z
        time_s = time.monotonic() - self._start_s
        self._press.add(Sample(time_s, self._handle_z, target_z, tool_z, measured_n, self._felt_n))
        if self._press.is_over or (self._is_scripted and time.monotonic() - self._connected_s > LEFT_S):
            press, self._press = self._press, self._new_press()
            self._finish(press)

    def _finish(self, press: Press) -> None:
        press.write_table(self._folder / "human_interaction.csv")
        press.write_figure(self._folder / "human_interaction.png")
        report = press.report()
        told = "pressed too shortly to tell how strongly" if report is None else str(report)
        rospy.loginfo("%s; see human_interaction.png and .csv in %s", told, self._folder.resolve())
        if report is not None and report.felt_error > LARGEST_ERROR:
            rospy.logwarn(
                "the handle felt otherwise: is the machine too busy? See haptics/state for why forces are cut"
            )
        if self._is_scripted:
            if report is None or report.error > LARGEST_ERROR:
                self._failure = f"the force is not what it should be: {told}"
            self._over.set()

    def _show(self) -> None:
        import matplotlib.pyplot as plt

        figure = plt.figure("Human interaction", figsize=(7.0, 5.0))
        while plt.fignum_exists(figure.number) and not rospy.is_shutdown() and not self._over.is_set():
            press = self._press
            recent = self._new_press()
            recent.samples = [each for each in press.samples if each.time_s > press.samples[-1].time_s - SHOWN_S]
            recent.draw(figure)
            plt.pause(PLOT_S)
        plt.close(figure)


def main() -> None:
    """Runs the node."""
    run_node("human_interaction", Watch, Watch.run)
