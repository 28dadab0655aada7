"""The box that is pushed: adds and removes it, and looks up its pose."""

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
"""Time for which the box has to be at rest, and longest time until it is [s]."""
REST_M = 0.0005
"""Distance by which a box at rest may move meanwhile [m]."""
POLL_S = 0.05


class PushedBox:
    """The box that is pushed.

    Attributes:
        is_there: Whether it is in the world.
    """

    def __init__(self, tf: TfInterface) -> None:
        self._tf = tf
        self.is_there = False

    def drop(self) -> None:
        """Adds the box above the floor, and waits until it is at rest.

        Raises:
            InterfaceError: If it cannot be added, or does not come to rest.
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
        """Removes the box, if it is in the world."""
        if self.is_there:
            call_service("rpbi/remove_pybullet_object", SetString, NAME)
            self.is_there = False

    def error(self) -> BoxError:
        """Returns its present error from the goal."""
        return BoxError.of(*TfInterface.msg_to_pos_quat(self._pose_in(GOAL)))

    def _pose_in(self, frame: str) -> TransformStamped:
        """Returns its pose in a frame, not older than this call, since TF keeps poses of an earlier box."""
        now = rospy.Time.now()
        while (message := self._tf.wait_for_tf_msg(frame, FRAME)) is None or message.header.stamp < now:
            time.sleep(POLL_S)
        return message
