"""`avatar_node.py`: converts a person's segment poses to an avatar's joint targets and base pose (on TF)."""

import threading
import time
from typing import Annotated

import numpy as np
import rospy
from geometry_msgs.msg import PoseArray
from pydantic import Field
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger, TriggerResponse

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.schema import ConfigModel, FrameId, Name, Positive, Seconds
from operator_node.mvn.frame_messages import frame_in
from operator_node.mvn.segments import SegmentFrame

from .human_urdf import urdf_offsets
from .joints import HINGES
from .retargeting import AvatarPlace, AvatarPose, Engagement, Retargeting

Place3 = Annotated[tuple[float, float, float], Field(strict=False)]
SEGMENTS_TOPIC = "mvn/segments"
START_PATIENCE_S = 5.0
"""Time after the start from which missing joint states of the avatar cause warnings [s]."""
LOOKS_HZ = 20.0
"""Rate of the check whether segments still arrive [Hz]."""


class AvatarParameters(ConfigModel):
    """Private parameters of `avatar_node.py`."""

    robot_name: Name = Field("human", description="Name of the avatar: a simulated robot with the joints of a person.")
    parent_frame_id: FrameId = Field(
        "rpbi/world", description="TF frame in which the poses of the person's segments are given."
    )
    base_frame_id: FrameId = Field("human/base", description="TF frame that the avatar's base follows.")
    place: Place3 | None = Field(
        None, description="Initial place of the avatar: x, y [m], yaw [rad]. By default, the place of the person."
    )
    input_timeout_s: Seconds = Field(
        0.5, description="Time without segment poses after which a warning reports that the avatar holds its pose."
    )
    max_joint_speed: Positive = Field(10.0, description="Largest speed of each joint [rad/s].")
    max_speed: Positive = Field(3.0, description="Largest speed of the pelvis [m/s].")
    max_angular_speed: Positive = Field(6.0, description="Largest angular speed of the pelvis [rad/s].")


class AvatarNode:
    """Makes an avatar follow the motion of a person, as long as messages with the person's segment poses arrive.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        self._config = config = private_parameters(AvatarParameters)
        self._retargeting: Retargeting | None = None
        self._engagement = Engagement(config.max_joint_speed, config.max_speed, config.max_angular_speed)
        self._tf = TfInterface()
        self._warn = ThrottledWarning()
        self._lock = threading.Lock()
        self._hinges: np.ndarray | None = None
        """Angles of the avatar's hinges in the simulator [rad]; None before the first joint state."""
        self._begins, self._last_s, self._holds = True, 0.0, True
        self._began_s, self._last_stamp = time.monotonic(), rospy.Time()
        self._states = f"rpbi/{config.robot_name}/joint_states"
        self._targets = rospy.Publisher(f"{self._states}/target", JointState, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber(self._states, JointState, self._on_state, queue_size=1)
        rospy.Subscriber(SEGMENTS_TOPIC, PoseArray, self._on_segments, queue_size=1, tcp_nodelay=True)
        rospy.Service("avatar/engage", Trigger, self._engage)
        WallTimer(LOOKS_HZ, self._look)

    def _on_state(self, message: JointState) -> None:
        positions = dict(zip(message.name, message.position))
        hinges = [positions.get(hinge) for hinge in HINGES]
        if None in hinges:
            reason = f"it lacks the joint '{HINGES[hinges.index(None)]}' of a person"
        elif not np.isfinite(numbers := np.array(hinges, dtype=float)).all():
            reason = "a position is not finite"
        else:
            self._hinges = numbers
            return
        self._warn(rospy.resolve_name(self._states), f"message refused: {reason}")

    def _on_segments(self, message: PoseArray) -> None:
        with self._lock:
            try:
                self._follow(frame_in(message))
            except (ValueError, InterfaceError, OSError) as error:  # OSError: the ROS master was lost
                self._warn(rospy.resolve_name(SEGMENTS_TOPIC), f"message refused: {error}")

    def _follow(self, frame: SegmentFrame) -> None:
        now = rospy.Time.now()
        if now < self._last_stamp:  # the simulation was restarted
            self._begins, self._last_stamp = True, rospy.Time()
        if now <= self._last_stamp:
            return  # simulated time is paused, or has not begun: TF with wall time would hide all later transforms
        if self._hinges is None and time.monotonic() - self._began_s < START_PATIENCE_S:
            return
        if self._begins or self._retargeting is None:
            self._begin(frame)
            self._last_stamp = now  # the first target is the present pose of the avatar
        assert self._retargeting is not None
        target = self._retargeting.pose(frame)
        if self._holds:
            rospy.loginfo("the avatar follows %s", rospy.resolve_name(SEGMENTS_TOPIC))
        self._publish(self._engagement.step(target, (now - self._last_stamp).to_sec()), now)
        self._last_stamp, self._last_s, self._holds = now, time.monotonic(), False

    def _begin(self, frame: SegmentFrame) -> None:
        """Starts to follow a person from the present pose of the avatar.

        Raises:
            ValueError: If no joint state of the avatar has arrived yet, or the person's legs are too short or long.
        """
        name, place = self._config.robot_name, self._config.place
        if self._hinges is None:
            raise ValueError(f"no message on {rospy.resolve_name(self._states)} yet: is the avatar in the world?")
        parameter = rospy.resolve_name(f"rpbi/{name}/robot_description")
        offsets = urdf_offsets(parameter, rospy.get_param(parameter, ""))
        self._retargeting = Retargeting(offsets, None if place is None else AvatarPlace(*place))
        self._retargeting.begin(self._hinges)
        target = self._retargeting.pose(frame)
        position, quat = self._tf.get_tf(self._config.parent_frame_id, f"rpbi/{name}/Pelvis")
        if position is None or quat is None:
            position, quat = target.position, target.quat_xyzw
        self._engagement.begin(AvatarPose(position, quat, self._hinges))
        self._begins = False

    def _publish(self, pose: AvatarPose, now: rospy.Time) -> None:
        target = JointState(name=HINGES, position=pose.hinges.tolist())
        target.header.stamp = now
        self._targets.publish(target)
        base = self._tf.pack_tf_msg(
            self._config.parent_frame_id, self._config.base_frame_id, pose.position, pose.quat_xyzw
        )
        base.header.stamp = now
        self._tf.tf_broadcaster.sendTransform(base)

    def _look(self) -> None:
        with self._lock:
            if not self._holds and time.monotonic() - self._last_s > self._config.input_timeout_s:
                self._holds = True
                silence = f"no message for {self._config.input_timeout_s:g} s"
                rospy.logwarn("%s: %s; the avatar holds its last pose", rospy.resolve_name(SEGMENTS_TOPIC), silence)

    def _engage(self, _: object) -> TriggerResponse:
        """Service callback: the next motion-capture frame restarts the mapping from the avatar's present pose."""
        with self._lock:
            self._begins = True
        return TriggerResponse(True, "the avatar restarts with the next segments")


def main() -> None:
    """Runs the node."""
    run_node("avatar", AvatarNode)
