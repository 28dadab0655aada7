"""Publishes joint states and markers that contain the time of their sending on the computer's monotonic clock."""

from __future__ import annotations

import sys
import time

import genpy
import rospy
from geometry_msgs.msg import Point
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker

JOINTS = [f"lwr_arm_{index}_joint" for index in range(7)]
HZ = 1000
MARKER_TICKS = 97
"""Ticks from a marker to the next one, so that they come at all phases of a page's frames."""
LAP_S = 64.0
"""The position x of a marker is the time modulo this [s], which 32-bit numbers resolve to 4 us."""


def main() -> None:
    """Publishes on a topic of joint states and on one of markers. The first position is the message's number."""
    states_topic, marker_topic = sys.argv[1:3]
    rospy.init_node("stamped", disable_rostime=True, disable_signals=True)
    states = rospy.Publisher(states_topic, JointState, queue_size=1000)
    markers = rospy.Publisher(marker_topic, Marker, queue_size=10)
    marker = Marker(ns="time", type=Marker.CUBE)
    marker.header.frame_id, marker.color.a, marker.pose.orientation.w = "rpbi/world", 1.0, 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = 0.1
    message = JointState(name=JOINTS, position=[0.1] * 7, velocity=[0.2] * 7, effort=[0.3] * 7)
    start_s, tick = time.monotonic(), 0
    while True:
        tick += 1
        time.sleep(max(0.0, start_s + tick / HZ - time.monotonic()))
        message.position[0] = float(tick)
        message.header.stamp = genpy.Time(*divmod(time.monotonic_ns(), 1_000_000_000))
        states.publish(message)
        if tick % MARKER_TICKS == 0:
            marker.pose.position = Point(time.monotonic() % LAP_S, 0.0, 0.0)
            markers.publish(marker)


if __name__ == "__main__":
    main()
