"""Inputs of the guard's node other than targets: measured positions and forces, and bodies around the robot."""

import threading
import time
from collections.abc import Mapping, Sequence

import rospy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.joint_states import values_in
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from safe_robot.check import CheckContext
from safe_robot.geometry.obstacles import Obstacle

from .live_obstacles import LiveObstacles

QUEUE_SIZE = 100
NEVER_S = float("-inf")
NEVER = 0.0, NEVER_S


class Measurements:
    """Receives measured states and wrenches, and bodies of the environment; keeps the newest.

    A state may have only some of the guarded joints, for instance those of one of several arms. The newest position of
    each joint is used; the age is that of the oldest of these. A state without any guarded joint, or with values that
    are not finite, is refused with a warning. Wrenches are in N and N m of their own frame. A missing value is
    infinitely old.

    Args:
        joint_names: The n guarded joints.
        base_frame: TF frame of the robot's root; None without a source of bodies.
        left_out: Bodies that are no obstacles.
        bodies_timeout_s: Largest age of the poses of bodies [s].
    """

    def __init__(
        self, joint_names: Sequence[str], base_frame: str | None, left_out: Sequence[str], bodies_timeout_s: float
    ) -> None:
        self._joint_names = tuple(joint_names)
        self._around = None if base_frame is None else LiveObstacles(base_frame, left_out, bodies_timeout_s)
        self._measured: Mapping[str, tuple[float, float]] = {}
        """Position [rad or m] and time [s] by joint."""
        self._has_measured = threading.Event()
        self._wrench: tuple[tuple[float, ...], float] = (0.0,) * 6, NEVER_S
        self._warn = ThrottledWarning()
        options = {"queue_size": QUEUE_SIZE, "tcp_nodelay": True}
        rospy.Subscriber("joint_states/measured", JointState, self._on_measured, **options)
        rospy.Subscriber("robot_safety/wrench", WrenchStamped, self._on_wrench, **options)

    @property
    def obstacles(self) -> tuple[Obstacle, ...] | None:
        """Present bodies of the environment; None without a source."""
        return None if self._around is None else self._around.obstacles

    def wait(self, timeout_s: float) -> None:
        """Waits for the first measured state, at most for a time [s]."""
        self._has_measured.wait(timeout_s)

    def context(self, sent_s: float, age_s: float = 0.0, stamp_step_s: float | None = None) -> CheckContext:
        """Returns the context of the checks of a target.

        Args:
            sent_s: Time from which `since_command_s` counts [s], by the monotonic clock.
            age_s: Age of the target [s].
            stamp_step_s: Difference to the stamp before [s].
        """
        now_s = time.monotonic()
        measured, (wrench, wrench_s) = self._measured, self._wrench
        measured_s = min((measured.get(name, NEVER)[1] for name in self._joint_names), default=NEVER_S)
        return CheckContext(
            now_s=now_s,
            age_s=age_s,
            stamp_step_s=stamp_step_s,
            since_command_s=now_s - sent_s,
            measured={name: position for name, (position, _) in measured.items()},
            measured_age_s=now_s - measured_s,
            wrench=wrench,
            wrench_age_s=now_s - wrench_s,
            obstacles=self.obstacles,
        )

    def _on_measured(self, message: JointState) -> None:
        try:
            values = values_in(message)
            if not set(values.names).intersection(self._joint_names):
                values.in_order(self._joint_names)
        except (InterfaceError, ValueError) as error:
            self._warn(rospy.resolve_name("joint_states/measured"), f"message refused: {error}")
            return
        now_s = time.monotonic()
        self._measured = {**self._measured, **{name: (q, now_s) for name, q in zip(values.names, values.position)}}
        if all(name in self._measured for name in self._joint_names):
            self._has_measured.set()

    def _on_wrench(self, message: WrenchStamped) -> None:
        force, torque = message.wrench.force, message.wrench.torque
        wrench = (force.x, force.y, force.z, torque.x, torque.y, torque.z)
        self._wrench = wrench, time.monotonic()
