"""The topics of this package's objects and sensors; `{name}` is the object, or `BODY/NAME` of a sensor."""

import math

from sensor_msgs.msg import Range
from std_msgs.msg import Float64

from rpbi.ros.endpoints import Topic
from rpbi.ros.headers import prefixed, to_ros_time

from ..range_finder import RangeSample


def _range_message(sample: RangeSample, stamp_ns: int) -> Range:
    """Returns the message; nothing in range is infinity, as REP 117 has it."""
    message = Range(radiation_type=Range.INFRARED, max_range=sample.max_range)
    message.range = math.inf if sample.distance is None else sample.distance
    message.header.stamp = to_ros_time(stamp_ns)
    message.header.frame_id = prefixed(f"rpbi/{sample.name}")
    return message


RANGE = Topic("rpbi/{name}/range", Range, _range_message)
SPEED = Topic("rpbi/{name}/speed", Float64, lambda message: message.data)
