"""Throws a box into the world again and again."""

import rospy
from cob_srvs.srv import SetString

from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.services import get_srv_handler
from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import AddPybulletObject

BOX = "{rpbi_examples}/configs/pybullet_objects_example/box.yaml"
NAME = "box"
STAY_S = 3.0
"""Time for which each box stays [s] of ROS time."""


def main() -> None:
    """Runs the node."""
    run_node("pybullet_objects_example", _throw_boxes)


def _throw_boxes() -> None:
    add = get_srv_handler("rpbi/add_pybullet_object", AddPybulletObject)
    remove = rospy.ServiceProxy("rpbi/remove_pybullet_object", SetString)
    box = PybulletObject(object_type=PybulletObject.DYNAMIC, filename=BOX)
    while not rospy.is_shutdown():
        try:
            answer = add(box)
            if not answer.success:
                rospy.logwarn("the box was refused: %s", answer.message)
            rospy.sleep(STAY_S)
            remove(NAME)
        except rospy.ServiceException as error:
            rospy.logwarn("the simulator does not answer: %s", error)
            rospy.sleep(STAY_S)
