"""Publishes camera images in ROS, as a separate node in the renderer process."""

import sys
import time
import warnings
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import rosgraph
import rospy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from std_msgs.msg import Header

from custom_ros_tools.ros.lifecycle.run_node import init_node
from custom_ros_tools.ros.rospy_internals import RecorderQueues
from rpbi.render.camera import PointCloud
from rpbi.render.frame import Camera, Demand, Frame
from rpbi.ros.headers import to_ros_time
from rpbi.ros.state_topic import StateTopic

from .topics import camera_info, camera_topics, cloud_message, compressed_message, image_message

SINK = "rpbi.ros.cameras.image_publisher:ImagePublisher"

warnings.filterwarnings("ignore", "The publisher should be created", SyntaxWarning)  # None is meant: rospy then waits
QUEUE_SIZE = 2
"""Largest number of images buffered for a subscriber, so that a stopped subscriber does not fill the memory."""
RECORDER_QUEUE_SIZE = 100
"""Largest number of images buffered for a recorder, the same as in `rosbag record`."""
LONGEST_WAIT_S = 5.0
"""Longest wait [s] for the connections of subscribers that are registered at the ROS master."""


class ImagePublisher:
    """Publishes the images of all cameras; topics without subscribers are skipped."""

    def __init__(self) -> None:
        # Without ROS time, since the node must never wait for /clock; the frames contain their stamps.
        init_node("rpbi_camera", ros_time=False)
        self._cameras: dict[str, _CameraTopics] = {}

    def add(self, camera: Camera) -> None:
        """Advertises a camera's topics; for a synchronous camera, waits until existing subscribers have connected."""
        topics = self._cameras[camera.name] = _CameraTopics(camera)
        if camera.synchronous:
            topics.wait_for_subscribers()

    def remove(self, name: str) -> None:
        """Unregisters the topics of a camera."""
        self._cameras.pop(name).close()

    def demands(self) -> Mapping[str, Demand]:
        """Returns the demand for each camera's images, indexed by camera name.

        Raises:
            SystemExit: If the node was shut down from outside, for instance by `rosnode kill`.
        """
        if rospy.is_shutdown():
            sys.exit(f"{rospy.get_name()} was shut down")
        return {name: topics.demand() for name, topics in self._cameras.items()}

    def write(self, frame: Frame) -> None:
        """Publishes the images of a frame on the topics of its camera."""
        self._cameras[frame.camera.name].publish(frame)

    def close(self) -> None:
        """Shuts down the node, which unregisters it from the ROS master."""
        rospy.signal_shutdown("the simulator has ended")


def camera_node(simulator: str) -> str:
    """Returns the name of the node that publishes the images: the simulator's node name, followed by `_camera`."""
    return f"{simulator}_camera"


def sink_arguments(node_name: str, argv: Sequence[str]) -> list[str]:
    """Returns the command-line arguments of the renderer process.

    The arguments are the simulator's remappings, the simulator's namespace, and the node name that `camera_node`
    returns.

    Args:
        node_name: The simulator's resolved node name.
        argv: The simulator's command-line arguments, including remappings.
    """
    remappings = [item for item in argv if ":=" in item and not item.startswith(("__name:=", "__log:=", "_"))]
    namespace = [item for item in argv if item.startswith("__ns:=")]
    return [*remappings, *namespace, f"__name:={camera_node(node_name.rsplit('/', 1)[-1])}"]


class _Topic(StateTopic):
    """A topic that counts all subscribers that have ever connected.

    Args:
        waits: Whether `publish` waits until the message is sent; if not, messages are buffered.
    """

    def __init__(self, topic: str, message_type: type, waits: bool) -> None:
        self.seen = 0
        super().__init__(topic, message_type, None if waits else QUEUE_SIZE)
        self._queues = None if waits else RecorderQueues(self._publisher, RECORDER_QUEUE_SIZE)

    def publish(self, message: Any) -> None:
        if self._queues is not None:
            self._queues.extend()
        super().publish(message)

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        super().peer_subscribe(topic_name, topic_publish, peer_publish)
        self.seen += 1

    def subscriber_count(self) -> int:
        """Returns the number of subscribers that are connected now."""
        count: int = self._publisher.get_num_connections()
        return count


class _CameraTopics:
    """The topics of one camera."""

    def __init__(self, camera: Camera) -> None:
        self._frame_id = camera.frame_id
        self._info = camera_info(camera)
        self._cloud = PointCloud(camera.intrinsics) if camera.pointcloud else None
        self._topics: dict[str, tuple[str, _Topic]] = {
            name: (stream, _Topic(name, topic.message_type, camera.synchronous))
            for name, (stream, topic) in camera_topics(camera.topic_name, camera.pointcloud).items()
        }
        self._published_ns = -1

    def wait_for_subscribers(self) -> None:
        """Waits at most `LONGEST_WAIT_S` until all subscribers that are registered at the ROS master have connected.

        The wait is limited, since registered subscribers may have ended.
        """
        registered = dict(rosgraph.Master(rospy.get_name()).getSystemState()[1])
        end_s = time.monotonic() + LONGEST_WAIT_S
        for name, (_, topic) in self._topics.items():
            expected = len(registered.get(rospy.resolve_name(name), ()))
            while topic.subscriber_count() < expected and time.monotonic() < end_s:
                time.sleep(0.01)

    def demand(self) -> Demand:
        """Returns the streams that have subscribers, and the number of subscribers that have ever connected."""
        topics = self._topics.values()
        streams = frozenset(stream for stream, topic in topics if topic.has_subscribers)
        return Demand(streams, sum(topic.seen for _, topic in topics))

    def publish(self, frame: Frame) -> None:
        """Publishes a frame's images. If the last frame had the same stamp, sends to later subscribers only."""
        header = Header(stamp=to_ros_time(frame.stamp_ns), frame_id=self._frame_id)
        again = frame.stamp_ns == self._published_ns
        for stream, topic in self._topics.values():
            if not topic.has_subscribers:
                continue
            message = self._message(stream, frame, header)
            if message is None:
                continue  # the stream's first subscriber connected after drawing had started
            if again:
                topic.serve_late(partial(lambda late: late, message))
            else:
                topic.publish(message)
        self._published_ns = frame.stamp_ns

    def close(self) -> None:
        """Unregisters the topics."""
        for _, topic in self._topics.values():
            topic.close()

    def _message(
        self, stream: str, frame: Frame, header: Header
    ) -> CameraInfo | CompressedImage | Image | PointCloud2 | None:
        if stream == "info":
            self._info.header = header
            return self._info
        if stream == "points":
            if self._cloud is None or frame.depth is None or frame.colour is None:
                return None
            return cloud_message(self._cloud.of(frame.depth, frame.colour), header)
        if stream == "jpeg":
            return compressed_message(frame, header)
        return image_message(stream, frame, header)
