"""An avatar whose simulation begins anew; the simulator's part is played by the test."""

from __future__ import annotations

import math
from pathlib import Path

import rospkg
import rospy
from avatar_message import message
from geometry_msgs.msg import PoseArray
from node_world import Rosout, publishing
from ros_system import wait_until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from operator_node.avatar.joints import HINGES


def test_a_simulation_that_begins_anew_is_followed_anew(ros):
    """And a position that is not finite is refused."""
    folder = Path(rospkg.RosPack().get_path("rpbi_examples"))
    rospy.set_param("/rpbi/human/robot_description", (folder / "robots/human_model.urdf").read_text())
    rospy.set_param("/use_sim_time", True)
    log, targets = Rosout(ros), ros.listen("rpbi/human/joint_states/target", JointState)
    ros.start(["rosrun", "operator_node", "avatar_node.py"])
    with (
        publishing("/clock", Clock) as clock,
        publishing("/mvn/segments", PoseArray) as segments,
        publishing("/rpbi/human/joint_states", JointState) as states,
    ):
        now_s = 1000.0

        def go_on(position: float = 0.0) -> list[float]:
            """Lets some time pass; returns the stamps of the targets [s]."""
            nonlocal now_s
            now_s += 0.02
            clock.publish(Clock(rospy.Time.from_sec(now_s)))
            states.publish(JointState(name=HINGES, position=[position] * len(HINGES)))
            segments.publish(message({}))
            rospy.rostime.wallsleep(0.02)
            return [each.header.stamp.to_sec() for each in targets.messages]

        refusal = "a position is not finite"
        wait_until(lambda: (go_on(math.nan), log.logs(refusal))[1], "it is refused", every_s=0.0)
        assert not targets.messages
        wait_until(lambda: len(go_on()) > 3, "it follows", every_s=0.0)
        now_s = 0.0
        wait_until(lambda: len([each for each in go_on() if each < 500.0]) > 3, "it follows again", every_s=0.0)
