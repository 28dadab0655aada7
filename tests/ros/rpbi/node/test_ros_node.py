"""`RosNode`, which scripts written for the release are made of."""

from __future__ import annotations

import sys

import pytest

SCRIPT = """
from rpbi.ros_node import RosNode
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger, TriggerResponse

class Node(RosNode):
    def __init__(self):
        RosNode.__init__(self, "script")
        self.on_shutdown(lambda: print("shut down", flush=True))
        self.set_param("~speed", 2.0)
        self.states = self.Publisher("states", JointState, queue_size=10)
        self.Service("ask", Trigger, lambda _: TriggerResponse(True, str(self.get_param("~speed"))))
        self.Subscriber("states", JointState, self.on_message, queue_size=10)
        self.wait_for_service("ask", timeout=60)
        print("answer", self.ServiceProxy("ask", Trigger)().message, flush=True)
        self.timer = self.Timer(self.Duration(0.02), self.send)
        self.Rate(100.0).sleep()
        print("message", self.wait_for_message("states", JointState, timeout=60).name, flush=True)
        print("tf", self.wait_for_tf("world", "box", timeout=60)[0], flush=True)
        self.loginfo("done")

    def send(self, event):
        self.states.publish(JointState(name=["a"]))
        self.tf.set_tf("world", "box", [1, 2, 3])

    def on_message(self, message):
        assert self.time_now() >= self.Time(0)

node = Node()
node.sleep(0.05)
print("asking", flush=True)
while not node.is_shutdown():  # Ctrl-C comes while a call to the master is under way, in which rospy itself would hang
    node.get_param("~speed")
node.spin()
"""


@pytest.mark.quick
def test_script_of_the_release_finds_everything_under_its_name(ros):
    from ros_system import stop_group, wait_until

    process = ros.start([sys.executable, "-c", SCRIPT])
    wait_until(lambda: "asking" in ros.output(process) or process.poll() is not None, "it is done")
    assert stop_group(process) == 0, ros.output(process)
    for line in ("answer 2.0", "message ['a']", "tf [1. 2. 3.]", "shut down"):
        assert line in ros.output(process)
