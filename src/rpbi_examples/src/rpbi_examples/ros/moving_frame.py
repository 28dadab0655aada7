"""A TF frame that moves by a function of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import rospy

from custom_ros_tools.ros.master_watch import MasterWatch
from custom_ros_tools.ros.tf_interface import TfInterface

HZ = 50.0

NO_ROTATION = (0.0, 0.0, 0.0, 1.0)


def move_frame(
    parent: str, child: str, pose: Callable[[float], tuple[Sequence[float], Sequence[float]]]
) -> None:
    """Broadcasts a frame until ROS shuts down.

    Args:
        parent: The frame that it is in.
        child: Its name.
        pose: Position [m] and orientation (x, y, z, w) at a time since the start [s] of ROS time.
    """
    MasterWatch()
    tf = TfInterface()
    start = last = rospy.Time.now()
    rate = rospy.Rate(HZ)
    try:
        while not rospy.is_shutdown():
            now = rospy.Time.now()
            if now > last:  # TF warns of a stamp that comes twice
                message = tf.pack_tf_msg(parent, child, *pose((now - start).to_sec()))
                message.header.stamp = last = now
                tf.tf_broadcaster.sendTransform(message)
            rate.sleep()
    except rospy.ROSInterruptException:
        pass  # Ctrl-C
