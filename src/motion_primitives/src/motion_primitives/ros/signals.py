"""Sources of demonstrations (TF or joint states), and outputs of executed motions (TF, joint targets or numbers)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header

from custom_ros_tools.ros.joint_states import JointStateSubscriber
from custom_ros_tools.ros.tf_interface import NO_ROTATION, TfInterface
from custom_ros_tools.transforms import Array
from motion_primitives.demonstration import Demonstration
from motion_primitives.dynamics import MotionState
from motion_primitives.node_configs import (
    FrameOutput,
    FrameSource,
    JointOutput,
    JointSource,
    OutputConfig,
    SignalOutput,
    SourceConfig,
)
from motion_primitives.space import Space
from rpbi_data import bag_to_dataframes

TF = "/tf"
QUEUE_SIZE = 10


class Source(Protocol):
    """Reads points of demonstrations from live ROS data or from a bag."""

    def poll(self) -> None:
        """Records a sample if a new transform is available. Called at the node's rate while recording."""

    def present(self) -> Array | None:
        """Returns the newest point; None before the first message."""

    def of_bag(self, path: str) -> Demonstration:
        """Reads a demonstration from a bag; raises an InterfaceError if the bag does not contain the signals."""


Record = Callable[[float, Array], None]
"""Function that is called with the time [s] and the point of each sample."""


class TfSource:
    """Source that reads the pose of a TF frame. A transform is a new sample only if its stamp has increased."""

    def __init__(self, config: FrameSource, tf: TfInterface, record: Record) -> None:
        self._config, self._tf, self._record = config, tf, record
        self._stamp = rospy.Time()

    def _point(self) -> tuple[rospy.Time, Array] | None:
        message = self._tf.get_tf_msg(self._config.parent, self._config.child)
        if message is None:
            return None
        position, quat_xyzw = self._tf.msg_to_pos_quat(message)
        point = np.concatenate([position, quat_xyzw]) if self._config.orientation else position
        return message.header.stamp, point

    def poll(self) -> None:
        """Records a sample if the transform is new, see `Source`."""
        found = self._point()
        if found is not None and found[0] > self._stamp:
            self._stamp = found[0]
            self._record(found[0].to_sec(), found[1])

    def present(self) -> Array | None:
        """Returns the newest point, see `Source`."""
        found = self._point()
        return None if found is None else found[1]

    def of_bag(self, path: str) -> Demonstration:
        """Reads a demonstration from a bag, see `Source`."""
        table = bag_to_dataframes(path, TF)[TF]
        return Demonstration.of_frame(table, self._config.parent, self._config.child, self._config.orientation)


class JointsSource:
    """Source that reads joint positions from every joint state message."""

    def __init__(self, config: JointSource, record: Record) -> None:
        self._config, self._record = config, record
        self._present: Array | None = None
        self._subscriber = JointStateSubscriber(config.topic, config.names, callback=self._on_state)

    def _on_state(self, message: JointState) -> None:
        stamp = message.header.stamp or rospy.Time.now()
        if message.position:
            point = np.array(message.position)
            self._present = point
            self._record(stamp.to_sec(), point)

    def poll(self) -> None:
        """Does nothing, since each joint state is recorded when its message arrives."""

    def present(self) -> Array | None:
        """Returns the newest point, see `Source`."""
        return self._present

    def of_bag(self, path: str) -> Demonstration:
        """Reads a demonstration from a bag, see `Source`."""
        topic = rospy.resolve_name(self._config.topic)
        return Demonstration.of_joints(bag_to_dataframes(path, topic)[topic], self._config.names)


def source_of(config: SourceConfig, tf: TfInterface, record: Record) -> Source:
    """Makes the configured source: TF or joints.

    Args:
        config: The configuration.
        tf: Interface to TF.
        record: Function that the source calls with each sample.
    """
    if config.joints is not None:
        return JointsSource(config.joints, record)
    assert config.tf is not None
    return TfSource(config.tf, tf, record)


Output = Callable[[MotionState], None]
"""Function that publishes the state of an executed motion."""


def outputs_of(config: OutputConfig, space: Space, tf: TfInterface) -> list[Output]:
    """Makes the configured outputs, see `OutputConfig`."""
    found: list[Output] = []
    if config.tf is not None:
        found.append(_frame(config.tf, tf))
    if config.joints is not None:
        found.append(_joints(config.joints, space))
    if config.signal is not None:
        found.append(_signal(config.signal))
    return found


def _frame(config: FrameOutput, tf: TfInterface) -> Output:
    def send(state: MotionState) -> None:
        quat_xyzw = state.point[3:] if len(state.point) > 3 else NO_ROTATION
        tf.set_tf(config.parent, config.child, state.point[:3], quat_xyzw)

    return send


def _joints(config: JointOutput, space: Space) -> Output:
    publisher = rospy.Publisher(config.topic, JointState, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def send(state: MotionState) -> None:
        header = Header(stamp=rospy.Time.now())
        publisher.publish(JointState(header, list(space.names), state.point.tolist(), state.velocity.tolist(), []))

    return send


def _signal(config: SignalOutput) -> Output:
    publisher = rospy.Publisher(config.topic, Float64MultiArray, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def send(state: MotionState) -> None:
        numbers = state.point if config.content == "position" else state.velocity
        publisher.publish(Float64MultiArray(data=np.asarray(numbers).tolist()))

    return send
