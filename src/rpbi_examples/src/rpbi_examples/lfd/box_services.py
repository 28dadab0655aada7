"""Adds and removes the box that is pushed, and looks up the box's pose."""

from __future__ import annotations

import math
import time

import rospy
from cob_srvs.srv import SetString
from geometry_msgs.msg import TransformStamped

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.services import call_service
from custom_ros_tools.ros.tf_interface import TfInterface
from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import AddPybulletObject

from .arm_topics import ORIGIN, planar
from .report import BoxError

FILE, NAME = "{rpbi_examples}/configs/lfd/box.yaml", "pushing_box"
FRAME, GOAL = f"rpbi/{NAME}", "rpbi/visual_goal"
REST_S, MAX_DROP_S = 0.5, 5.0
"""Time for which the dropped box must be at rest, and timeout of the whole drop [s]."""
REST_M = 0.0005
"""Distance by which the box may move in `REST_S` and still count as at rest [m]."""
POLL_S = 0.05


class PushedBox:
    """Adds and removes the box that is pushed, and measures the box's distance from the goal.

    Args:
        tf: Access to TF.

    Attributes:
        is_there: Whether the box is in the world.
    """

    def __init__(self, tf: TfInterface) -> None:
        self._tf = tf
        self.is_there = False

    def drop(self) -> None:
        """Adds the box above the floor, and waits until the box is at rest.

        Raises:
            InterfaceError: If the box cannot be added, or does not come to rest within `MAX_DROP_S`.
        """
        box = PybulletObject(object_type=PybulletObject.DYNAMIC, filename=FILE)
        call_service("rpbi/add_pybullet_object", AddPybulletObject, box)
        self.is_there = True
        last = planar(self._pose_in(ORIGIN))
        begin_s = still_s = rospy.get_time()
        while rospy.get_time() - still_s < REST_S:
            if rospy.get_time() - begin_s > MAX_DROP_S:
                raise InterfaceError(f"the box does not lie still after {MAX_DROP_S:g} s")
            rospy.sleep(POLL_S)
            pose = planar(self._pose_in(ORIGIN))
            if math.hypot(pose.x - last.x, pose.y - last.y) > REST_M:
                still_s, last = rospy.get_time(), pose

    def remove(self) -> None:
        """Removes the box if the box is in the world."""
        if self.is_there:
            call_service("rpbi/remove_pybullet_object", SetString, NAME)
            self.is_there = False

    def error(self) -> BoxError:
        """Returns the present distance and angle of the box from its goal."""
        return BoxError.of(*TfInterface.msg_to_pos_quat(self._pose_in(GOAL)))

    def _pose_in(self, frame: str) -> TransformStamped:
        """Waits for a pose of the box that is newer than this call, and returns the pose in a frame. Older poses may
        belong to an earlier box.
        """
        now = rospy.Time.now()
        while (message := self._tf.wait_for_tf_msg(frame, FRAME)) is None or message.header.stamp < now:
            time.sleep(POLL_S)
        return message
