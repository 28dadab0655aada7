"""`touch_emulator.py`: emulates the ROS driver of a 3D Systems Touch, with a hand on the device.

Like the real driver, the emulator holds the last force forever.
"""

import threading
import time

import rospy
from geomagic_touch_x_ros.msg import OmniFeedback as TouchXFeedback
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    TransformStamped,
    TwistStamped,
    Vector3,
    Wrench,
)
from omni_msgs.msg import OmniButtonEvent, OmniFeedback, OmniState
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from operator_node.haptics.emulated import Hand, PressMotion
from robot_model.geometry import ZERO, Vector

STEP_S = 0.001


class TouchEmulator:
    """Publishes the states of a simulated handle, and applies received forces to the handle. Forces are not limited."""

    def __init__(self) -> None:
        self._driver = rospy.get_param("~driver", "omni")
        name = rospy.get_param("~name", "phantom")
        self._unit = 1.0 / rospy.get_param("~metres_per_unit", 0.001)
        self._press = PressMotion(rospy.get_param("~depth", 0.04))
        self._hand, self._force, self._lock = Hand(), ZERO, threading.Lock()
        self._start_s = self._now_s = time.monotonic()
        if self._driver == "omni":
            self._state = rospy.Publisher(f"{name}/state", OmniState, queue_size=1, tcp_nodelay=True)
            self._button = rospy.Publisher(f"{name}/button", OmniButtonEvent, queue_size=1, latch=True)
            self._button.publish(OmniButtonEvent())
            rospy.Subscriber(f"{name}/force_feedback", OmniFeedback, self._feel_omni, queue_size=1, tcp_nodelay=True)
        elif self._driver == "pose":
            self._state = rospy.Publisher(f"{name}/Pose", PoseStamped, queue_size=1, tcp_nodelay=True)
            rospy.Subscriber(
                f"{name}/force_feedback", TouchXFeedback, self._feel_touch_x, queue_size=1, tcp_nodelay=True
            )
        else:
            self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10, tcp_nodelay=True)
            self._twist = rospy.Publisher(f"{name}/twist", TwistStamped, queue_size=1, tcp_nodelay=True)
            rospy.Subscriber(f"{name}/cmd_force", Wrench, self._feel_touch_x, queue_size=1, tcp_nodelay=True)
        # Publishes the force on the hand, for tests
        self._felt = rospy.Publisher(f"{name}/felt", Vector3, queue_size=1, tcp_nodelay=True)
        WallTimer(rospy.get_param("~hz", 500.0), self._publish)

    def _feel_omni(self, message: OmniFeedback) -> None:
        f = message.force
        self._feel((f.y, -f.x, f.z))

    def _feel_touch_x(self, message: Wrench | TouchXFeedback) -> None:
        f = message.force
        self._feel((-f.z, -f.x, f.y))

    def _feel(self, force: Vector) -> None:
        self._force = force
        self._felt.publish(Vector3(*force))

    def _publish(self) -> None:
        now_s = time.monotonic()
        self._now_s = max(self._now_s, now_s - 0.1)
        while self._now_s < now_s:
            step_s = min(STEP_S, now_s - self._now_s)
            self._now_s += step_s
            time_s = (self._now_s - self._start_s) % self._press.duration_s
            self._hand.step(self._press.goal(time_s), self._force, step_s)
        x, y, z = self._hand.position
        vx, vy, vz = self._hand.velocity
        header = Header(stamp=rospy.Time.now())
        no_turn = Quaternion(w=1.0)
        if self._driver == "omni":
            unit = self._unit
            pose = Pose(Point(-y * unit, x * unit, z * unit), no_turn)
            self._state.publish(
                OmniState(header, False, False, pose, Vector3(), Vector3(-vy * unit, vx * unit, vz * unit))
            )
            return
        if self._driver == "pose":
            self._state.publish(PoseStamped(header, Pose(Point(-y, x, z), no_turn)))
            return
        header.frame_id = "touch_x_base"
        twist = TwistStamped(header=header)
        twist.twist.linear = Vector3(-vy, vz, -vx)
        self._twist.publish(twist)
        transform = TransformStamped(header=header, child_frame_id="touch_x_ee")
        transform.transform.translation, transform.transform.rotation = Vector3(-y, z, -x), no_turn
        self._tf.publish(TFMessage([transform]))


def main() -> None:
    """Runs the node."""
    run_node("touch_emulator", TouchEmulator)
