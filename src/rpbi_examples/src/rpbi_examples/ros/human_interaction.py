"""Starts an arm and a haptic device, shows forces and heights, and evaluates each press of the arm on a box."""

import threading
import time
from collections import deque
from pathlib import Path

import rospy
import tf2_ros
from geometry_msgs.msg import PoseStamped, WrenchStamped
from std_msgs.msg import Float64
from std_srvs.srv import Empty, SetBool, Trigger

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.end_launch import end_launch
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from custom_ros_tools.ros.services import call_service, get_srv_handler
from custom_ros_tools.tf import TfInterface
from operator_node.msg import HapticState
from rpbi_examples.press_report import Press, PressSample

from .joint_targets import wait_until_ready

SENSOR = "rpbi/kuka_lwr/force_torque_sensor_mount/ft_sensor"
WORLD, TOOL, TARGET = "rpbi/world", "rpbi/kuka_lwr/end_effector_ball", "rpbi/target"
SAMPLE_HZ = 100.0
PLOT_S = 0.25
MAX_BUFFERED = 1000
"""Size of the buffers in which forces and poses wait for the other data with the same time."""
WINDOW_S = 20.0
"""Time span shown in the window [s]."""
LEFT_S = 2.0
"""Time after the scripted device has disconnected at which the press counts as over [s]."""
MAX_ERROR = 0.05
"""Largest relative error of a press's mean forces, on the tool and on the handle."""


class Watch:
    """Samples forces and heights during a press, and writes a figure and a table after each press."""

    def __init__(self) -> None:
        self._folder = Path(rospy.get_param("~working_directory", "."), rospy.get_param("~output", "."))
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            message = f"output: expected a folder that can be made, got '{self._folder}': {error.strerror}"
            raise InterfaceError(message) from error
        self._is_scripted = rospy.get_param("~device", "") == "scripted"
        self._press = self._new_press()
        self._measured: deque[tuple[rospy.Time, float]] = deque(maxlen=MAX_BUFFERED)
        """Data that are not in a sample yet."""
        self._felt_n: deque[tuple[float, float]] = deque(maxlen=MAX_BUFFERED)
        self._handle_z: deque[tuple[float, float]] = deque(maxlen=MAX_BUFFERED)
        self._newest_s = 0.0
        self._start_s: float | None = None
        self._over = threading.Event()
        self._failure = ""
        self._connected_s = float("inf")
        self._tf = TfInterface()
        self._reading = rospy.Publisher("ft_reading", Float64, queue_size=10)

    def run(self) -> None:
        """Runs until ROS shuts down or the scripted press is over. With `~plot`, shows the figure of the present press.

        Raises:
            InterfaceError: If the mean force of the scripted press differs from the prediction.
        """
        self._begin()
        if rospy.get_param("~plot", False):
            self._show()
        while not rospy.is_shutdown() and not self._over.wait(0.1):
            pass
        if self._failure:
            raise InterfaceError(self._failure)
        end_launch("the press is over")

    def _begin(self) -> None:
        """Waits for sensor, guard and arm. Then switches on IK and haptics, so that the arm follows the handle."""
        # the call tares the sensor; without contact, the sensor measures the weight of the tool
        get_srv_handler(SENSOR, Empty)()
        rospy.Subscriber(SENSOR, WrenchStamped, self._measure, queue_size=MAX_BUFFERED, tcp_nodelay=True)
        rospy.Subscriber("haptics/force", WrenchStamped, self._feel, queue_size=MAX_BUFFERED, tcp_nodelay=True)
        rospy.Subscriber("haptics/pose", PoseStamped, self._move, queue_size=MAX_BUFFERED, tcp_nodelay=True)
        rospy.Subscriber("haptics/state", HapticState, self._note_state, queue_size=1)
        if rospy.get_param("~guard", False):
            # otherwise the press is over before it subscribes
            get_srv_handler("robot_safety/start_subscriber", Trigger)
        wait_until_ready()
        solver = rospy.get_param("~ik", "pybullet")
        for toggle in (f"ik/setup/{solver}/toggle", f"ik/solver/{solver}/toggle", "haptics/toggle"):
            call_service(toggle, SetBool, True)
        rospy.loginfo("the handle moves the arm up and down; press it on the box")
        WallTimer(SAMPLE_HZ, self._sample)

    def _new_press(self) -> Press:
        return Press(*(rospy.get_param(f"~{key}") for key in ("stiffness", "force_scale", "touch_height")))

    def _measure(self, message: WrenchStamped) -> None:
        measured_n = -message.wrench.force.z  # the sensor's z axis points down
        stamp_s = message.header.stamp.to_sec()
        if not 0.0 <= stamp_s - self._newest_s < 1.0 / SAMPLE_HZ:
            self._newest_s = stamp_s
            self._measured.append((message.header.stamp, measured_n))
        self._reading.publish(Float64(measured_n))

    def _feel(self, message: WrenchStamped) -> None:
        self._felt_n.append((message.header.stamp.to_sec(), message.wrench.force.z))

    def _move(self, message: PoseStamped) -> None:
        self._handle_z.append((message.header.stamp.to_sec(), message.pose.position.z))

    def _note_state(self, state: HapticState) -> None:
        if state.connected:
            self._connected_s = time.monotonic()

    def _sample(self) -> None:
        """Adds a sample for each measured force for which TF has the tool's pose at the same time.

        On a busy machine, TF may lag behind the forces, so the forces wait in a buffer.
        """
        buffer = self._tf.tf_buffer
        while self._measured and not self._over.is_set():
            stamp, measured_n = self._measured[0]
            try:
                if stamp > buffer.get_latest_common_time(WORLD, TOOL):
                    break
                tool_z = buffer.lookup_transform(WORLD, TOOL, stamp).transform.translation.z
                target_z = buffer.lookup_transform(WORLD, TARGET, rospy.Time(0)).transform.translation.z
            except tf2_ros.TransformException:  # older than the first TF message
                self._measured.popleft()
                continue
            self._measured.popleft()
            stamp_s = stamp.to_sec()
            self._start_s = stamp_s if self._start_s is None else self._start_s
            handle_z, felt_n = _value_at(self._handle_z, stamp_s), _value_at(self._felt_n, stamp_s)
            self._press.add(PressSample(stamp_s - self._start_s, handle_z, target_z, tool_z, measured_n, felt_n))
            if self._press.is_over:
                self._finish()
        if self._is_scripted and time.monotonic() - self._connected_s > LEFT_S and not self._over.is_set():
            self._finish()

    def _finish(self) -> None:
        press, self._press = self._press, self._new_press()
        press.write_table(self._folder / "human_interaction.csv")
        press.write_figure(self._folder / "human_interaction.png")
        report = press.report()
        summary = (
            "pressed too shortly to measure the force, or the simulator stood still" if report is None else str(report)
        )
        rospy.loginfo("%s; see human_interaction.png and .csv in %s", summary, self._folder.resolve())
        if report is not None and report.felt_error > MAX_ERROR:
            rospy.logwarn(
                "the handle felt otherwise: is the machine too busy? See haptics/state for why forces are cut"
            )
        if self._is_scripted:
            if report is None or report.error > MAX_ERROR:
                self._failure = f"the force differs from the expected one: {summary}"
            self._over.set()

    def _show(self) -> None:
        import matplotlib.pyplot as plt

        figure = plt.figure("Human interaction", figsize=(9.0, 5.0), layout="constrained")
        while plt.fignum_exists(figure.number) and not rospy.is_shutdown() and not self._over.is_set():
            press = self._press
            recent = self._new_press()
            recent.samples = [each for each in press.samples if each.time_s > press.samples[-1].time_s - WINDOW_S]
            recent.draw(figure)
            plt.pause(PLOT_S)
        plt.close(figure)


def _value_at(values: deque[tuple[float, float]], time_s: float) -> float:
    """Returns the value of the latest pair (stamp, value) with a stamp of at most `time_s` [s]; 0 if there is none."""
    return next((value for stamp_s, value in reversed(values.copy()) if stamp_s <= time_s), 0.0)


def main() -> None:
    """Runs the node."""
    run_node("human_interaction", Watch, Watch.run)
