"""Topics of tracking systems, with the messages of their drivers' nodes."""

from apriltag_ros.msg import AprilTagDetection, AprilTagDetectionArray
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
)
from std_msgs.msg import Header

from rpbi.ros.endpoints import Topic
from rpbi.ros.headers import named_frame, prefixed, to_ros_time, world_frame
from rpbi.samples import AprilTagsSample, LinkPoseSample, ViconSample


def _vicon_message(sample: ViconSample, stamp_ns: int) -> TransformStamped:
    header = Header(stamp=to_ros_time(stamp_ns - sample.age_ns), frame_id=world_frame())
    transform = Transform(Vector3(*sample.pose.position), Quaternion(*sample.pose.quat_xyzw))
    return TransformStamped(header, prefixed(sample.frame), transform)


def _detections_message(sample: AprilTagsSample, stamp_ns: int) -> AprilTagDetectionArray:
    header = Header(stamp=to_ros_time(stamp_ns - sample.age_ns), frame_id=named_frame(sample.frame))
    message = AprilTagDetectionArray(header=header)
    for tag in sample.tags:
        pose = PoseWithCovariance(pose=Pose(Point(*tag.pose.position), Quaternion(*tag.pose.quat_xyzw)))
        message.detections.append(AprilTagDetection([tag.id], [tag.size], PoseWithCovarianceStamped(header, pose)))
    return message


def _vicon_on_tf(sample: ViconSample, stamp_ns: int) -> tuple[LinkPoseSample, int]:
    return LinkPoseSample(sample.name, (sample.frame,), (sample.pose,)), stamp_ns - sample.age_ns


VICON = Topic(
    "vicon/{name}",
    TransformStamped,
    _vicon_message,
    "Pose of a link in the world [m] as vicon_bridge reports it, on TF too; `hz` of a sensor `vicon`.",
    on_tf=_vicon_on_tf,
)
APRIL_TAGS = Topic(
    "tag_detections",
    AprilTagDetectionArray,
    _detections_message,
    "Tags that a camera sees, in its optical frame [m], as apriltag_ros reports them; `hz` of a sensor `april_tags`.",
)
