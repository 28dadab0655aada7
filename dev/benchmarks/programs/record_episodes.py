"""Records one episode after the other, of the lengths [s] in wall time that its argument lists as JSON."""

import json
import sys
import time

import rospy
from cob_srvs.srv import SetString
from std_srvs.srv import Trigger

rospy.init_node("record_episodes", disable_rostime=True)
services = {name: rospy.ServiceProxy(f"record/{name}", Trigger) for name in ("start", "stop")}
label = rospy.ServiceProxy("record/label", SetString)
rospy.wait_for_service("record/start")
time.sleep(2.0)  # the scene has begun to move
for index, length_s in enumerate(json.loads(sys.argv[1])):
    for name, wait_s in (("start", length_s), ("stop", 0.0)):
        answer = services[name]()
        if not answer.success:
            sys.exit(f"episode {index}: {name}: {answer.message}")
        time.sleep(wait_s)
    label("success" if index % 2 else "failure")
