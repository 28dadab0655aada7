"""A node that, once a file is there, opens topics and services, closes others and logs; its argument is the file."""

from __future__ import annotations

import sys
from pathlib import Path

import rospy
from std_msgs.msg import Empty
from std_srvs.srv import Trigger, TriggerResponse

from custom_ros_tools.ros.lifecycle.master_watch import MasterWatch
from custom_ros_tools.ros.lifecycle.parameters import kept_parameters

rospy.init_node("busy")
MasterWatch()


def _open(name: str) -> tuple[rospy.Publisher, rospy.Service]:
    kept_parameters.set(f"{name}_parameter", 1)
    service = rospy.Service(f"{name}_too", Trigger, lambda _: TriggerResponse())
    return rospy.Publisher(name, Empty, queue_size=1), service


publisher, service = _open("old")
subscriber = rospy.Subscriber("heard", Empty)  # opening one later would wait for a master that hangs
print("ready", flush=True)
while not Path(sys.argv[1]).exists() and not rospy.is_shutdown():
    rospy.rostime.wallsleep(0.05)
publisher.unregister()
subscriber.unregister()
service.shutdown()
kept_parameters.delete("old_parameter")
new = _open("new")
rospy.logwarn("it logs")
print("done", flush=True)
rospy.spin()
