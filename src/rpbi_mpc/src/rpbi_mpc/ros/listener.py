"""Subscribes to the slider's pose and the robot's joint states, and returns the newest scene for the controller."""

from __future__ import annotations

import math
import threading
from collections import deque
from typing import NamedTuple

import numpy as np
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.transforms import yaw_of
from rpbi_mpc.node_configs import PlantConfig
from rpbi_mpc.pushing.hand import PlanarHand

SLACK_S = 1e-4
"""Difference below which two stamps count as equal [s]: less than a tick, more than rounding errors."""
TF = "/tf"
KEPT = 1000
"""Number of recent joint states that are stored."""


class SeenScene(NamedTuple):
    """Pose of the slider and position of the pusher at the time of the slider's newest pose.

    Attributes:
        stamp_s: Stamp of the slider's pose [s].
        values: x, y, yaw of the slider, and x, y of the pusher [m, rad].
    """

    stamp_s: float
    values: np.ndarray


class SceneListener:
    """Subscribes to the slider's pose from Vicon, and to the robot's joint states.

    Args:
        config: Names of the topics.
        hand: Kinematics of the hand, whose point is the pusher.
    """

    def __init__(self, config: PlantConfig, hand: PlanarHand) -> None:
        self._hand = hand
        self._warn = ThrottledWarning()
        self._changed = threading.Condition()
        self._pose: tuple[float, np.ndarray] | None = None
        self._joints: deque[tuple[float, np.ndarray]] = deque(maxlen=KEPT)
        self.vicon, self.joint_states = (rospy.resolve_name(name) for name in (config.vicon, config.joint_states))
        self._subscribe_to_poses()
        rospy.Subscriber(self.joint_states, JointState, self._on_joints, queue_size=100, tcp_nodelay=True)

    def joints(self) -> np.ndarray | None:
        """Returns the newest joint positions [rad]. None before the first joint states."""
        with self._changed:
            return self._joints[-1][1] if self._joints else None

    def scene(self) -> SeenScene | None:
        """Returns the slider's newest pose, and the pusher's position at that time. None before the first messages."""
        with self._changed:
            if self._pose is None or not self._joints:
                return None
            stamp_s, pose = self._pose
            _, joints = min(self._joints, key=lambda each: abs(each[0] - stamp_s))
        return SeenScene(stamp_s, np.array([*pose, *self._hand.position(joints)[:2]]))

    def _subscribe_to_poses(self) -> None:
        rospy.Subscriber(self.vicon, TransformStamped, self._on_pose, queue_size=100, tcp_nodelay=True)

    def _on_pose(self, message: TransformStamped) -> None:
        place, turn = message.transform.translation, message.transform.rotation
        pose = np.array([place.x, place.y, yaw_of((turn.x, turn.y, turn.z, turn.w))])
        if not np.isfinite(pose).all():
            self._warn(self.vicon, f"{self.vicon}: message refused: expected finite numbers, got {pose}")
            return
        with self._changed:
            if self._pose is None or message.header.stamp.to_sec() > self._pose[0]:
                self._pose = (message.header.stamp.to_sec(), pose)
            self._changed.notify_all()

    def _on_joints(self, message: JointState) -> None:
        positions = dict(zip(message.name, message.position))
        missing = [name for name in self._hand.joint_names if name not in positions]
        if missing:
            self._warn(
                self.joint_states, f"{self.joint_states}: message refused: expected {missing[0]}, got {message.name}"
            )
            return
        joints = np.array([positions[name] for name in self._hand.joint_names])
        if not np.isfinite(joints).all():
            self._warn(
                self.joint_states, f"{self.joint_states}: message refused: expected finite numbers, got {joints}"
            )
            return
        with self._changed:
            self._joints.append((message.header.stamp.to_sec(), joints))
            self._changed.notify_all()


class TickSceneListener(SceneListener):
    """Reads the slider's pose from TF instead of the tracker's topic.

    A simulator sends all poses of a tick in one TF message. If this message lacks the slider, the slider is hidden. On
    the tracker's topic, a hidden slider and a late message would look the same.

    Args:
        config: Names of the topics. The slider's TF frame has the name of the tracker's topic.
        hand: Kinematics of the hand, whose point is the pusher.
    """

    def __init__(self, config: PlantConfig, hand: PlanarHand) -> None:
        self._frame = config.vicon.lstrip("/")
        self._simulator = ""
        """Name of the node that sends the joint states; other nodes send TF, too."""
        self._sent_s: dict[str, float] = {}
        """Newest stamp on TF by node [s]."""
        super().__init__(config, hand)

    def wait_for_tick(self, time_s: float, timeout_s: float) -> str:
        """Waits until the joint states and the TF message of a tick have arrived.

        Args:
            time_s: Stamp of the tick [s].
            timeout_s: Longest wait, in wall time [s].

        Returns:
            Topics whose message is still missing, separated by commas. Empty if both messages have arrived.
        """
        with self._changed:
            self._changed.wait_for(lambda: not self._late(time_s), timeout_s)
            return ", ".join(self._late(time_s))

    def _late(self, time_s: float) -> list[str]:
        joints_s = self._joints[-1][0] if self._joints else -math.inf
        newest_s = {self.joint_states: joints_s, TF: self._sent_s.get(self._simulator, -math.inf)}
        return [topic for topic, stamp_s in newest_s.items() if stamp_s < time_s - SLACK_S]

    def _subscribe_to_poses(self) -> None:
        rospy.Subscriber(TF, TFMessage, self._on_transforms, queue_size=100, tcp_nodelay=True)

    def _on_transforms(self, message: TFMessage) -> None:
        for transform in message.transforms:
            if transform.child_frame_id == self._frame:
                self._on_pose(transform)
        sender = message._connection_header["callerid"]
        stamps_s = [each.header.stamp.to_sec() for each in message.transforms]
        with self._changed:
            self._sent_s[sender] = max([self._sent_s.get(sender, -math.inf), *stamps_s])
            self._changed.notify_all()

    def _on_joints(self, message: JointState) -> None:
        self._simulator = message._connection_header["callerid"]
        super()._on_joints(message)
