"""Topics of a camera, and functions that convert camera frames to messages."""

import io
from typing import Any

import numpy as np
import numpy.typing as npt
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2, PointField
from std_msgs.msg import Header

from rpbi.render.frame import Camera, Frame
from rpbi.ros.endpoints import Topic

JPEG_QUALITY = 80
"""JPEG quality of colour images, from 1 to 95; the default of image_transport."""
IMAGE_TOPICS = (
    ("colour", Topic("rpbi/{name}/colour/image", Image, meaning="Colour, `rgb8`.")),
    (
        "jpeg",
        Topic(
            "rpbi/{name}/colour/image/compressed",  # by the rule of image_transport
            CompressedImage,
            meaning="Colour as JPEG for networks, with about 2 % of the bytes.",
        ),
    ),
    (
        "depth",
        Topic(
            "rpbi/{name}/depth/image",
            Image,
            meaning="Distance along the optical axis, `32FC1` [m]; the far limit of `range` where there is no body.",
        ),
    ),
    (
        "segmentation",
        Topic(
            "rpbi/{name}/segmentation",
            Image,
            meaning="PyBullet's ids of the bodies, `mono16`; 65535 where there is no body.",
        ),
    ),
    ("info", Topic("rpbi/{name}/colour/camera_info", CameraInfo, meaning="Intrinsics of the colour image.")),
    ("info", Topic("rpbi/{name}/depth/camera_info", CameraInfo, meaning="Intrinsics of the depth image.")),
    # By the rule of image_transport
    ("info", Topic("rpbi/{name}/camera_info", CameraInfo, meaning="Intrinsics of the segmentation.")),
)
"""Topics that every camera has, each with its stream (see `render.frame.Demand`)."""
CLOUD_TOPIC = (
    "points",
    Topic(
        "rpbi/{name}/pointcloud",
        PointCloud2,
        meaning="Points `x`, `y`, `z` [m] in the optical frame and `rgb`, one per pixel, NaN where there is no body; "
        "with `pointcloud`.",
    ),
)


def camera_topics(topic_name: str, pointcloud: bool) -> dict[str, tuple[str, Topic]]:
    """Returns a pair of stream and topic for each topic of a camera, indexed by the topic's ROS name.

    Args:
        topic_name: Name of the camera within the names of topics.
        pointcloud: Whether the camera has a point cloud topic.
    """
    rows = (*IMAGE_TOPICS, CLOUD_TOPIC) if pointcloud else IMAGE_TOPICS
    return {topic.name.format(name=topic_name): (stream, topic) for stream, topic in rows}


def camera_info(camera: Camera) -> CameraInfo:
    """Returns the CameraInfo of a camera without distortion."""
    info = CameraInfo(width=camera.intrinsics.width_px, height=camera.intrinsics.height_px)
    K = camera.intrinsics.K
    info.K = K.ravel().tolist()
    info.distortion_model = "plumb_bob"
    info.D = [0.0] * 5
    info.R = np.eye(3).ravel().tolist()
    info.P = np.hstack([K, np.zeros((3, 1))]).ravel().tolist()
    return info


def image_message(stream: str, frame: Frame, header: Header) -> Image | None:
    """Converts one image of a camera frame to a message; returns None if the frame lacks the image.

    Args:
        stream: Which image: `colour` (rgb8), `depth` (32FC1 [m]) or `segmentation` (mono16; 65535 for background).
        frame: The camera frame.
        header: Header of the message.
    """
    pixels: npt.NDArray[Any] | None
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


def compressed_message(frame: Frame, header: Header) -> CompressedImage | None:
    """Converts the colour image of a camera frame to a JPEG message; returns None if the frame has no colour image."""
    if frame.colour is None:
        return None
    from PIL import Image as Picture  # slow to import, and seldom used

    data = io.BytesIO()
    Picture.fromarray(frame.colour).save(data, "JPEG", quality=JPEG_QUALITY)
    return CompressedImage(header, "rgb8; jpeg compressed bgr8", data.getvalue())


def cloud_message(points: npt.NDArray[np.float32], header: Header) -> PointCloud2:
    """Converts the points of an image to an organised point cloud, with one point for each pixel.

    Args:
        points: x, y, z [m] and packed colour of each pixel, shape (height, width, 4); x, y, z are NaN for background.
        header: Header of the message.
    """
    height, width = points.shape[:2]
    fields = [PointField(name, 4 * index, PointField.FLOAT32, 1) for index, name in enumerate(("x", "y", "z", "rgb"))]
    cloud = PointCloud2(header=header, height=height, width=width, fields=fields, is_bigendian=False, is_dense=False)
    cloud.point_step = 4 * points.itemsize
    cloud.row_step = width * cloud.point_step
    cloud.data = points.tobytes()
    return cloud


def _as_mono16(body_ids: npt.NDArray[np.int32] | None) -> npt.NDArray[np.uint16] | None:
    return None if body_ids is None else body_ids.astype(np.uint16)  # -1 becomes 65535
