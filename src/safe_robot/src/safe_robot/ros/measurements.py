"""What the guard's node is told beside targets: where the robot is, what it feels, and what is around it."""

import time
from collections.abc import Mapping, Sequence

import rospy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.joint_states import values_in
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from safe_robot.check import Situation
from safe_robot.geometry.obstacles import Obstacle

from .live_obstacles import LiveObstacles

QUEUE_SIZE = 100
NEVER_S = float("-inf")


class Measurements:
    """Takes measured states and wrenches, and bodies of the environment; the last ones count.

    A state without all guarded joints, or with values that are not finite, is refused with a warning: then the one
    before counts, and gets older. Wrenches are taken as they come, in N and N m of their own frame. What has never
    come is infinitely old.

    Args:
        joint_names: The n guarded joints.
        base_frame: TF frame of the robot's root; None: nobody tells of bodies.
        left_out: Bodies that are none.
    """

    def __init__(self, joint_names: Sequence[str], base_frame: str | None, left_out: Sequence[str]) -> None:
        self._joint_names = tuple(joint_names)
        self._around = None if base_frame is None else LiveObstacles(base_frame, left_out)
        self._measured: tuple[Mapping[str, float], float] = {}, NEVER_S
        self._wrench: tuple[tuple[float, ...], float] = (0.0,) * 6, NEVER_S
        self._warn = ThrottledWarning()
        options = {"queue_size": QUEUE_SIZE, "tcp_nodelay": True}
        rospy.Subscriber("joint_states/measured", JointState, self._take_measured, **options)
        rospy.Subscriber("robot_safety/wrench", WrenchStamped, self._take_wrench, **options)

    @property
    def obstacles(self) -> tuple[Obstacle, ...] | None:
        """Bodies of the environment, as they are now; None if nobody tells."""
        return None if self._around is None else self._around.obstacles

    def situation(self, sent_s: float, age_s: float = 0.0, stamp_step_s: float | None = None) -> Situation:
        """Returns what a target is judged by.

        Args:
            sent_s: When the last command was sent [s], by the monotonic clock.
            age_s: How old the target is [s].
            stamp_step_s: How much later its stamp is than the one before [s].
        """
        now_s = time.monotonic()
        (measured, measured_s), (wrench, wrench_s) = self._measured, self._wrench
        return Situation(
            now_s=now_s,
            age_s=age_s,
            stamp_step_s=stamp_step_s,
            since_command_s=now_s - sent_s,
            measured=measured,
            measured_age_s=now_s - measured_s,
            wrench=wrench,
            wrench_age_s=now_s - wrench_s,
            obstacles=self.obstacles,
        )

    def _take_measured(self, message: JointState) -> None:
        try:
            values = values_in(message)
            values.in_order(self._joint_names)
        except (InterfaceError, ValueError) as error:
            self._warn(rospy.resolve_name("joint_states/measured"), f"message refused: {error}")
            return
        self._measured = dict(zip(values.names, values.position)), time.monotonic()

    def _take_wrench(self, message: WrenchStamped) -> None:
        force, torque = message.wrench.force, message.wrench.torque
        wrench = (force.x, force.y, force.z, torque.x, torque.y, torque.z)
        self._wrench = wrench, time.monotonic()
