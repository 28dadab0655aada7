"""The node that publishes camera images, inside the renderer process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import rospy
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from ..render.frame import Camera, Demand, Frame
from .camera_topics import CAMERA_TOPICS, CameraTopic, camera_prefix
from .stamps import to_ros_time
from .topics import StateTopic

SINK = "rpbi.ros.image_sink:ImageSink"

QUEUE_SIZE = 2
"""Images kept for a slow subscriber: a stopped one must not fill the memory."""


class ImageSink:
    """Publishes frames on the topics of each camera, and only those that somebody subscribes to.

    Args:
        cameras: The cameras, the first one first.
    """

    def __init__(self, cameras: Sequence[Camera]) -> None:
        # Without ROS time, since it must never wait for the clock: stamps come with the frames.
        rospy.init_node("rpbi_camera", disable_rostime=True, disable_signals=True)
        self._cameras = {
            camera.name: _CameraTopics(camera, camera_prefix(camera.name, index))
            for index, camera in enumerate(cameras)
        }

    def demands(self) -> Mapping[str, Demand]:
        """Returns what is subscribed to, by camera."""
        return {name: topics.demand() for name, topics in self._cameras.items()}

    def write(self, frame: Frame) -> None:
        """Publishes a frame."""
        self._cameras[frame.camera.name].publish(frame)

    def close(self) -> None:
        """Takes leave of the ROS master."""
        rospy.signal_shutdown("the simulator has ended")


def sink_arguments(node_name: str, argv: Sequence[str]) -> list[str]:
    """Returns the arguments with which the renderer process is the simulator's companion.

    Args:
        node_name: The simulator's resolved node name.
        argv: The simulator's own arguments, remappings included.

    Returns:
        Its remappings, but the name of the node is its name with `_camera` after it.
    """
    remappings = [item for item in argv if ":=" in item and not item.startswith(("__name:=", "__log:=", "_"))]
    namespace = [item for item in argv if item.startswith("__ns:=")]
    return [*remappings, *namespace, f"__name:={node_name.rsplit('/', 1)[-1]}_camera"]


class _Topic(StateTopic):
    """A topic that also counts who has ever come."""

    def __init__(self, topic: str, message_type: type) -> None:
        self.seen = 0
        super().__init__(topic, message_type, queue_size=QUEUE_SIZE)

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        super().peer_subscribe(topic_name, topic_publish, peer_publish)
        self.seen += 1


class _CameraTopics:
    """The topics of one camera."""

    def __init__(self, camera: Camera, prefix: str) -> None:
        self._frame_id = camera.frame_id
        self._info = camera_info(camera)
        self._topics: list[tuple[CameraTopic, _Topic]] = [
            (topic, _Topic(f"{prefix}/{topic.suffix}", topic.message_type)) for topic in CAMERA_TOPICS
        ]
        self._published_ns = -1

    def demand(self) -> Demand:
        """Returns what is subscribed to."""
        streams = frozenset(topic.stream for topic, ros_topic in self._topics if ros_topic.has_subscribers)
        return Demand(streams, sum(ros_topic.seen for _, ros_topic in self._topics))

    def publish(self, frame: Frame) -> None:
        """Publishes a frame; one with the last stamp again goes only to who has come since."""
        header = Header(stamp=to_ros_time(frame.stamp_ns), frame_id=self._frame_id)
        self._info.header = header
        again = frame.stamp_ns == self._published_ns
        messages: dict[str, Image | CameraInfo] = {"info": self._info}
        for topic, ros_topic in self._topics:
            if not ros_topic.has_subscribers:
                continue
            message = messages.get(topic.stream) or image_message(topic.stream, frame, header)
            if message is None:
                continue  # its first subscriber came while the frame was drawn
            if again:
                ros_topic.serve_late(lambda late=message: late)
            else:
                ros_topic.publish(message)
        self._published_ns = frame.stamp_ns


def camera_info(camera: Camera) -> CameraInfo:
    """Returns what ROS has to know of a camera that distorts nothing."""
    info = CameraInfo(width=camera.intrinsics.width_px, height=camera.intrinsics.height_px)
    K = camera.intrinsics.K
    info.K = K.ravel().tolist()
    info.distortion_model = "plumb_bob"
    info.D = [0.0] * 5
    info.R = np.eye(3).ravel().tolist()
    info.P = np.hstack([K, np.zeros((3, 1))]).ravel().tolist()
    return info


def image_message(stream: str, frame: Frame, header: Header) -> Image | None:
    """Returns an image of a frame as a message, None if the frame has none of it.

    Args:
        stream: `colour` (rgb8), `depth` (32FC1, metres) or `segmentation` (mono16, 65535 where nothing is).
        frame: The frame.
        header: Stamp and frame of the message.
    """
    if stream == "colour":
        encoding, pixels = "rgb8", frame.colour
    elif stream == "depth":
        encoding, pixels = "32FC1", frame.depth
    else:
        encoding, pixels = "mono16", _as_mono16(frame.segmentation)
    if pixels is None:
        return None
    height, width = pixels.shape[:2]
    image = Image(header=header, height=height, width=width, encoding=encoding, is_bigendian=0)
    image.step = pixels.nbytes // height
    image.data = pixels.tobytes()
    return image


def _as_mono16(body_ids: npt.NDArray[np.int32] | None) -> npt.NDArray[np.uint16] | None:
    return None if body_ids is None else body_ids.astype(np.uint16)  # -1 becomes 65535
