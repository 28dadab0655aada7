"""Has the running simulator make keyframes; prints how long it paused for each [s], and the load average.

The simulator logs that at the level DEBUG. Argument: number of keyframes.
"""

import json
import os
import queue
import re
import sys
import time

import rospy
from cob_srvs.srv import SetString
from roscpp.srv import SetLoggerLevel
from rosgraph_msgs.msg import Log

BETWEEN_S = 0.5
NODE = "ros_pybullet_interface"
TIMEOUT_S = 60.0


def main() -> None:
    pauses: queue.Queue[float] = queue.Queue()

    def note(log: Log) -> None:
        if found := re.search(r"keyframe at tick \d+: its longest part took (\S+) s", log.msg):
            pauses.put(float(found[1]))

    rospy.init_node("keyframe_often", anonymous=True, disable_rostime=True)
    rospy.Subscriber("/rosout", Log, note)
    rospy.wait_for_service("rpbi/save_keyframe", TIMEOUT_S)
    save = rospy.ServiceProxy("rpbi/save_keyframe", SetString)
    set_level = rospy.ServiceProxy(f"{NODE}/set_logger_level", SetLoggerLevel)
    for logger in ("rpbi", "rosout"):
        set_level(logger, "DEBUG")
    while pauses.empty():  # until the log of the simulator is received
        _save(save)
    longest = []
    for _ in range(int(sys.argv[1])):
        time.sleep(BETWEEN_S)
        while not pauses.empty():
            pauses.get()
        _save(save)
        longest.append(pauses.get(timeout=TIMEOUT_S))
    print(f"result: {json.dumps({'pauses': longest, 'load': os.getloadavg()[0]})}")


def _save(save: rospy.ServiceProxy) -> None:
    answer = save("keyframe_often.world")
    assert answer.success, answer


if __name__ == "__main__":
    main()
