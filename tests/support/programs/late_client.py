"""A client that comes late: waits for a transform with tf2, then sleeps in ROS time, and says so."""

import sys

import rospy
import tf2_ros

rospy.init_node("late_client", anonymous=True)
print("initialised", flush=True)
buffer = tf2_ros.Buffer()
listener = tf2_ros.TransformListener(buffer)
frame = sys.argv[1]
while not buffer.can_transform("rpbi/world", frame, rospy.Time(0)):
    rospy.rostime.wallsleep(0.02)
print("transform", buffer.lookup_transform("rpbi/world", frame, rospy.Time(0)).header.stamp.to_nsec(), flush=True)
rospy.sleep(0.03)
print("slept", flush=True)
